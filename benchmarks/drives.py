"""Drives of one robot with planner, controller and governor through doors, on a known map."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.mapping.config import MappingConfig
from unilavira_drake.messages import Goal, OccupancyMap, Panorama, Sweep
from unilavira_drake.navigation import make_navigation
from unilavira_drake.planning.config import PlanningConfig
from unilavira_drake.ports import Level, image_input, message_input, pose_input
from unilavira_drake.robots.actuation import add_actuation, set_start
from unilavira_drake.robots.flight_config import FlightConfig
from unilavira_drake.robots.ground_tracking import project
from unilavira_drake.robots.robot import Robot
from unilavira_drake.robots.robot_model import add_robot_model
from unilavira_drake.sensors.rig import front_intrinsics

RESOLUTION = 0.05
TIME_STEP = 0.025
THICKNESS = 0.15
SIDE = 8.0
"""The hall is this long and wide, metres; a wall with one door parts it in the middle."""

Rectangle = tuple[float, float, float, float]


class KnownMap(Level):
    """In the place of the mapper: one map, renewed twice a second."""

    def __init__(self, occupancy: OccupancyMap) -> None:
        super().__init__(occupancy, period=0.5, offset=0.0)
        message_input(self, "panorama", Panorama())
        image_input(self, "front.depth_image", ImageDepth32F)
        for name in ("front.X_BC", "pose_estimate"):
            pose_input(self, name)
        self.declare_output("map", lambda state: state, OccupancyMap())

    def step(self, context: Context, state: OccupancyMap) -> OccupancyMap:
        """Returns the map with the time of now."""
        return OccupancyMap(
            n=1, version=1, time=context.get_time(), origin=state.origin, cells=state.cells
        )


def hall(door: float, width: float) -> list[Rectangle]:
    """Returns the walls of a hall parted at x = 0 by a wall with a door at y = ``door``."""
    half, t = SIDE / 2, THICKNESS
    return [
        (-half - t, -half - t, half + t, -half),
        (-half - t, half, half + t, half + t),
        (-half - t, -half, -half, half),
        (half, -half, half + t, half),
        (-t / 2, -half, t / 2, door - width / 2),
        (-t / 2, door + width / 2, t / 2, half),
    ]


def map_of(walls: list[Rectangle]) -> OccupancyMap:
    """Returns the map of a hall; a cell is occupied whose centre is in a wall."""
    count = round((SIDE + 1.0) / RESOLUTION)
    origin = -count * RESOLUTION / 2
    centres = origin + (np.arange(count) + 0.5) * RESOLUTION
    x, y = np.meshgrid(centres, centres)
    log_odds = np.full((count, count), -5, np.int8)
    for x0, y0, x1, y1 in walls:
        log_odds[(x > x0) & (x < x1) & (y > y0) & (y < y1)] = 5
    return OccupancyMap(n=1, version=1, origin=(origin, origin), log_odds=log_odds)


@dataclass(frozen=True)
class Drive:
    """How one drive went."""

    state: str
    reason: str
    penetration: float
    """Deepest overlap with a wall, metres."""
    backed_off: bool
    """Whether it was stuck on the way and backed off."""
    crossed: bool
    """Whether the base's centre crossed the wall beside the door."""
    contact: float
    """Largest force of a contact, newtons."""
    errors: NDArray[np.float64]
    """Distance to the path at each tenth of a second of motion, metres."""
    simulated: float
    """Seconds."""
    cpu: float
    """Seconds."""


