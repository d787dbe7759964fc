"""The true aircraft, not its setpoint, before a wall: plant, autopilot and governor in a loop."""

import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from simulated_quadrotor import add_flying_body

from unilavira_drake.messages import VoxelMap
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.robots.flight_governor import FlightGovernor
from unilavira_drake.robots.flight_limits import FlightLimits
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.wind import STILL_AIR, WindModel

SLOW = Quadrotor()
QUICK = Quadrotor(max_speed=2.0)
FAST = Quadrotor(max_speed=5.0, max_climb_speed=3.0, max_descent_speed=2.0, max_acceleration=2.5)
SIZE = (SLOW.length, SLOW.width)
RADIUS = 0.5 * math.hypot(*SIZE)
MARGIN = 0.02
HOVER = 6.0
"""Until then it hovers at its start, seconds."""
GUSTS = [STILL_AIR] + [
    WindModel(speed=2.0, direction=direction, gusts=1.0, seed=seed)
    for direction in (0.0, math.pi)
    for seed in (4, 5)
]


def wall_map(axis, place, resolution, *, n=1):
    """A map of a plane of voxels whose near face is at a place along an axis."""
    near, tiles = round(place / resolution), {}
    half = round(3.0 / resolution)
    for a in range(-half, half):
        for b in range(-half, half):
            voxel = np.insert([a, b], axis, near) + (0 if axis == 2 else [0, 0, half])
            key = tuple(int(index) // TILE for index in voxel)
            tile = tiles.setdefault(key, np.zeros((TILE, TILE, TILE), np.int8))
            tile[tuple(voxel % TILE)] = 20
    return VoxelMap(n=n, version=n, time=0.0, resolution=resolution, tiles=tiles)


class GovernedFlight:
    """Plant, autopilot and governor; the test plays the controller and the mapper."""

    def __init__(self, robot, wind):
        inner = DiagramBuilder()
        add_flying_body(inner, robot, wind)
        builder = DiagramBuilder()
        self.body = builder.AddSystem(inner.Build())
        fence = np.array([[-np.inf] * 3, [np.inf] * 3])
        limits = FlightLimits(
            robot.max_speed,
            robot.max_climb_speed,
            robot.max_descent_speed,
            robot.max_yaw_rate,
            robot.max_acceleration,
            robot.max_braking,
            robot.control_period,
        )
        governor = FlightGovernor(
            limits=limits, size=SIZE, fence=fence, command_timeout=np.inf, map_timeout=np.inf
        )
        builder.AddSystem(governor)
        for name, port in (("pose_estimate", "cheat_X_WB"), ("twist", "twist")):
            builder.Connect(self.body.GetOutputPort(port), governor.GetInputPort(name))
        builder.Connect(
            governor.GetOutputPort("base_command"), self.body.GetInputPort("base_command")
        )
        builder.ExportInput(governor.GetInputPort("desired_command"), "desired_command")
        builder.ExportInput(governor.GetInputPort("map"), "map")
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()

    def fix(self, name, value):
        self.diagram.GetInputPort(name).FixValue(self.context, value)

    def positions(self, until, sample=0.05):
        rows = []
        while (time := self.context.get_time() + sample) < until:
            self.simulator.AdvanceTo(time)
            root = self.body.GetMyContextFromRoot(self.context)
            rows.append(self.body.GetOutputPort("cheat_X_WB").Eval(root).translation())
        return np.array(rows)


def nearest(robot, wind, *, direction, distance, resolution=0.1, appears_at=0.0, height=2.0):
    """Returns the least distance to a wall towards which the aircraft is told to fly, metres."""
    axis = int(np.argmax(np.abs(direction)))
    flight = GovernedFlight(robot, wind)
    flight.fix("map", AbstractValue.Make(VoxelMap(n=1, resolution=resolution)))
    flight.fix("desired_command", np.array([0.0, 0.0, height, 0.0, 0.0, 0.0, 0.0, 0.0]))
    flight.positions(HOVER)
    way = np.array(direction) / np.linalg.norm(direction)
    speed = robot.max_speed if axis != 2 else robot.max_climb_speed
    target = np.array([0.0, 0.0, height]) + way * (distance + 20.0)
    flight.fix("desired_command", np.array([*target, 0.0, *(way * speed), 0.0]))
    flight.positions(HOVER + appears_at)
    place = distance * way[axis] + (height if axis == 2 else 0.0)
    place = round(place / resolution) * resolution
    flight.fix("map", AbstractValue.Make(wall_map(axis, place, resolution, n=2)))
    rows = flight.positions(HOVER + distance / speed + speed + 8.0)
    reached = rows[-1] @ way > (height * way[2] + 0.5 * distance)
    assert reached
    return float((place - rows[:, axis]).min())


@pytest.mark.parametrize("wind", GUSTS)
@pytest.mark.parametrize(
    ("robot", "distance", "resolution"), [(SLOW, 4.0, 0.1), (QUICK, 8.0, 0.1), (FAST, 20.0, 0.5)]
)
def test_at_full_speed_it_never_touches_a_wall(robot, distance, resolution, wind):
    gap = nearest(robot, wind, direction=(1, 0, 0), distance=distance, resolution=resolution)
    assert gap > RADIUS + MARGIN


@pytest.mark.parametrize("direction", [(1, 0.9, 0), (1, -0.5, 0.3)])
def test_nor_at_an_angle(direction):
    for robot, distance in ((SLOW, 3.0), (QUICK, 3.5)):
        assert nearest(robot, GUSTS[-1], direction=direction, distance=distance) > RADIUS + MARGIN


@pytest.mark.parametrize("robot", [SLOW, FAST])
def test_nor_a_ceiling_that_was_seen_before(robot):
    assert nearest(robot, GUSTS[1], direction=(0, 0, 1), distance=6.0) > RADIUS + MARGIN


@pytest.mark.parametrize(("robot", "flown"), [(SLOW, 2.0), (QUICK, 4.0)])
def test_a_wall_that_turns_up_where_it_can_just_stop_is_not_touched(robot, flown):
    """It is in full flight, and has the whole braking, one period and the standoff."""
    speed, when = robot.max_speed, 0.5 * robot.max_speed / robot.max_braking + flown
    when /= speed
    stopping = speed**2 / (2.0 * robot.max_braking) + 2.0 * robot.control_period * speed
    distance = flown + stopping + 0.25 + RADIUS + 0.1
    for wind in GUSTS[:3]:
        gap = nearest(robot, wind, direction=(1, 0, 0), distance=distance, appears_at=when)
        assert gap > RADIUS
