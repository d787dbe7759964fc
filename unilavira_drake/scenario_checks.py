"""Checks the values of a scenario that its types alone cannot tell to be wrong."""

from __future__ import annotations

import dataclasses
import math
import typing
from collections.abc import Callable, Iterator
from typing import Any

from pydrake.multibody.plant import AddMultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake.errors import InputError, ScenarioError, TaskError, unknown_name
from unilavira_drake.messages import SWEEP_ORDERS, VIEW_YAW
from unilavira_drake.mllm.backends import make_backend, profile_of
from unilavira_drake.mllm.cassette_file import RECORD_MODES
from unilavira_drake.mllm.judges import make_judge
from unilavira_drake.mllm.latency import (
    CONDITIONS,
    PaperLatency,
    RecordedLatency,
    recorded_latencies,
)
from unilavira_drake.mllm.preset import PROMPT_PRESETS
from unilavira_drake.people.crowd import make_crowd, with_people
from unilavira_drake.robots.flight_config import FlightConfig
from unilavira_drake.scenario import (
    ABLATIONS,
    GROUNDERS,
    RENDERERS,
    Scenario,
    plant_config,
    robot_kinds,
)
from unilavira_drake.sensors.exposure_config import EXPOSURES
from unilavira_drake.task_choice import choose_task, start_pose
from unilavira_drake.tasks import FAMILIES, checked_task, success_rule
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.world import World

_MAX_IMAGE = 4096

_Rule = tuple[str, Callable[[Any], bool]]

_POSITIVE: _Rule = ("a positive number", lambda value: value > 0)
_NOT_NEGATIVE: _Rule = ("a number that is not negative", lambda value: value >= 0)
_IMAGE_SIDE: _Rule = (f"16 to {_MAX_IMAGE} pixels", lambda value: 16 <= value <= _MAX_IMAGE)

_RULES: dict[str, _Rule] = {
    "random_seed": _NOT_NEGATIVE,
    "language_latency.seconds": _NOT_NEGATIVE,
    "language_latency.sigma": _NOT_NEGATIVE,
    "vision_latency.seconds": _NOT_NEGATIVE,
    "vision_latency.sigma": _NOT_NEGATIVE,
    "mapping.min_height": _NOT_NEGATIVE,
    "planning.snap_distance": _NOT_NEGATIVE,
    "planning.patience": _NOT_NEGATIVE,
    "memory.waypoints": ("at least 2", lambda v: v >= 2),
    "mapping.resolution": ("0.01 to 0.5", lambda v: 0.01 <= v <= 0.5),
    "mapping.stride": ("1 to 16", lambda v: 1 <= v <= 16),
    "planning.tolerance": ("0.01 to 1", lambda v: 0.01 <= v <= 1),
    "robot.length": ("0.1 to 3", lambda v: 0.1 <= v <= 3),
    "robot.width": ("0.1 to 3", lambda v: 0.1 <= v <= 3),
    "memory.decisions": _NOT_NEGATIVE,
    "memory.keyframes": _NOT_NEGATIVE,
    "memory.merge_distance": _NOT_NEGATIVE,
    "people.count": ("0 to 20", lambda v: 0 <= v <= 20),
    "people.seed": _NOT_NEGATIVE,
    "people.min_pause": _NOT_NEGATIVE,
    "people.max_pause": _NOT_NEGATIVE,
    "people.stop_distance": _NOT_NEGATIVE,
    "people.max_speed": ("above 0, up to 2.5", lambda v: 0 < v <= 2.5),
    "robot.image_width": _IMAGE_SIDE,
    "robot.image_height": _IMAGE_SIDE,
    "robot.max_lateral_speed": _NOT_NEGATIVE,
    "robot.command_period": _NOT_NEGATIVE,
    "robot.gait.heave": _NOT_NEGATIVE,
    "robot.gait.roll_degrees": _NOT_NEGATIVE,
    "robot.gait.pitch_degrees": _NOT_NEGATIVE,
    "robot.gait.swing_degrees": _NOT_NEGATIVE,
    "pose_estimate.position_noise": _NOT_NEGATIVE,
    "pose_estimate.yaw_noise_degrees": _NOT_NEGATIVE,
    "pose_estimate.position_drift": _NOT_NEGATIVE,
    "pose_estimate.yaw_drift_degrees": _NOT_NEGATIVE,
    "recalibration_period": _NOT_NEGATIVE,
    "exposure.target": ("0.01 to 1", lambda v: 0.01 <= v <= 1),
    "flight.wind.speed": _NOT_NEGATIVE,
    "flight.wind.direction_degrees": ("-360 to 360 degrees", lambda v: abs(v) <= 360),
    "flight.wind.gusts": _NOT_NEGATIVE,
    "flight.snap_distance": _NOT_NEGATIVE,
    "flight.ground_margin": _NOT_NEGATIVE,
    "flight.ceiling_margin": _NOT_NEGATIVE,
    "flight.stride": ("1 to 32", lambda v: 1 <= v <= 32),
    "robot.max_tilt_degrees": ("1 to 45 degrees", lambda v: 1 <= v <= 45),
    "robot.linear_drag": _NOT_NEGATIVE,
    "robot.quadratic_drag": _NOT_NEGATIVE,
    "robot.horizontal_fov_degrees": ("between 10 and 150 degrees", lambda v: 10 <= v <= 150),
}
"""Every other number of a scenario must be positive; Drake checks those of ``plant``."""