def drive(
    robot: Robot,
    *,
    start: tuple[float, float, float],
    goal: tuple[float, float],
    door: float,
    width: float,
    limit: float = 180.0,
) -> Drive:
    """Drives a robot from a pose to a point and returns how it went.

    Args:
        robot: who drives.
        start: x, y (metres) and yaw (radians).
        goal: x and y, metres.
        door: y of the middle of the door, metres.
        width: of the door, metres.
        limit: seconds until it counts as failed.
    """
    walls = hall(door, width)
    station = _station(robot, walls, start)
    builder = DiagramBuilder()
    builder.AddSystem(station)
    navigation = builder.AddSystem(
        make_navigation(
            robot=robot,
            intrinsics=front_intrinsics(robot),
            mapping=MappingConfig(),
            planning=PlanningConfig(),
            flight=FlightConfig(),
            tick=0.1,
            time_step=TIME_STEP,
            replace={"mapper": KnownMap(map_of(walls))},
        )
    )
    for port in ("pose_estimate", "twist"):
        builder.Connect(station.GetOutputPort(port), navigation.GetInputPort(port))
    builder.Connect(navigation.GetOutputPort("base_command"), station.GetInputPort("base_command"))
    for port, value in (
        ("goal", AbstractValue.Make(Goal(1, "go", (*goal, 0.0)))),
        ("panorama", AbstractValue.Make(Panorama(1, 1))),
        ("sweep", AbstractValue.Make(Sweep(1))),
        ("front.depth_image", Value[ImageDepth32F]()),
        ("front.X_BC", Value[RigidTransform]()),
    ):
        source = builder.AddSystem(ConstantValueSource(value))
        builder.Connect(source.get_output_port(), navigation.GetInputPort(port))
    return _watched(Simulator(builder.Build()), station, navigation, door, width, limit)


def _station(robot: Robot, walls: list[Rectangle], start: tuple[float, float, float]) -> Any:
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, TIME_STEP)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    instance = add_robot_model(plant, robot)
    for index, (x0, y0, x1, y1) in enumerate(walls):
        plant.RegisterCollisionGeometry(
            plant.world_body(),
            RigidTransform([(x0 + x1) / 2, (y0 + y1) / 2, 1.0]),
            Box(x1 - x0, y1 - y0, 2.0),
            f"wall_{index}",
            CoulombFriction(0.5, 0.5),
        )
    plant.Finalize()
    set_start(plant, instance, robot, start)
    add_actuation(builder, plant, instance, robot)
    builder.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    station = builder.Build()
    station.set_name("station")
    return station


def _watched(
    simulator: Simulator, station: Any, navigation: Any, door: float, width: float, limit: float
) -> Drive:
    root = simulator.get_context()
    inside, at = station.GetMyContextFromRoot(root), navigation.GetMyContextFromRoot(root)
    errors, deepest, force, crossed, before = [], 0.0, 0.0, False, 0.0
    backed_off = False
    cpu = time.process_time()
    while True:
        simulator.AdvanceTo(root.get_time() + 0.1)
        x, y, _ = station.GetOutputPort("cheat_X_WB").Eval(inside).translation()
        contacts = station.GetOutputPort("contact_results").Eval(inside)
        for index in range(contacts.num_point_pair_contacts()):
            info = contacts.point_pair_contact_info(index)
            deepest = max(deepest, info.point_pair().depth)
            force = max(force, float(np.linalg.norm(info.contact_force())))
        crossed |= before * x < 0.0 and abs(y - door) > width / 2
        before = x
        path = navigation.GetOutputPort("path").Eval(at)
        backed_off |= path.backwards
        status = navigation.GetOutputPort("navigation_status").Eval(at)
        twist = station.GetOutputPort("twist").Eval(inside)
        if len(path.p_WP) and math.hypot(*twist[3:5]) > 0.02:
            errors.append(project(path.p_WP, float(x), float(y))[2])
        done = status.n == 1 and status.terminal
        if done or root.get_time() >= limit:
            return Drive(
                state=status.state if done else "failed",
                reason=status.reason if done else "time",
                penetration=deepest,
                backed_off=backed_off,
                crossed=crossed,
                contact=force,
                errors=np.array(errors),
                simulated=root.get_time(),
                cpu=time.process_time() - cpu,
            )


def seeded_drive(robot: Robot, seed: int, *, ratio: float = 1.35) -> Drive:
    """Drives from one half of a hall to the other, from where and to where the seed says.

    Args:
        robot: who drives; a ground robot.
        seed: of the poses and of the door's place.
        ratio: width of the door by that of the robot.
    """
    random = np.random.default_rng(seed)
    margin = robot.turning_radius + 0.2
    far, side = SIDE / 2 - margin, random.choice([-1.0, 1.0])
    door = float(random.uniform(-2.5, 2.5))
    xs = random.uniform(margin, far, size=2)
    ys = random.uniform(-far, far, size=2)
    yaw = float(random.uniform(-math.pi, math.pi))
    return drive(
        robot,
        start=(side * float(xs[0]), float(ys[0]), yaw),
        goal=(-side * float(xs[1]), float(ys[1])),
        door=door,
        width=ratio * robot.width,
    )
