"""Navigation in the air: voxel mapper, flight planner, controller and governor in one Diagram."""

from __future__ import annotations

import math
from collections.abc import MutableMapping

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Diagram, System

from unilavira_drake.mapping.voxel_system import VoxelMapper
from unilavira_drake.messages import Intrinsics
from unilavira_drake.planning.visibility_system import VisibilityPlanner
from unilavira_drake.robots.flight_config import FlightConfig
from unilavira_drake.robots.flight_controller import FlightController
from unilavira_drake.robots.flight_governor import FlightGovernor
from unilavira_drake.robots.flight_limits import FlightLimits
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.wiring import Wiring

MOVING_VIEWS = ("front", "down")
"""The views that are mapped on the way: ahead, where the nose points, and below.  A panorama adds
them all."""

PLANNED_BESIDE = 0.04
"""Kept free on either side of an aircraft in a gap that it flies through straight, metres: no less
than it needs when it is as far off the line, and its nose, as the controller lets it go in."""


def make_flight_navigation(
    *,
    robot: Quadrotor,
    intrinsics: Intrinsics,
    flight: FlightConfig,
    tick: float,
    time_step: float,
    replace: MutableMapping[str, System] | None = None,
) -> Diagram:
    """Returns the deterministic half of Robot Action (paper III-B.3 and V) for an aircraft.

    Its ports are those of ``make_navigation``; ``map`` carries a ``VoxelMap``.
    """
    wiring = Wiring(replace)
    cameras = tuple(view for view in MOVING_VIEWS if view in robot.views)
    _add_mapper_and_planner(wiring, robot, dict.fromkeys(cameras, intrinsics), flight, tick)
    limits = FlightLimits(
        max_speed=robot.max_speed,
        max_climb_speed=robot.max_climb_speed,
        max_descent_speed=robot.max_descent_speed,
        max_yaw_rate=robot.max_yaw_rate,
        max_acceleration=robot.max_acceleration,
        max_braking=robot.max_braking,
        period=robot.control_period,
    )
    wiring.add(
        "controller",
        lambda: FlightController(limits=limits, max_yaw_acceleration=robot.max_yaw_acceleration),
    )
    wiring.add(
        "governor",
        # At rest the map is renewed once per rest period; half a period more is a late map.
        lambda: FlightGovernor(
            limits=limits,
            size=(robot.length, robot.width),
            fence=fence_of(flight),
            offset=time_step,
            map_timeout=1.5 * flight.rest_period,
        ),
    )
    wiring.connect("mapper", "voxel_map", "planner")
    wiring.connect("mapper", "voxel_map", "governor", "map")
    wiring.connect("planner", "path", "controller")
    wiring.connect("controller", "desired_command", "governor")
    wiring.take_input("goal", "planner")
    wiring.take_input("panorama", "mapper")
    wiring.take_input("sweep", "controller")
    for view in cameras:
        wiring.take_input(f"{view}.depth_image", "mapper")
        wiring.take_input(f"{view}.X_BC", "mapper")
    wiring.take_input("pose_estimate", "mapper", "planner", "controller", "governor")
    wiring.take_input("twist", "controller", "governor")
    for role in ("language", "vision"):
        wiring.take_wanted(f"{role}_awaited", "governor")
    wiring.give_output("governor", "base_command")
    wiring.give_output("planner", "navigation_status")
    wiring.give_output("planner", "path")
    wiring.give_output("mapper", "voxel_map", "map")
    return wiring.build("navigation")


def fence_of(flight: FlightConfig) -> NDArray[np.float64]:
    """Returns the lowest and highest x, y, z of the aircraft's centre; (2, 3) metres."""
    x_min, y_min, x_max, y_max = flight.geofence or (-np.inf, -np.inf, np.inf, np.inf)
    return np.array([[x_min, y_min, flight.min_altitude], [x_max, y_max, flight.max_altitude]])


def _add_mapper_and_planner(
    wiring: Wiring,
    robot: Quadrotor,
    cameras: dict[str, Intrinsics],
    flight: FlightConfig,
    tick: float,
) -> None:
    wiring.add(
        "mapper",
        lambda: VoxelMapper(
            intrinsics=cameras,
            resolution=flight.resolution,
            max_range=flight.max_range,
            far_is_free=True,
            stride=flight.stride,
            travel=flight.travel,
            turn=math.radians(flight.turn_degrees),
            rest_period=flight.rest_period,
            min_altitude=flight.min_altitude,
            max_altitude=flight.max_altitude,
            period=tick,
        ),
    )
    wiring.add(
        "planner",
        lambda: VisibilityPlanner(
            radius=robot.radius,
            narrow_radius=0.5 * robot.width + PLANNED_BESIDE,
            ground_margin=flight.ground_margin,
            ceiling_margin=flight.ceiling_margin,
            min_altitude=flight.min_altitude,
            max_altitude=flight.max_altitude,
            # It climbs and sinks on the spot.
            climb_angle=0.5 * math.pi,
            descend_angle=0.5 * math.pi,
            geofence=tuple(flight.geofence),
            takeoff_altitude=flight.takeoff_altitude,
            snap_distance=flight.snap_distance,
            tolerance=flight.tolerance,
            stuck_time=flight.stuck_time,
            travel_factor=flight.travel_factor,
            period=tick,
        ),
    )
