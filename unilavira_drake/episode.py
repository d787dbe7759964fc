"""One episode: build the Diagram, simulate it until it ends, score it, keep what happened."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
from pydrake.systems.analysis import Simulator, SimulatorStatus
from pydrake.systems.framework import Context, Diagram, System

from unilavira_drake.diagram import make_navigation_diagram
from unilavira_drake.episode_result import episode_result
from unilavira_drake.evaluation.air_goal import make_goal
from unilavira_drake.evaluation.answers import score_answer
from unilavira_drake.evaluation.goal_area import success_area
from unilavira_drake.evaluation.judge import RequestListener, judge_episode
from unilavira_drake.evaluation.scoring import (
    GoalField,
    Score,
    score,
    shortest_path,
)
from unilavira_drake.messages import Frame
from unilavira_drake.messages.metrics import UNSCORED
from unilavira_drake.mllm.broker import AttemptListener
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.latency import RealTimeLatency
from unilavira_drake.mllm.reply import Attempt
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.model_pair import ModelPair, make_models
from unilavira_drake.recording.map_picture import map_picture, stacked
from unilavira_drake.recording.message_log import Listener, MessageLog
from unilavira_drake.recording.result import EpisodeResult
from unilavira_drake.recording.run_folder import RunFolder
from unilavira_drake.recording.tally import Tally
from unilavira_drake.recording.trace import EpisodeTrace
from unilavira_drake.scenario import Scenario
from unilavira_drake.scenario_loading import dump_scenario
from unilavira_drake.task_choice import EpisodeTask, choose_task, start_pose
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.world import World

ADVANCE = 1.0
"""Simulated seconds that are advanced at once; an interrupt waits no longer."""


def run_episode(
    scenario: Scenario,
    *,
    out: str | Path | None = None,
    on_event: Listener | None = None,
    replace: Mapping[str, System] | None = None,
    detector: Callable[[Frame], ViewEvidence] | None = None,
) -> EpisodeResult:
    """Runs the scenario's task to its end and returns the result.

    Args:
        scenario: what to run.
        out: the run folder, new or empty; None keeps nothing.
        on_event: called with (simulated seconds, system, event, message) once per message, and
            with the requests to the judge of the answer.
        replace: user's own Systems, see :func:`make_navigation_diagram`.
        detector: see :func:`make_navigation_diagram`.

    The models are closed at the end.  One that cannot be reached ends the episode with the cause
    ``model_unreachable``; it is not raised.

    Raises:
        InputError: if the scenario, the task or the folder cannot be used.
        KeyboardInterrupt: if a person does not wait for the judge of the answer; the folder is
            whole, without a mark.
    """
    task = choose_task(scenario)
    world = load_world(scenario.world.name, mirror=scenario.world.mirror)
    start = start_pose(scenario, world)
    goal = None
    if task.goal:
        goal = make_goal(task.goal, world, task.rule, radius=scenario.robot.radius)
    if goal is not None:
        shortest_path(goal, *start[:3])
    tally, trace = Tally(), EpisodeTrace()
    listeners: list[Listener] = [tally.record, trace.record]
    if on_event is not None:
        listeners.append(on_event)
    ledgers: list[AttemptListener] = []
    with contextlib.ExitStack() as stack:
        models = stack.enter_context(make_models(scenario, on_attempt=_to_each(ledgers)))
        episode = _Run(scenario, models, goal, listeners, replace, detector)
        folder = None
        # Only now: what cannot be built leaves no folder behind.
        if out is not None:
            folder = stack.enter_context(RunFolder(out))
            # A run that is repeated from its folder must not write to the same cassette.
            folder.write("scenario.yaml", dump_scenario(dataclasses.replace(scenario, record="")))
            listeners.append(folder.record)
            ledgers.append(folder.record_attempt)
        episode.simulate()
        verdict = _verdict(task, episode, goal, start, tally)
        judgement = judge_episode(
            models.judge,
            verdict,
            task,
            tally.answer,
            seed=scenario.random_seed,
            on_request=_to_event(on_event, episode.metrics.time),
        )
        if judgement is not None:
            episode.timings["judge_s"] = round(judgement.usage.seconds, 3)
        result = episode_result(
            scenario, task, episode.metrics, verdict, tally, models, episode.usage, judgement
        )
        if folder is not None:
            folder.write("result.json", result.to_json())
            folder.write("timings.json", json.dumps(episode.timings, indent=2) + "\n")
            folder.write("map.png", _map(world, trace, episode, goal, task))
    if judgement is not None and judgement.interrupted:
        # What was done is kept; whoever runs many episodes must not begin the next one.
        raise KeyboardInterrupt
    return result


def _to_each(listeners: Sequence[AttemptListener]) -> AttemptListener:
    def tell(request: MllmRequest, tries: int, attempt: Attempt) -> None:
        for listener in listeners:
            listener(request, tries, attempt)

    return tell


def _to_event(on_event: Listener | None, t: float) -> RequestListener | None:
    """A person may be the judge: who watches is told, the transcript of the agent is not."""
    if on_event is None:
        return None
    return lambda request: on_event(t, "judge", "model_request", request)


def _verdict(
    task: EpisodeTask,
    episode: _Run,
    goal: GoalField | None,
    start: tuple[float, float, float, float],
    tally: Tally,
) -> Score:
    """Scores what the agent did; what UNSCORED lists is not the agent's doing."""
    metrics = episode.metrics
    if metrics.cause in UNSCORED:
        return Score(path_length_m=metrics.path_length)
    verdict = score(goal, metrics, start[:3], episode.output("observer", "panorama"), task.rule)
    if not (task.rule.by_answer and task.answers):
        return verdict
    return score_answer(
        verdict,
        tally.answer,
        task.answers,
        stopped=metrics.cause == "stopped",
        choices=task.spec.choices,
    )


