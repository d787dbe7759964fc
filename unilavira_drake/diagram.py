"""The top Diagram: task, agent, navigation, station and observer in a ring, as in the paper."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence

from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Diagram, System
from pydrake.systems.primitives import ConstantValueSource

from unilavira_drake.agent import ModelChoice, has_grounder, make_agent
from unilavira_drake.episode_monitor import EpisodeMonitor
from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.mapping.flight_goals import FlightGoals
from unilavira_drake.messages import Frame
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.model_pair import ModelPair, make_models
from unilavira_drake.navigation import make_navigation
from unilavira_drake.people.adding import mapping_among, oldest_panorama, planning_among
from unilavira_drake.people.config import tells_of_people
from unilavira_drake.people.crowd import detected_labels, make_crowd, with_people
from unilavira_drake.people.tracker import PeopleTracker
from unilavira_drake.recording.recorder import Recorder
from unilavira_drake.robots.recalibration import Recalibration
from unilavira_drake.scenario import Scenario, plant_config
from unilavira_drake.sensors.detections import GroundTruthDetector
from unilavira_drake.sensors.free_distance import axial_distance, free_distance, warm_up
from unilavira_drake.sensors.observer import Observer
from unilavira_drake.sensors.rig import front_intrinsics
from unilavira_drake.station import make_navigation_station
from unilavira_drake.task_choice import choose_task, start_pose
from unilavira_drake.wiring import Wiring
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.world import World

FRAMES_KEPT = 16
"""Frames whose detections are remembered; a panorama re-issued under a new number costs none."""


def make_navigation_diagram(
    scenario: Scenario,
    *,
    replace: Mapping[str, System] | None = None,
    detector: Callable[[Frame], ViewEvidence] | None = None,
    goal_distance: Callable[[float, float, float], float] | None = None,
    on_message: Callable[[float, str, str, object], None] | None = None,
    models: ModelPair | None = None,
) -> Diagram:
    """Returns the whole system of a scenario, ready for a Simulator.

    Args:
        scenario: what to build; it is read, never changed.
        replace: user's own Systems by level name (``controller``, ``planner``, ``language``,
            ...); each must have the ports of the level whose place it takes.
        detector: what a model declared ``ground_truth`` is told about a frame; by default the
            simulator's labels.
        goal_distance: metres from a place (x, y, z) to the goal, for the monitor; None when the
            episode is not scored.
        on_message: called at every tick with (time, system, event, message) for each message
            on a port; a ``recording.message_log.MessageLog`` passes the new ones on.
        models: the two models, which the caller closes; by default those of the scenario.

    Raises:
        InputError: if the scenario names something that does not exist.
        PortTypeError: if a replaced level lacks a port.
    """
    own = dict(replace or {})
    if "locomotion" in own and scenario.robot.flies:
        raise ScenarioError("replace: 'locomotion' moves bodies on the ground; leave it out.")
    warm_up()  # The agent takes this function from us; no System of its own compiles it.
    grounder = has_grounder(scenario.grounder, own)
    models = models or make_models(scenario)
    world = with_people(
        load_world(scenario.world.name, mirror=scenario.world.mirror), scenario.people
    )
    task = choose_task(scenario)
    x, y, height, yaw = start_pose(scenario, world)
    intrinsics = front_intrinsics(scenario.robot)
    wiring = Wiring(own)
    wiring.add("task", lambda: ConstantValueSource(AbstractValue.Make(task.spec)))
    wiring.add(
        "station",
        lambda: make_navigation_station(
            scenario,
            world=world,
            start=(x, y, yaw),
            start_height=height,
            locomotion=own.pop("locomotion", None),
        ),
    )
    wiring.add(
        "observer",
        lambda: Observer(
            intrinsics=intrinsics,
            period=scenario.tick,
            views=scenario.robot.views,
            sweep_direction=scenario.robot.sweep_direction,
            max_age=oldest_panorama(scenario.people),
            rest_rate=scenario.robot.rest_rate,
            rest_speed=scenario.robot.rest_speed,
        ),
    )
    wiring.add(
        "agent",
        lambda: make_agent(
            language_model=ModelChoice(models.language, scenario.language_latency),
            vision_model=ModelChoice(models.vision, scenario.vision_latency),
            memory=scenario.memory,
            ablation=scenario.ablation,
            tick=scenario.tick,
            seed=scenario.random_seed,
            can_climb=scenario.robot.can_climb,
            max_range=scenario.robot.max_depth,
            free_distance=_free_distance(scenario),
            detector=functools.lru_cache(FRAMES_KEPT)(
                detector or GroundTruthDetector(world.labels, max_range=scenario.robot.max_depth)
            ),
            flight=FlightGoals(
                stand_off=scenario.flight.stand_off,
                clearance=scenario.flight.goal_clearance,
                horizon=scenario.flight.horizon,
            ),
            prompt_preset=scenario.prompt_preset,
            grounder=scenario.grounder,
            people=tells_of_people(scenario.people),
            stairs_barred=_stairs_barred(scenario, world),
            replace=own,
        ),
    )
    wiring.add(
        "navigation",
        lambda: make_navigation(
            robot=scenario.robot,
            intrinsics=intrinsics,
            mapping=mapping_among(scenario.people, scenario.mapping),
            planning=planning_among(scenario.people, scenario.planning),
            flight=scenario.flight.mirrored_if(world.mirrored),
            tick=scenario.tick,
            time_step=plant_config(scenario).time_step,
            replace=own,
            moving_labels=detected_labels(world, scenario.people),
        ),
    )
    wiring.add(
        "episode_monitor",
        lambda: EpisodeMonitor(
            period=scenario.tick,
            budgets=task.budgets,
            goal_distance=goal_distance,
            flies=scenario.robot.flies,
        ),
    )
    _close_the_ring(wiring, scenario.robot.views)
    if scenario.recalibration_period or "recalibration" in own:
        period = scenario.recalibration_period or math.inf
        wiring.add("recalibration", lambda: Recalibration(period=period))
        wiring.connect_wanted("recalibration", "recalibrations", "station")
    if scenario.people.count:
        wiring.connect("station", "cheat_people", "episode_monitor")
    if detected_labels(world, scenario.people):
        wiring.connect("station", "front.label_image", "navigation")
    if tells_of_people(scenario.people):
        _track_people(wiring, scenario, world, (x, y))
    if on_message is not None:
        wiring.add(
            "recorder",
            lambda: Recorder(
                on_message,
                period=scenario.tick,
                grounder=grounder,
                in_flight=scenario.robot.flies,
            ),
        )
        _listen(wiring, todo=scenario.ablation in ("full", "no_scb"), grounder=grounder)
    if own:
        levels = (*_TOP_LEVELS, *_OPTIONAL_LEVELS, *_AGENT_LEVELS, *_NAVIGATION_LEVELS)
        raise ScenarioError(unknown_name("level", next(iter(own)), levels, "replace"))
    return wiring.build("unilavira")


def _free_distance(scenario: Scenario) -> Callable[[Frame], float]:
    """Returns what measures how far a view is free: over a floor, or along an aircraft's axis."""
    max_range = scenario.robot.max_depth
    if scenario.robot.flies:
        return functools.partial(axial_distance, max_range=max_range)
    return functools.partial(
        free_distance,
        min_height=scenario.mapping.min_height,
        max_height=scenario.mapping.max_height,
        max_range=max_range,
    )