def validate(scenario: Scenario) -> None:
    """Checks every value of a scenario; what passes can be built.

    Raises:
        ScenarioError: names the dotted place, the value and the remedy.
        TaskError: for the task's name or text, and for a start that is not free.
    """
    for place, value in _numbers(scenario, ""):
        _check_number(place, value)
    _check_name("ablation", "ablation", scenario.ablation, ABLATIONS)
    _check_name("renderer", "renderer", scenario.renderer, RENDERERS)
    _check_name("grounder", "grounder", scenario.grounder, GROUNDERS)
    _check_name("exposure", "exposure.mode", scenario.exposure.mode, EXPOSURES)
    _check_name("preset", "prompt_preset", scenario.prompt_preset, sorted(PROMPT_PRESETS))
    _check_robot(scenario)
    _check_name(
        "direction", "robot.sweep_direction", scenario.robot.sweep_direction, sorted(SWEEP_ORDERS)
    )
    _check_name("mode", "record_mode", scenario.record_mode, RECORD_MODES)
    for role in ("language", "vision"):
        _check_model(scenario, role)
    if scenario.judge_model:
        make_judge(scenario.judge_model)
    _check_order(scenario)
    _check_air(scenario)
    _check_plant(scenario)
    _check_periods(scenario)
    _check_tasks(scenario)
    world = load_world(scenario.world.name, mirror=scenario.world.mirror)
    start = start_pose(scenario, world)
    if scenario.robot.flies:
        flight = scenario.flight.mirrored_if(world.mirrored)
        _check_air_start(choose_task(scenario).start, start, flight)
    _check_people(scenario, world, start[:2])


def _numbers(value: Any, place: str) -> Iterator[tuple[str, float]]:
    for field in dataclasses.fields(value):
        below = getattr(value, field.name)
        dotted = f"{place}.{field.name}" if place else field.name
        if dataclasses.is_dataclass(below):
            yield from _numbers(below, dotted)
        elif isinstance(below, int | float) and not isinstance(below, bool):
            yield dotted, below


def _check_number(place: str, value: float) -> None:
    expected, accepts = _RULES.get(place, _POSITIVE)
    if not math.isfinite(value) or not accepts(value):
        raise ScenarioError(f"{place}: {value} is not usable; give {expected}.")


