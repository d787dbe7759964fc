"""Navigation: mapper, planner, controller and governor in one Diagram."""

from __future__ import annotations

import math
from collections.abc import MutableMapping

from pydrake.systems.framework import Diagram, System

from unilavira_drake.mapping.system import OccupancyMapper
from unilavira_drake.messages import Intrinsics
from unilavira_drake.planning.system import FastMarchingPlanner
from unilavira_drake.robots.cobot_magic import CobotMagic
from unilavira_drake.robots.governor import Governor
from unilavira_drake.robots.ground_controller import GroundTrackingController
from unilavira_drake.scenario import MappingConfig, PlanningConfig
from unilavira_drake.wiring import Wiring


def make_navigation(
    *,
    robot: CobotMagic,
    intrinsics: Intrinsics,
    mapping: MappingConfig,
    planning: PlanningConfig,
    tick: float,
    replace: MutableMapping[str, System] | None = None,
) -> Diagram:
    """Returns the deterministic half of Robot Action (paper III-B.3) for a ground robot."""
    wiring = Wiring(replace)
    wiring.add("mapper", lambda: make_mapper(robot, intrinsics, mapping, tick))
    wiring.add("planner", lambda: make_planner(robot, planning, tick))
    wiring.add("controller", lambda: make_controller(robot))
    wiring.add("governor", lambda: make_governor(robot))
    wiring.connect("mapper", "map", "planner")
    wiring.connect("mapper", "map", "governor")
    wiring.connect("planner", "path", "controller")
    wiring.connect("controller", "desired_command", "governor")
    wiring.take_input("goal", "planner")
    wiring.take_input("panorama", "mapper")
    wiring.take_input("sweep", "controller")
    wiring.take_input("front.depth_image", "mapper")
    wiring.take_input("front.X_BC", "mapper")
    wiring.take_input("pose_estimate", "mapper", "planner", "controller", "governor")
    wiring.take_input("twist", "controller", "governor")
    wiring.give_output("governor", "base_command")
    wiring.give_output("planner", "navigation_status")
    wiring.give_output("planner", "path")
    wiring.give_output("mapper", "map")
    return wiring.build("navigation")