def _stairs_barred(scenario: Scenario, world: World) -> bool:
    """Whether there are other floors and the robot reaches none: it neither climbs nor flies up."""
    if scenario.robot.can_climb or not world.stairs:
        return False
    lowest = min(stairs.top for stairs in world.stairs)
    return not scenario.robot.flies or scenario.flight.max_altitude < lowest


_OPTIONAL_LEVELS = ("people_tracker", "recalibration", "locomotion")
_TOP_LEVELS = ("task", "station", "observer", "agent", "navigation", "episode_monitor", "recorder")
_AGENT_LEVELS = (
    "language",
    "language_link",
    "vision",
    "vision_link",
    "grounder",
    "todo_memory",
    "waypoint_memory",
    "goal_selector",
)
_NAVIGATION_LEVELS = ("mapper", "planner", "controller", "governor")


def _close_the_ring(wiring: Wiring, views: Sequence[str]) -> None:
    for view in views:
        for port in ("color_image", "depth_image", "label_image", "X_BC"):
            wiring.connect("station", f"{view}.{port}", "observer")
    wiring.connect("station", "pose_estimate", "observer")
    wiring.connect("station", "twist", "observer")
    wiring.connect("navigation", "navigation_status", "observer")
    wiring.connect("task", "y0", "agent", "task")
    wiring.connect("observer", "panorama", "agent")
    wiring.connect("station", "front.color_image", "agent")
    wiring.connect("station", "pose_estimate", "agent")
    wiring.connect("agent", "goal", "navigation")
    wiring.connect("observer", "panorama", "navigation")
    wiring.connect("observer", "sweep", "navigation")
    for port in ("front.depth_image", "front.X_BC", "pose_estimate", "twist"):
        wiring.connect("station", port, "navigation")
    for view in views:
        if view != "front":
            wiring.connect_wanted("station", f"{view}.depth_image", "navigation")
            wiring.connect_wanted("station", f"{view}.X_BC", "navigation")
    wiring.connect("navigation", "base_command", "station")
    wiring.connect("station", "cheat_X_WB", "episode_monitor")
    wiring.connect("station", "contact_results", "episode_monitor")
    wiring.connect("agent", "language_action", "episode_monitor")
    wiring.connect("observer", "panorama", "episode_monitor")
    wiring.connect("navigation", "navigation_status", "episode_monitor")
    for role in ("language", "vision"):
        wiring.connect("agent", f"{role}_usage", "episode_monitor")
        wiring.connect_wanted("agent", f"{role}_awaited", "navigation")


def _track_people(
    wiring: Wiring, scenario: Scenario, world: World, start: tuple[float, float]
) -> None:
    """Adds the level that tells the agent of people, from the simulator's labels."""
    robot = scenario.robot
    crowd = make_crowd(scenario.people, world, seed=scenario.random_seed, robot=start)
    wiring.add(
        "people_tracker",
        lambda: PeopleTracker(
            clothes={person.label: person.color for person in crowd},
            intrinsics=front_intrinsics(robot),
            views=robot.views,
        ),
    )
    for view in robot.views:
        for port in ("depth_image", "label_image", "X_BC"):
            wiring.connect("station", f"{view}.{port}", "people_tracker")
    wiring.connect("station", "pose_estimate", "people_tracker")
    wiring.connect("people_tracker", "people", "agent")


def _listen(wiring: Wiring, *, todo: bool, grounder: bool) -> None:
    wiring.connect("observer", "panorama", "recorder")
    wiring.connect("navigation", "navigation_status", "recorder")
    wiring.connect("navigation", "map", "recorder")
    wiring.connect("episode_monitor", "metrics", "recorder")
    for port in ("language_action", "vision_action", "goal"):
        wiring.connect("agent", port, "recorder")
    for role in ("language", "vision"):
        wiring.connect("agent", f"{role}_request", "recorder")
        wiring.connect("agent", f"{role}_reply", "recorder")
    if todo:
        wiring.connect("agent", "todo_list", "recorder")
    if grounder:
        wiring.connect("agent", "grounding", "recorder")