def _map(
    world: World, trace: EpisodeTrace, episode: _Run, goal: GoalField | None, task: EpisodeTask
) -> bytes:
    """One panel for each storey that the robot was on, in the order of its first visits."""
    last = world.storey_at(float(episode.output("station", "cheat_X_WB").translation()[2]))
    floors = list(dict.fromkeys([*map(world.storey_at, trace.heights), last]))
    panels = []
    for floor in floors:
        part = _part_on(floor, world, trace)
        known = part.maps[max(part.maps)] if part.maps else None
        here = None if goal is None else goal.on(floor)
        number = f"Storey {world.elevations.index(floor) + 1} of {len(world.elevations)}."
        title = task.spec.text if floor == floors[0] else ""
        panels.append(
            map_picture(
                world.storey(floor),
                part,
                episode.output("navigation", "map") if floor == last else known,
                goals=() if here is None else here.places,
                goal_area=() if here is None else success_area(here, task.rule),
                title=title if len(floors) == 1 else f"{number} {title}",
            )
        )
    return stacked(panels)


def _part_on(floor: float, world: World, trace: EpisodeTrace) -> EpisodeTrace:
    return trace.on(lambda height: world.storey_at(height) == floor)


class _Run:
    """The simulation of one episode, and what is read from it afterwards."""

    def __init__(
        self,
        scenario: Scenario,
        models: ModelPair,
        goal: GoalField | None,
        listeners: list[Listener],
        replace: Mapping[str, System] | None,
        detector: Callable[[Frame], ViewEvidence] | None,
    ) -> None:
        started = time.perf_counter()
        self._diagram: Diagram = make_navigation_diagram(
            scenario,
            replace=replace,
            detector=detector,
            goal_distance=None if goal is None else goal.distance,
            on_message=MessageLog(listeners),
            models=models,
        )
        self._models = models
        self._simulator = Simulator(self._diagram)
        latencies = (scenario.language_latency, scenario.vision_latency)
        if any(isinstance(latency, RealTimeLatency) for latency in latencies):
            self._simulator.set_target_realtime_rate(1.0)
        self._interrupted = False
        self.timings = {"build_wall_s": round(time.perf_counter() - started, 3)}

    def simulate(self) -> None:
        """Advances until the monitor ends the episode, or a person does."""
        wall, cpu = time.perf_counter(), time.process_time()
        ended = SimulatorStatus.ReturnReason.kReachedTerminationCondition
        # Closed here: the calls that are given up still have their rows in the ledger.
        with _one_opencv_thread(), self._models:
            try:
                while self._simulator.AdvanceTo(self._time() + ADVANCE).reason() != ended:
                    pass
            except KeyboardInterrupt:
                self._interrupted = True
        self.timings["models_s"] = round(sum(one.seconds for one in self.usage.values()), 3)
        self.timings["episode_wall_s"] = round(time.perf_counter() - wall, 3)
        self.timings["episode_cpu_s"] = round(time.process_time() - cpu, 3)

    def output(self, part: str, port: str) -> Any:
        """Returns what stands on an output port of a named part of the Diagram."""
        system = self._diagram.GetSubsystemByName(part)
        return system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(self._context()))

    @property
    def metrics(self) -> Any:
        """The monitor's metrics; the cause is ``interrupted`` when a person ended the run."""
        metrics = self.output("episode_monitor", "metrics")
        return metrics.interrupted() if self._interrupted and not metrics.ended else metrics

    @property
    def usage(self) -> dict[str, ModelUsage]:
        """What each of the two models has used."""
        return {role: self.output("agent", f"{role}_usage") for role in ("language", "vision")}

    def _time(self) -> float:
        return float(self._context().get_time())

    def _context(self) -> Context:
        return self._simulator.get_context()


@contextlib.contextmanager
def _one_opencv_thread() -> Iterator[None]:
    """Images of this size cost more to share among OpenCV's threads than the threads save."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)
