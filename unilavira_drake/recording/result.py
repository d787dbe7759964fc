"""The result of an episode and its file, ``result.json``."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.usage import ModelUsage

RESULT_SCHEMA_VERSION = 1

_DISTRIBUTIONS = ("unilavira-drake", "drake", "numpy", "opencv-python-headless", "numba")


@dataclass(frozen=True)
class TaskResult:
    """The task that was run; ``goal`` is what scored it, empty when nothing did."""

    family: str = ""
    text: str = ""
    name: str = ""
    goal: str = ""
    protocol: str = ""
    """How its stop was judged, see ``tasks.SuccessRule``."""

    @property
    def is_flight(self) -> bool:
        """Whether the task is a flight directive, whatever came of it."""
        return self.family == "aerial_vln"


@dataclass(frozen=True)
class ModelResult:
    """The models, and what they declare about themselves."""

    language: str = ""
    vision: str = ""
    perception: str = ""
    """``ground_truth`` | ``images``."""
    reasoning: str = ""
    """``rules`` | ``model`` | ``human``."""


@dataclass(frozen=True)
class MetricsResult:
    """Scores in metres and newtons; None where the episode is not scored."""

    navigation_error_m: float | None = None
    path_length_m: float = 0.0
    shortest_path_m: float | None = None
    spl: float | None = None
    oracle_success: bool | None = None
    same_room: bool | None = None
    """Whether the robot ended in the goal's room."""
    goal_seen: bool | None = None
    """Whether the goal instance is in the last panorama."""
    success_3m: bool | None = None
    """Stopped within 3 m, the radius common in the literature; beside the stricter success."""
    collisions: int = 0
    max_contact_force_n: float = 0.0
    answer: str | None = None
    answer_correct: bool | None = None
    """By exact match with an accepted answer."""
    answer_score: float | None = None
    """A judge's mark of 1 to 5 as (mark - 1) / 4; None without a judge or without its reply."""
    person_min_distance_m: float | None = None
    """The least distance between the robot's footprint and a person; None where nobody walks."""
    person_contacts: int | None = None
    """How often robot and person touched, each time one of the ``collisions``, too; None as above.
    """
    path_type: str | None = None
    """``easy`` or ``hard`` by the length of the shortest path, as OpenUAV has it; None on the
    ground."""


@dataclass(frozen=True)
class CountsResult:
    """How often what happened."""

    decisions: int = 0
    language_calls: int = 0
    vision_calls: int = 0
    reasks: int = 0
    fallbacks: int = 0
    backtracks: int = 0


@dataclass(frozen=True)
class JudgeResult:
    """What the judge of an answer said; the mark counts as ``metrics.answer_score``."""

    model: str = ""
    mark: int | None = None
    """From 1 to 5; None when no reply could be had, ``error`` then says why."""
    reasoning: str = ""
    """The sentence with which it explains the mark."""


@dataclass(frozen=True)
class RoleUsageResult:
    """What one model has cost; a cassette's replies cost what they did when recorded."""

    input_tokens: int = 0
    output_tokens: int = 0
    """Reasoning included."""
    images: int = 0
    cost_usd: float | None = None
    """None as soon as the price of one reply is not known."""
    cached_tokens: int = 0
    """How many of ``input_tokens`` came out of the provider's cache."""
    reasoning_tokens: int = 0
    """How many of ``output_tokens`` were hidden reasoning."""
    attempts: int = 0
    """Requests on the wire: the rows of the ledger, calls that were given up left out."""
    errors: int = 0
    """Calls that brought an error instead of a reply."""
    calls: int = 0
    """Questions that were answered, by a reply or by an error."""


@dataclass(frozen=True)
class UsageResult(RoleUsageResult):
    """What an episode has cost: the totals, and the part of each model in them.

    The judge of an answer is asked after the episode, so no budget of the episode counts it.
    """

    language: RoleUsageResult | None = None
    vision: RoleUsageResult | None = None
    """As ``language``: None in a file that was written before there were these entries."""
    judge: RoleUsageResult | None = None
    """None where nobody judged."""

    @staticmethod
    def of(
        language: ModelUsage, vision: ModelUsage, judge: ModelUsage | None = None
    ) -> UsageResult:
        """Returns the totals of all models and what each one has used."""
        whole = language + vision + (judge or ModelUsage())
        return UsageResult(
            **_columns(whole),
            language=RoleUsageResult(**_columns(language)),
            vision=RoleUsageResult(**_columns(vision)),
            judge=None if judge is None else RoleUsageResult(**_columns(judge)),
        )

    @staticmethod
    def read(**fields: Any) -> UsageResult:
        """Returns what the fields of a file tell."""
        parts = {
            name: RoleUsageResult(**fields[name])
            for name in ("language", "vision", "judge")
            if fields.get(name) is not None
        }
        return UsageResult(**{**fields, **parts})


def _columns(usage: ModelUsage) -> dict[str, Any]:
    return asdict(usage.total) | {
        "attempts": usage.attempts,
        "errors": usage.errors,
        "calls": usage.calls,
    }


@dataclass(frozen=True)
class TimeResult:
    """Simulated time; wall and CPU times stand in ``timings.json``."""

    simulated_s: float = 0.0


@dataclass(frozen=True)
class EpisodeResult:
    """What an episode came to: the content of ``result.json``."""

    schema_version: int = RESULT_SCHEMA_VERSION
    scored: bool = False
    success: bool | None = None
    cause: str = ""
    """Why the episode ended; a key of ``messages.metrics.CAUSES``."""
    error: str = ""
    """With the cause ``model_unreachable``: the named error; else why the judge gave no mark."""
    task: TaskResult = TaskResult()
    scenario: str = ""
    robot: str = ""
    ablation: str = "full"
    seed: int = 0
    model: ModelResult = ModelResult()
    metrics: MetricsResult = MetricsResult()
    counts: CountsResult = CountsResult()
    usage: UsageResult = UsageResult()
    judge: JudgeResult | None = None
    """None where nobody judged."""
    time: TimeResult = TimeResult()
    versions: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> str:
        """Returns the text of ``result.json``."""
        return json.dumps(asdict(self), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


_PARTS: dict[str, Callable[..., Any]] = {
    "task": TaskResult,
    "model": ModelResult,
    "metrics": MetricsResult,
    "counts": CountsResult,
    "usage": UsageResult.read,
    "time": TimeResult,
}


def result_from_json(text: str) -> EpisodeResult:
    """Returns the result that a ``result.json`` holds.

    Raises:
        InputError: if the text is no result of this schema version.
    """
    try:
        fields: dict[str, Any] = json.loads(text)
        found = fields["schema_version"]
        if found != RESULT_SCHEMA_VERSION:
            raise InputError(
                f"result.json: schema_version {found}, this program reads "
                f"{RESULT_SCHEMA_VERSION}; use the version that wrote it."
            )
        for name, part in _PARTS.items():
            fields[name] = part(**fields[name])
        if fields.get("judge") is not None:
            fields["judge"] = JudgeResult(**fields["judge"])
        return EpisodeResult(**fields)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"result.json: not a result of an episode: {error}.") from None


def installed_versions() -> dict[str, str]:
    """Returns the versions of Python and of the packages that shape an episode."""
    versions = {"python": platform.python_version()}
    for name in _DISTRIBUTIONS:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions
