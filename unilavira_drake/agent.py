"""The agent: language, memories, vision and goal selector in one Diagram."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass

from pydrake.systems.framework import Diagram, System

from unilavira_drake.language.system import Language
from unilavira_drake.mapping.flight_goals import FlightGoals
from unilavira_drake.mapping.goal_selector import GoalSelector
from unilavira_drake.memory.config import MemoryConfig
from unilavira_drake.memory.revert_system import OneStepRevert
from unilavira_drake.memory.todo_system import TodoMemory
from unilavira_drake.memory.waypoint_system import WaypointMemory
from unilavira_drake.messages import Frame
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.preset import PROMPT_PRESETS
from unilavira_drake.mllm.reply import Mllm
from unilavira_drake.model_link import Latency, ModelLink
from unilavira_drake.sensors.grounder_colors import color_candidates
from unilavira_drake.sensors.grounder_labels import LabelGrounder
from unilavira_drake.vision.grounder import Grounder
from unilavira_drake.vision.grounding import Propose, from_pictures
from unilavira_drake.vision.system import Vision
from unilavira_drake.wiring import Wiring

FLIGHT_GOALS = FlightGoals()


@dataclass(frozen=True)
class ModelChoice:
    """A model and how long it thinks."""

    broker: Broker
    latency: Latency

    @property
    def backend(self) -> Mllm:
        """The model itself."""
        return self.broker.backend


def make_agent(
    *,
    language_model: ModelChoice,
    vision_model: ModelChoice,
    memory: MemoryConfig,
    ablation: str,
    tick: float,
    seed: int,
    can_climb: bool,
    max_range: float,
    free_distance: Callable[[Frame], float],
    detector: Callable[[Frame], ViewEvidence],
    flight: FlightGoals = FLIGHT_GOALS,
    prompt_preset: str = "compact",
    grounder: str = "none",
    people: bool = False,
    stairs_barred: bool = False,
    replace: MutableMapping[str, System] | None = None,
) -> Diagram:
    """Returns the agent; it is the same for every robot.

    An ablation is wiring: without TDM ``todo_list`` stays unconnected, without SCB
    ``second_chance`` does; ``lavira``, the predecessor, has no TDM and a ``OneStepRevert``. The
    detector reaches a level only when its model declares ``perception: ground_truth``. Targets
    beyond ``max_range`` (metres) are refused. ``flight`` says how near and far an aircraft goes.
    ``prompt_preset`` is a key of ``PROMPT_PRESETS``.
    ``grounder`` is ``none``, ``color`` or ``label`` (which reads the detector); a ``grounder`` in
    ``replace`` is wired in any case. ``people``: its prompts say who is where and moves how.
    ``stairs_barred``: they say that there are stairs here and this robot takes none.
    """
    wiring = Wiring(replace)
    preset = PROMPT_PRESETS[prompt_preset]

    def evidence(model: ModelChoice) -> Callable[[Frame], ViewEvidence] | None:
        return detector if model.backend.perception == "ground_truth" else None

    wiring.add(
        "language",
        lambda: Language(
            period=tick,
            seed=seed,
            can_climb=can_climb,
            free_distance=free_distance,
            detector=evidence(language_model),
            view_detail=preset.view_detail,
            history_detail=preset.history_detail,
            stairs_barred=stairs_barred,
            reach=flight.horizon,
        ),
    )
    wiring.add(
        "vision",
        lambda: Vision(
            period=tick,
            seed=seed,
            detector=evidence(vision_model),
            box_space=vision_model.backend.box_space,
        ),
    )
    for role, model in (("language", language_model), ("vision", vision_model)):
        wiring.add(
            f"{role}_link",
            lambda model=model: ModelLink(  # type: ignore[misc]
                broker=model.broker, latency=model.latency, period=tick
            ),
        )
        wiring.connect(role, "model_request", f"{role}_link")
        wiring.connect(f"{role}_link", "model_reply", role)
    wiring.add(
        "waypoint_memory",
        lambda: WaypointMemory(
            period=tick,
            waypoints=memory.waypoints,
            decisions=memory.decisions,
            keyframes=preset.history_factor * memory.keyframes,
            keyframe_travel=memory.keyframe_travel,
            merge_distance=memory.merge_distance,
            picture_width=preset.history_width,
        ),
    )
    wiring.add("goal_selector", lambda: GoalSelector(max_range=max_range, flight=flight))
    wiring.connect("waypoint_memory", "history", "language")
    if ablation in ("full", "no_tdm"):
        wiring.connect("waypoint_memory", "second_chance", "language")
    if ablation == "lavira":
        wiring.add("one_step_revert", OneStepRevert)
        wiring.connect("waypoint_memory", "history", "one_step_revert")
        wiring.connect("one_step_revert", "second_chance", "language")
    if ablation in ("full", "no_scb"):
        wiring.add("todo_memory", lambda: TodoMemory(period=tick))
        wiring.connect("language", "language_action", "todo_memory")
        wiring.connect("todo_memory", "todo_list", "language")
        wiring.connect("todo_memory", "todo_list", "vision")
        wiring.give_output("todo_memory", "todo_list")
    for level in ("vision", "waypoint_memory", "goal_selector"):
        wiring.connect("language", "language_action", level)
    marker = "vision"
    if has_grounder(grounder, replace):
        marker = "grounder"
        wiring.add(
            marker,
            lambda: Grounder(
                propose=_grounder(grounder, detector), period=tick, max_range=max_range
            ),
        )
        wiring.connect("vision", "vision_action", marker)
        wiring.give_output(marker, "grounding")
    wiring.connect(marker, "vision_action", "waypoint_memory")
    wiring.connect(marker, "vision_action", "goal_selector")
    wiring.connect("waypoint_memory", "history", "goal_selector")
    _border(wiring)
    if people:
        wiring.take_input("people", "language")
    if marker != "vision":
        wiring.take_input("panorama", marker)
    return wiring.build("agent")


def has_grounder(grounder: str, replace: Mapping[str, System] | None) -> bool:
    """Whether an agent has an auxiliary grounder: one of ours, or a user's own."""
    return grounder != "none" or "grounder" in (replace or {})


def _grounder(name: str, detector: Callable[[Frame], ViewEvidence]) -> Propose:
    return LabelGrounder(detector) if name == "label" else from_pictures(color_candidates)


def _border(wiring: Wiring) -> None:
    wiring.take_input("task", "language", "vision")
    wiring.take_input("panorama", "language", "vision", "waypoint_memory", "goal_selector")
    wiring.take_input("front.color_image", "waypoint_memory")
    wiring.take_input("pose_estimate", "waypoint_memory")
    wiring.give_output("goal_selector", "goal")
    wiring.give_output("language", "language_action")
    wiring.give_output("vision", "vision_action")
    wiring.give_output("waypoint_memory", "history")
    for role in ("language", "vision"):
        wiring.give_output(role, "model_request", f"{role}_request")
        wiring.give_output(f"{role}_link", "model_reply", f"{role}_reply")
        wiring.give_output(f"{role}_link", "usage", f"{role}_usage")
        wiring.give_wanted(f"{role}_link", "awaited", f"{role}_awaited")