def _check_name(kind: str, place: str, name: str, valid: typing.Sequence[str]) -> None:
    if name not in valid:
        raise ScenarioError(unknown_name(kind, name, valid, place))


def _check_robot(scenario: Scenario) -> None:
    kinds = robot_kinds()
    robot = scenario.robot
    _check_name("robot", "robot.name", robot.name, sorted(kinds))
    if not isinstance(robot, kinds[robot.name]):
        raise ScenarioError(
            f"robot.name: {robot.name!r} is another robot than !{type(robot).__name__}; "
            f"choose it by its tag, robot: !{kinds[robot.name].__name__} {{}}."
        )
    ring = set(robot.views) & set(VIEW_YAW)
    once = len(set(robot.views)) == len(robot.views)
    if ring not in ({"front"}, set(VIEW_YAW)) or not once:
        raise ScenarioError(
            f"robot.views: {robot.views} is not usable; name each camera once: front alone, or "
            f"{', '.join(VIEW_YAW)}, and others beside them."
        )


def _check_model(scenario: Scenario, role: str) -> None:
    place = f"{role}_model"
    spec = getattr(scenario, place)
    make_backend(spec, role=role, place=place)
    profile = profile_of(spec, place=place)
    if scenario.budgets.model_cost_usd is not None and profile is not None:
        if profile.prices is None:
            raise ScenarioError(
                f"budgets.model_cost_usd: the prices of {place} {spec!r} are not known, so money "
                "cannot be counted; set another budget, or use a profile with prices."
            )
    latency = getattr(scenario, f"{role}_latency")
    if isinstance(latency, PaperLatency):
        _check_name("condition", f"{role}_latency.condition", latency.condition, sorted(CONDITIONS))
    elif isinstance(latency, RecordedLatency):
        try:
            recorded_latencies(latency.file, role)
        except InputError as error:
            raise ScenarioError(f"{role}_latency.file: {error}") from None


def _check_order(scenario: Scenario) -> None:
    robot, mapping, flight = scenario.robot, scenario.mapping, scenario.flight
    for low, high, low_value, high_value in (
        ("robot.min_depth", "robot.max_depth", robot.min_depth, robot.max_depth),
        ("robot.min_depth", "mapping.max_range", robot.min_depth, mapping.max_range),
        ("mapping.min_height", "mapping.max_height", mapping.min_height, mapping.max_height),
        ("mapping.resolution", "mapping.max_range", mapping.resolution, mapping.max_range),
        ("flight.resolution", "flight.max_range", flight.resolution, flight.max_range),
        ("flight.min_altitude", "flight.max_altitude", flight.min_altitude, flight.max_altitude),
        ("flight.max_range", "flight.resolution x 400", flight.max_range, 400 * flight.resolution),
    ):
        if low_value >= high_value:
            raise ScenarioError(
                f"{low}: {low_value} is not below {high} ({high_value}); "
                f"lower the one or raise the other."
            )
    if robot.turning_radius < robot.radius:
        raise ScenarioError(
            f"robot.turning_radius: {robot.turning_radius} is below robot.radius "
            f"({robot.radius}); the circle swept in turning holds the robot."
        )


def _check_people(scenario: Scenario, world: World, robot: tuple[float, float]) -> None:
    people = scenario.people
    if people.count and scenario.robot.flies:
        raise ScenarioError(
            f"people.count: {people.count} people, but only robots on the ground know of people; "
            "set it to 0, or choose such a robot."
        )
    for low, high in (("min_speed", "max_speed"), ("min_pause", "max_pause")):
        if getattr(people, low) > getattr(people, high):
            raise ScenarioError(
                f"people.{low}: {getattr(people, low)} is above people.{high} "
                f"({getattr(people, high)}); lower the one or raise the other."
            )
    for index, route in enumerate(people.routes):
        for name, value, least in (
            ("speed", route.speed, 0.05),
            ("pause", route.pause, 0.0),
            ("delay", route.delay, 0.0),
        ):
            if value is not None and not least <= value < math.inf:
                raise ScenarioError(
                    f"people.routes.{index}.{name}: {value} is not usable; give {least:g} or more."
                )
    make_crowd(people, with_people(world, people), seed=scenario.random_seed, robot=robot)


