"""The quadrotor flies a fixed tour through the apartment, in gusts, without an agent."""

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource

from unilavira_drake import load_scenario
from unilavira_drake.flight_navigation import make_flight_navigation
from unilavira_drake.messages import Goal, NavigationStatus, Panorama, Path, Sweep, VoxelMap
from unilavira_drake.ports import Level, message_input, pose_input
from unilavira_drake.sensors.rig import front_intrinsics
from unilavira_drake.station import add_navigation_station

TOUR = np.array([(2.9, 8.2, 0.1), (2.9, 8.2, 1.2), (2.9, 5.6, 1.2), (7, 5.6, 1.8), (8.5, 5.6, 0.9)])
LEGS = np.diff(TOUR, axis=0)
SCENARIO = "robot: !Quadrotor {max_speed: 0.8}\nflight: {wind: {speed: 0.5, gusts: 0.6}}"


class Tour(Level):
    """In the place of the planner: one path, whatever the goal."""

    def __init__(self):
        super().__init__(Path(1, 0, TOUR), period=0.1)
        message_input(self, "voxel_map", VoxelMap())
        message_input(self, "goal", Goal())
        pose_input(self, "pose_estimate")
        self.declare_output("path", lambda path: path, Path())
        self.declare_output("navigation_status", lambda _: NavigationStatus(), NavigationStatus())

    step = staticmethod(lambda _, state: state)


if __name__ == "__main__":
    scenario = load_scenario("apartment", SCENARIO)
    robot, flight = scenario.robot, scenario.flight
    builder = DiagramBuilder()
    station = add_navigation_station(builder, scenario)
    own = {"intrinsics": front_intrinsics(robot), "replace": {"planner": Tour()}}
    fly = make_flight_navigation(robot=robot, flight=flight, tick=0.1, time_step=0.005, **own)
    builder.AddSystem(fly)
    builder.Connect(fly.GetOutputPort("base_command"), station.GetInputPort("base_command"))
    for name, message in (("goal", Goal()), ("panorama", Panorama()), ("sweep", Sweep())):
        constant = builder.AddSystem(ConstantValueSource(AbstractValue.Make(message)))
        builder.Connect(constant.get_output_port(), fly.GetInputPort(name))
    for i in range(fly.num_input_ports()):
        if station.HasOutputPort(name := fly.get_input_port(i).get_name()):
            builder.Connect(station.GetOutputPort(name), fly.get_input_port(i))
    simulator, errors, p_WB = Simulator(builder.Build()), [], TOUR[0]
    pose, context = station.GetOutputPort("cheat_X_WB"), simulator.get_context()
    while np.linalg.norm(p_WB - TOUR[-1]) > 0.1:
        simulator.AdvanceTo(context.get_time() + 0.1)
        p_WB = np.array(pose.Eval(station.GetMyContextFromRoot(context)).translation())
        share = np.sum((p_WB - TOUR[:-1]) * LEGS, axis=1) / np.sum(LEGS**2, axis=1)
        off = p_WB - TOUR[:-1] - np.clip(share, 0, 1)[:, None] * LEGS
        errors.append(np.linalg.norm(off, axis=1).min())
    print(f"flown in {context.get_time():.1f} s; off the path by {np.percentile(errors, 95):.2f} m "
          f"in 95 % of the time, {max(errors):.2f} m at most")  # fmt: skip
