"""Flights of an aircraft with planner, controller and governor through doors, on a known map."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from flight_hall import LINTEL, SIDE, THICKNESS, Block, KnownVoxels, hall, map_of
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.flight_navigation import MOVING_VIEWS, make_flight_navigation
from unilavira_drake.messages import Goal, Panorama, Sweep
from unilavira_drake.robots.actuation import add_actuation, set_start
from unilavira_drake.robots.flight_config import FlightConfig
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.robot_model import add_robot_model
from unilavira_drake.robots.wind import WindModel
from unilavira_drake.sensors.rig import front_intrinsics

GUSTS = 0.3
"""Standard deviation of the horizontal gusts, m/s; there is no steady wind."""
ROTORS = (0.19, 0.19, (-0.025, 0.045))
"""Half the sides of the body with its propellers, and its lowest and highest, metres."""

SAMPLE = 0.01
"""Seconds between two looks at pose and contacts: each step of the plant."""


@dataclass(frozen=True)
class Flight:
    """How one flight went."""

    state: str
    reason: str
    penetration: float
    """Deepest overlap with anything, metres."""
    crossed: bool
    """Whether the body was in the parting wall by more than a centimetre."""
    clearance: float
    """Least distance of the body with its propellers from the parting wall, along an axis, metres;
    negative: so deep was it in it."""
    contact: float
    """Largest force of a contact, newtons."""
    through: bool
    """Whether it came to the other side of the parting wall."""
    off_goal: float
    """Distance of the aircraft from its goal at the end, metres."""
    simulated: float
    """Seconds."""
    cpu: float
    """Seconds."""


def fly(
    robot: Quadrotor,
    config: FlightConfig,
    *,
    start: tuple[float, float, float],
    goal: tuple[float, float, float],
    door: float,
    width: float,
    seed: int,
    limit: float = 120.0,
) -> Flight:
    """Flies from a place in the air to another and returns how it went.

    Args:
        robot: who flies.
        config: how; with the resolution of the map.
        start: x, y (metres) and yaw (radians), at the height of a take-off.
        goal: x, y and z, metres.
        door: y of the middle of the door, metres.
        width: of the door, metres.
        seed: of the gusts.
        limit: seconds until it counts as failed.
    """
    blocks = hall(door, width)
    station = _station(robot, config, blocks, start, seed)
    builder = DiagramBuilder()
    builder.AddSystem(station)
    navigation = builder.AddSystem(
        make_flight_navigation(
            robot=robot,
            intrinsics=front_intrinsics(robot),
            flight=config,
            tick=0.1,
            time_step=robot.max_time_step,
            replace={"mapper": KnownVoxels(map_of(blocks, config.resolution))},
        )
    )
    for port in ("pose_estimate", "twist"):
        builder.Connect(station.GetOutputPort(port), navigation.GetInputPort(port))
    builder.Connect(navigation.GetOutputPort("base_command"), station.GetInputPort("base_command"))
    given = {
        "goal": AbstractValue.Make(Goal(1, "go", goal)),
        "panorama": AbstractValue.Make(Panorama(1, 1)),
        "sweep": AbstractValue.Make(Sweep()),
    }
    for view in MOVING_VIEWS:
        given[f"{view}.depth_image"] = Value[ImageDepth32F]()
        given[f"{view}.X_BC"] = Value[RigidTransform]()
    for port, value in given.items():
        source = builder.AddSystem(ConstantValueSource(value))
        builder.Connect(source.get_output_port(), navigation.GetInputPort(port))
    simulator = Simulator(builder.Build())
    return _watched(simulator, station, navigation, goal, door, width, limit)


def _station(
    robot: Quadrotor,
    config: FlightConfig,
    blocks: list[Block],
    start: tuple[float, float, float],
    seed: int,
) -> Any:
    builder = DiagramBuilder()
    plant_config = MultibodyPlantConfig(
        time_step=robot.max_time_step, discrete_contact_approximation="lagged"
    )
    plant, _ = AddMultibodyPlant(plant_config, builder)
    instance = add_robot_model(plant, robot)
    for index, block in enumerate(blocks):
        low, high = np.array(block[:3]), np.array(block[3:])
        plant.RegisterCollisionGeometry(
            plant.world_body(),
            RigidTransform(0.5 * (low + high)),
            Box(*(high - low)),
            f"block_{index}",
            CoulombFriction(0.5, 0.5),
        )
    plant.Finalize()
    set_start(plant, instance, robot, start, config.takeoff_altitude)
    wind = WindModel(gusts=GUSTS, seed=seed)
    add_actuation(builder, plant, instance, robot, wind=wind)
    builder.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    station = builder.Build()
    station.set_name("station")
    return station


def outline() -> NDArray[np.float64]:
    """Returns (k, 3) points around the body with its propellers, in its frame, metres."""
    x, y, heights = ROTORS
    way = np.linspace(-1.0, 1.0, 21)
    one = np.ones_like(way)
    sides = [(way, -one), (way, one), (-one, way), (one, way)]
    flat = np.concatenate([np.stack((x * a, y * b), axis=1) for a, b in sides])
    return np.concatenate([np.column_stack((flat, np.full(len(flat), z))) for z in heights])


def _watched(
    simulator: Simulator,
    station: Any,
    navigation: Any,
    goal: tuple[float, float, float],
    door: float,
    width: float,
    limit: float,
) -> Flight:
    root = simulator.get_context()
    inside, at = station.GetMyContextFromRoot(root), navigation.GetMyContextFromRoot(root)
    p_BQ = outline().T
    deepest, force, clearance = 0.0, 0.0, math.inf
    cpu = time.process_time()
    while True:
        simulator.AdvanceTo(root.get_time() + SAMPLE)
        X_WB = station.GetOutputPort("cheat_X_WB").Eval(inside)
        x, y, z = X_WB.multiply(p_BQ)
        room = np.minimum(width / 2 - np.abs(y - door), LINTEL - z)
        before = np.abs(x) - THICKNESS / 2
        clearance = min(clearance, float(np.maximum(room, before).min()))
        contacts = station.GetOutputPort("contact_results").Eval(inside)
        for index in range(contacts.num_point_pair_contacts()):
            info = contacts.point_pair_contact_info(index)
            deepest = max(deepest, info.point_pair().depth)
            force = max(force, float(np.linalg.norm(info.contact_force())))
        status = navigation.GetOutputPort("navigation_status").Eval(at)
        done = status.n == 1 and status.terminal
        if done or root.get_time() >= limit:
            return Flight(
                state=status.state if done else "failed",
                reason=status.reason if done else "time",
                penetration=deepest,
                crossed=clearance < -0.01,
                clearance=clearance,
                contact=force,
                through=bool(X_WB.translation()[0] * goal[0] > 0.0),
                off_goal=math.dist(X_WB.translation(), goal),
                simulated=root.get_time(),
                cpu=time.process_time() - cpu,
            )


def seeded_flight(robot: Quadrotor, seed: int, *, ratio: float, config: FlightConfig) -> Flight:
    """Flies from one half of a hall to the other, from where and to where the seed says.

    Args:
        robot: who flies.
        seed: of the places, of the door's place, and of the gusts.
        ratio: width of the door by that of the robot.
        config: how it flies.
    """
    random = np.random.default_rng(seed)
    margin = robot.turning_radius + 0.2
    far, side = SIDE / 2 - margin, random.choice([-1.0, 1.0])
    door = float(random.uniform(-2.5, 2.5))
    xs = random.uniform(margin, far, size=2)
    ys = random.uniform(-far, far, size=2)
    yaw = float(random.uniform(-math.pi, math.pi))
    height = float(random.uniform(0.7, 1.8))
    return fly(
        robot,
        config,
        start=(side * float(xs[0]), float(ys[0]), yaw),
        goal=(-side * float(xs[1]), float(ys[1]), height),
        door=door,
        width=ratio * robot.width,
        seed=seed,
    )