def _check_air(scenario: Scenario) -> None:
    flight = scenario.flight
    if not flight.min_altitude <= flight.takeoff_altitude <= flight.max_altitude:
        raise ScenarioError(
            f"flight.takeoff_altitude: {flight.takeoff_altitude} is not between min_altitude "
            f"({flight.min_altitude}) and max_altitude ({flight.max_altitude})."
        )
    fence = flight.geofence
    if not fence:
        return
    finite = all(isinstance(side, int | float) and math.isfinite(side) for side in fence)
    if len(fence) != 4 or not finite or fence[0] >= fence[2] or fence[1] >= fence[3]:
        raise ScenarioError(
            f"flight.geofence: {fence} is not usable; give x_min, y_min, x_max, y_max in metres."
        )


def _check_air_start(
    text: str, start: tuple[float, float, float, float], flight: FlightConfig
) -> None:
    """An aircraft starts within the airspace that it must not leave, or below it."""
    x, y, z, _ = start
    if z > flight.max_altitude:
        raise TaskError(
            f"start: {text!r} is at height {z:g}, above flight.max_altitude "
            f"({flight.max_altitude:g}); start lower, or raise flight.max_altitude."
        )
    if not flight.geofence:
        return
    x_min, y_min, x_max, y_max = flight.geofence
    if not (x_min <= x <= x_max and y_min <= y <= y_max):
        raise TaskError(
            f"start: {text!r} is at {x:g},{y:g}, outside flight.geofence ([{x_min:g}, {y_min:g}, "
            f"{x_max:g}, {y_max:g}] there); choose a start within, or a larger fence."
        )


def _check_plant(scenario: Scenario) -> None:
    if scenario.plant.time_step <= 0:
        raise ScenarioError(
            f"plant.time_step: {scenario.plant.time_step} is not usable; give a positive number "
            "(the plant is discrete)."
        )
    try:
        AddMultibodyPlant(scenario.plant, DiagramBuilder())
    except (RuntimeError, SystemExit) as error:
        raise ScenarioError(f"plant: Drake refuses it: {error}") from None


def _check_periods(scenario: Scenario) -> None:
    step = plant_config(scenario).time_step
    for place, period in (
        ("tick", scenario.tick),
        ("robot.control_period", scenario.robot.control_period),
        (
            "pose_estimate.period",
            step if scenario.pose_estimate.exact else scenario.pose_estimate.period,
        ),
        ("robot.autopilot_period", getattr(scenario.robot, "autopilot_period", step)),
        ("robot.command_period", getattr(scenario.robot, "command_period", 0.0) or step),
    ):
        steps = period / step
        if steps < 0.5 or abs(steps - round(steps)) > 1e-6:
            raise ScenarioError(
                f"{place}: {period} is not a multiple of plant.time_step ({step}); "
                f"give e.g. {max(1, round(steps)) * step:g}."
            )


def _check_tasks(scenario: Scenario) -> None:
    for name, task in scenario.tasks.items():
        place = f"tasks.{name}"
        if task.family not in FAMILIES:
            raise ScenarioError(unknown_name("family", task.family, FAMILIES, f"{place}.family"))
        try:
            checked_task(task.text, task.family)
        except TaskError as error:
            raise ScenarioError(f"{place}.text: {error}") from None
        try:
            checked_task(task.text, task.family, task.choices)
            success_rule(task.family, task.protocol)
        except TaskError as error:
            raise ScenarioError(f"{place}: {error}") from None
    if scenario.default_task:
        _check_name("task", "default_task", scenario.default_task, sorted(scenario.tasks))
