"""Navigation: mapper, planner, controller and governor in one Diagram."""

from __future__ import annotations

import math
from collections.abc import MutableMapping, Sequence

from pydrake.systems.framework import Diagram, System

from unilavira_drake.flight_navigation import make_flight_navigation
from unilavira_drake.mapping.config import MappingConfig
from unilavira_drake.mapping.occupancy import NEWEST
from unilavira_drake.mapping.system import OccupancyMapper
from unilavira_drake.messages import Intrinsics
from unilavira_drake.planning.config import PlanningConfig
from unilavira_drake.planning.system import FastMarchingPlanner
from unilavira_drake.robots.drive_limits import DriveLimits, Reaction
from unilavira_drake.robots.flight_config import FlightConfig
from unilavira_drake.robots.governor import Governor
from unilavira_drake.robots.ground_controller import GroundTrackingController
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.robot import GroundRobot, Robot
from unilavira_drake.robots.stopping import Footprint
from unilavira_drake.wiring import Wiring


def make_navigation(
    *,
    robot: Robot,
    intrinsics: Intrinsics,
    mapping: MappingConfig,
    planning: PlanningConfig,
    tick: float,
    time_step: float,
    flight: FlightConfig | None = None,
    replace: MutableMapping[str, System] | None = None,
    moving_labels: Sequence[int] = (),
) -> Diagram:
    """Returns the deterministic half of Robot Action (paper III-B.3); the robot's type chooses.

    ``mapping`` and ``planning`` are for the ground, ``flight`` (by default for rooms) for the air.
    With ``moving_labels``, render labels of what moves, it has the input ``front.label_image``.

    Raises:
        TypeError: if nothing is known to steer such a robot.
    """
    if isinstance(robot, GroundRobot):
        return _make_ground_navigation(
            robot, intrinsics, mapping, planning, tick, time_step, replace, moving_labels
        )
    if isinstance(robot, Quadrotor):
        return make_flight_navigation(
            robot=robot,
            intrinsics=intrinsics,
            flight=flight or FlightConfig(),
            tick=tick,
            time_step=time_step,
            replace=replace,
        )
    raise TypeError(
        f"nothing steers a {type(robot).__name__}; derive it from GroundRobot or Quadrotor"
    )


def _make_ground_navigation(
    robot: GroundRobot,
    intrinsics: Intrinsics,
    mapping: MappingConfig,
    planning: PlanningConfig,
    tick: float,
    time_step: float,
    replace: MutableMapping[str, System] | None,
    moving_labels: Sequence[int],
) -> Diagram:
    wiring = Wiring(replace)
    _add_mapper_and_planner(wiring, robot, intrinsics, mapping, planning, tick, moving_labels)
    limits = DriveLimits(
        max_speed=robot.max_speed,
        max_yaw_rate=robot.max_yaw_rate,
        max_acceleration=robot.max_acceleration,
        max_yaw_acceleration=robot.max_yaw_acceleration,
        period=robot.hold,
    )
    # A command reaches the wheels in the plant's next step and shows in the one after; a body that
    # walks takes it two steps later.
    walks = robot.gait is not None
    reaction = Reaction(delay=(4.0 if walks else 2.0) * time_step)
    lateral = robot.max_lateral_speed if robot.holonomic else 0.0
    wiring.add(
        "controller",
        lambda: GroundTrackingController(
            limits=limits, reaction=reaction, max_lateral_speed=lateral
        ),
    )
    wiring.add(
        "governor",
        # At rest the map is renewed once per rest period; half a period more is a late map.
        lambda: Governor(
            limits=limits,
            footprint=_footprint(robot),
            offset=time_step,
            map_timeout=1.5 * mapping.rest_period,
            newest=NEWEST if mapping.moving else 0,
            reaction_time=0.03 + (2.0 * time_step if walks else 0.0),
            max_lateral_speed=lateral,
            ramps=walks,
        ),
    )
    wiring.connect("mapper", "map", "planner")
    wiring.connect("mapper", "map", "governor")
    wiring.connect("planner", "path", "controller")
    wiring.connect("controller", "desired_command", "governor")
    wiring.take_input("goal", *(("planner", "mapper") if robot.can_climb else ("planner",)))
    wiring.take_input("panorama", "mapper")
    wiring.take_input("sweep", "controller")
    wiring.take_input("front.depth_image", "mapper")
    wiring.take_input("front.X_BC", "mapper")
    if moving_labels:
        wiring.take_input("front.label_image", "mapper")
    wiring.take_input("pose_estimate", "mapper", "planner", "controller", "governor")
    wiring.take_input("twist", "controller", "governor")
    for role in ("language", "vision"):
        wiring.take_wanted(f"{role}_awaited", "governor")
    wiring.give_output("governor", "base_command")
    wiring.give_output("planner", "navigation_status")
    wiring.give_output("planner", "path")
    wiring.give_output("mapper", "map")
    return wiring.build("navigation")


def _footprint(robot: GroundRobot) -> Footprint:
    """A base that stops before a thing has room to turn in place, and its corners pass it."""
    length, width = robot.length / 2, robot.width / 2
    standoff = max(Footprint().standoff, math.hypot(length, width) - length)
    return Footprint(half_length=length, half_width=width, standoff=standoff)


def _time_to_turn_about(robot: GroundRobot) -> float:
    """For how long a base that turns to a path behind it makes no way, seconds."""
    rate = robot.max_yaw_rate
    return math.pi / rate + rate / robot.max_yaw_acceleration + robot.hold


def _add_mapper_and_planner(
    wiring: Wiring,
    robot: GroundRobot,
    intrinsics: Intrinsics,
    mapping: MappingConfig,
    planning: PlanningConfig,
    tick: float,
    moving_labels: Sequence[int],
) -> None:
    wiring.add(
        "mapper",
        lambda: OccupancyMapper(
            intrinsics=intrinsics,
            resolution=mapping.resolution,
            max_range=mapping.max_range,
            min_height=mapping.min_height,
            max_height=mapping.max_height,
            footprint_radius=robot.radius,
            stride=mapping.stride,
            travel=mapping.travel,
            turn=math.radians(mapping.turn_degrees),
            rest_period=mapping.rest_period,
            moving=mapping.moving,
            moving_labels=moving_labels,
            period=tick,
        ),
    )
    wiring.add(
        "planner",
        lambda: FastMarchingPlanner(
            radius=robot.radius,
            turning_radius=robot.turning_radius,
            snap_distance=planning.snap_distance,
            tolerance=planning.tolerance,
            stuck_time=max(planning.stuck_time, 2.0 * _time_to_turn_about(robot)),
            travel_factor=planning.travel_factor,
            patience=planning.patience,
            can_climb=robot.can_climb,
            period=tick,
        ),
    )
