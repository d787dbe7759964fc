"""The two models of an episode, the judge of its answer, and what keeps their calls."""

from __future__ import annotations

import datetime
from pathlib import Path
from types import TracebackType

from unilavira_drake.errors import ScenarioError
from unilavira_drake.mllm.backends import make_backend
from unilavira_drake.mllm.broker import AttemptListener, Broker
from unilavira_drake.mllm.cassette import CassetteHeader
from unilavira_drake.mllm.cassette_file import CassetteWriter
from unilavira_drake.mllm.judges import make_judge
from unilavira_drake.mllm.replay import CassetteModel, RecordingModel, answered_by, declared
from unilavira_drake.mllm.reply import Mllm
from unilavira_drake.scenario import Scenario
from unilavira_drake.task_choice import choose_task


class ModelPair:
    """The brokers of the language and the vision model; as a context manager it closes both.

    Args:
        language: for the role ``language``.
        vision: for the role ``vision``.
        judge: for the role ``judge``; asked when the others are closed, and closed by who asks it.
    """

    def __init__(self, language: Broker, vision: Broker, judge: Broker | None = None) -> None:
        self.language = language
        self.vision = vision
        self.judge = judge

    def __enter__(self) -> ModelPair:
        """Returns itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Closes language and vision, also after an error or an interrupt."""
        self.close()

    def close(self) -> None:
        """Gives up the agent's calls under way; replies that have come stay readable."""
        self.language.close()
        self.vision.close()


def make_models(scenario: Scenario, *, on_attempt: AttemptListener | None = None) -> ModelPair:
    """Returns the models that a scenario names; with ``record`` their replies are kept.

    Args:
        scenario: what is run.
        on_attempt: called after each attempt of each call, from other threads; see ``Broker``.

    Raises:
        InputError: if a model cannot be made, or the cassette cannot be written.
        CassetteError: if the cassette to continue is broken.
    """
    language = make_backend(scenario.language_model, role="language", place="language_model")
    vision = make_backend(scenario.vision_model, role="vision", place="vision_model")
    judge = make_judge(scenario.judge_model) if scenario.judge_model else None
    for model in (language, vision):
        if isinstance(model, CassetteModel) and model.preset != scenario.prompt_preset:
            raise ScenarioError(
                f"prompt_preset: {scenario.prompt_preset!r}, but the cassette was recorded with "
                f"{model.preset!r}; set prompt_preset={model.preset}."
            )
    if scenario.record:
        cassette = CassetteWriter(
            Path(scenario.record).expanduser(),
            header=_header(scenario, language, vision, judge),
            mode=scenario.record_mode,
        )
        language = RecordingModel(language, cassette)
        vision = RecordingModel(vision, cassette)
        judge = RecordingModel(judge, cassette) if judge is not None else None
    return ModelPair(
        Broker(language, on_attempt=on_attempt),
        Broker(vision, on_attempt=on_attempt),
        None if judge is None else Broker(judge, on_attempt=on_attempt),
    )


def _header(scenario: Scenario, language: Mllm, vision: Mllm, judge: Mllm | None) -> CassetteHeader:
    who = dict.fromkeys((answered_by(language), answered_by(vision)))
    return CassetteHeader(
        answered_by=" and ".join(who),
        date=datetime.date.today().isoformat(),
        preset=scenario.prompt_preset,
        scenario=scenario.name,
        task=choose_task(scenario).spec.text,
        ablation=scenario.ablation,
        seed=scenario.random_seed,
        language=declared(language),
        vision=declared(vision),
        judge=None if judge is None else declared(judge),
    )
