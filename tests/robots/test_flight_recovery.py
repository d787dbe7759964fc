"""Stuck in flight: planner, controller, governor, autopilot and plant in a loop."""

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from simulated_quadrotor import add_flying_body

from unilavira_drake.messages import Goal, Sweep, VoxelMap
from unilavira_drake.messages.voxels import TILE
from unilavira_drake.planning.visibility_system import VisibilityPlanner
from unilavira_drake.robots.flight_controller import FlightController
from unilavira_drake.robots.flight_governor import FlightGovernor
from unilavira_drake.robots.flight_limits import FlightLimits
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.wind import WindModel

RESOLUTION = 0.1
WALL_X = 4.0
GOAL = (7.0, 0.0, 1.2)
HIGH = 2.0


def wall(version, *, half=2.0):
    """A map of a wall across the way, as high as the airspace."""
    tiles = {}
    for j in range(-round(half / RESOLUTION), round(half / RESOLUTION)):
        for k in range(round(1.5 * HIGH / RESOLUTION)):
            voxel = np.array([round(WALL_X / RESOLUTION), j, k])
            tile = tiles.setdefault(tuple(voxel // TILE), np.zeros((TILE,) * 3, np.int8))
            tile[tuple(voxel % TILE)] = 20
    return VoxelMap(n=1, version=version, resolution=RESOLUTION, tiles=tiles)


class StuckFlight:
    """The governor is told of a wall that the planner does not know until the test says so."""

    def __init__(self):
        robot = Quadrotor()
        inner, builder = DiagramBuilder(), DiagramBuilder()
        add_flying_body(inner, robot, WindModel(gusts=0.3, seed=3))
        self.body = builder.AddSystem(inner.Build())
        limits = FlightLimits()
        fence = np.array([[-np.inf, -np.inf, 0.4], [np.inf, np.inf, HIGH]])
        self.planner = builder.AddSystem(
            VisibilityPlanner(
                radius=robot.radius,
                ground_margin=0.35,
                ceiling_margin=0.25,
                min_altitude=0.4,
                max_altitude=HIGH,
                takeoff_altitude=1.2,
                climb_angle=0.5 * np.pi,
                descend_angle=0.5 * np.pi,
                tolerance=0.2,
                stuck_time=4.0,
            )
        )
        controller = builder.AddSystem(FlightController(limits=limits, max_yaw_acceleration=4.0))
        governor = builder.AddSystem(
            FlightGovernor(limits=limits, size=(0.38, 0.38), fence=fence, map_timeout=np.inf)
        )
        builder.Connect(self.planner.GetOutputPort("path"), controller.GetInputPort("path"))
        builder.Connect(
            controller.GetOutputPort("desired_command"), governor.GetInputPort("desired_command")
        )
        builder.Connect(
            governor.GetOutputPort("base_command"), self.body.GetInputPort("base_command")
        )
        for system in (self.planner, controller, governor):
            pose = system.GetInputPort("pose_estimate")
            builder.Connect(self.body.GetOutputPort("cheat_X_WB"), pose)
        for system in (controller, governor):
            builder.Connect(self.body.GetOutputPort("twist"), system.GetInputPort("twist"))
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.root = self.simulator.get_mutable_context()
        for system, port, value in (
            (controller, "sweep", Sweep()),
            (governor, "map", wall(1)),
            (self.planner, "goal", Goal(1, "go", p_WG=GOAL)),
            (self.planner, "voxel_map", VoxelMap(n=1, version=1, resolution=RESOLUTION)),
        ):
            self.give(system, port, value)
        self.rows = []

    def give(self, system, port, value):
        context = system.GetMyMutableContextFromRoot(self.root)
        system.GetInputPort(port).FixValue(context, AbstractValue.Make(value))

    def output(self, system, port):
        return system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(self.root))

    def fly_until(self, condition, limit):
        """Advances until a condition on status and path holds; keeps position and yaw."""
        while self.root.get_time() < limit:
            self.simulator.AdvanceTo(self.root.get_time() + 0.05)
            pose = self.output(self.body, "cheat_X_WB")
            yaw = pose.rotation().ToRollPitchYaw().yaw_angle()
            self.rows.append([*pose.translation(), yaw])
            status = self.output(self.planner, "navigation_status")
            if condition(status, self.output(self.planner, "path")):
                return status
        raise AssertionError(f"nothing after {limit} s: {status}")


@pytest.fixture
def stuck():
    flight = StuckFlight()
    flight.fly_until(lambda status, path: path.backwards, 30.0)
    return flight


def test_it_backs_off_without_turning_and_flies_round_what_it_has_seen_since(stuck):
    before = np.array(stuck.rows[-1])
    assert 2.5 < before[0] < WALL_X - 0.27
    assert not stuck.rows[0][0] > 0.1
    count = len(stuck.rows)
    stuck.fly_until(lambda status, path: not path.backwards, 50.0)
    back = np.array(stuck.rows[count:])
    assert 0.4 < before[0] - back[-1, 0] < 1.6
    assert np.abs(back[:, 1]).max() < 0.3
    assert np.abs(back[:, 3] - before[3]).max() < 0.15
    stuck.give(stuck.planner, "voxel_map", wall(2))
    status = stuck.fly_until(lambda status, path: status.n == 1 and status.terminal, 90.0)
    assert (status.state, status.reason) == ("arrived", "")
    assert np.linalg.norm(stuck.rows[-1][:3] - np.array(GOAL)) < 0.4
    # Round the wall, whose body never came nearer than its radius.
    rows = np.array(stuck.rows)[:, :3]
    assert np.abs(rows[:, 1]).max() > 2.0
    beside = np.maximum(np.abs(rows[:, 1]) - 2.0, 0.0)
    ahead = np.maximum(np.maximum(WALL_X - rows[:, 0], rows[:, 0] - WALL_X - RESOLUTION), 0.0)
    assert np.hypot(beside, ahead).min() > 0.27


def test_stuck_again_it_gives_up_and_hovers(stuck):
    status = stuck.fly_until(lambda status, path: status.n == 1 and status.terminal, 60.0)
    assert (status.state, status.reason) == ("failed", "stuck")
    count = len(stuck.rows)
    stuck.fly_until(lambda status, path: stuck.root.get_time() > 60.0, 70.0)
    rest = np.array(stuck.rows[count + 40 :])[:, :3]
    assert np.linalg.norm(rest - rest[0], axis=1).max() < 0.4
    assert rest[:, 0].max() < WALL_X - 0.27
