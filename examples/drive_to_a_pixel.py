"""Mapping, planning and driving without an agent: you choose a pixel, the robot drives there.

``GoalSelector``, ``OccupancyMapper``, ``FastMarchingPlanner`` and the controller in one's own
Diagram; in the place of language and vision stand two messages with a direction and a pixel.
"""

from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake import load_scenario
from unilavira_drake.mapping.goal_selector import GoalSelector
from unilavira_drake.mapping.system import OccupancyMapper
from unilavira_drake.messages import History, LanguageAction, VisionAction
from unilavira_drake.planning.system import FastMarchingPlanner
from unilavira_drake.robots.drive_limits import DriveLimits
from unilavira_drake.robots.governor import Governor
from unilavira_drake.robots.ground_controller import GroundTrackingController
from unilavira_drake.robots.stopping import Footprint
from unilavira_drake.sensors.observer import Observer
from unilavira_drake.sensors.rig import front_intrinsics
from unilavira_drake.station import make_navigation_station

if __name__ == "__main__":
    scenario = load_scenario("apartment")
    lens, limits = front_intrinsics(scenario.robot), DriveLimits()
    footprint = Footprint(half_length=0.35, half_width=0.29)
    systems = [
        make_navigation_station(scenario, start=(2.0, 5.7, 0.0)),
        Observer(intrinsics=lens, period=0.1),
        selector := GoalSelector(),
        OccupancyMapper(intrinsics=lens, stride=3, rest_period=2.0),
        planner := FastMarchingPlanner(),
        GroundTrackingController(limits=limits),
        Governor(limits=limits, footprint=footprint, offset=0.025, map_timeout=3.0),
    ]
    builder = DiagramBuilder()
    for system in systems:
        builder.AddSystem(system)
    ports = [s.get_output_port(k) for s in systems for k in range(s.num_output_ports())]
    outputs = {port.get_name(): port for port in ports}
    for port in [s.get_input_port(k) for s in systems for k in range(s.num_input_ports())]:
        if port.get_name() in outputs:  # What fits has the same name.
            builder.Connect(outputs[port.get_name()], port)
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    chosen = {
        "language_action": LanguageAction(n=1, tool="turn", direction="front"),
        "vision_action": VisionAction(n=1, direction="front", point=(330.0, 300.0)),
        "history": History(),
    }
    at, there = (system.GetMyMutableContextFromRoot(root) for system in (selector, planner))
    for name, message in chosen.items():
        selector.GetInputPort(name).FixValue(at, AbstractValue.Make(message))
    status = outputs["navigation_status"].Eval(there)
    while status.n == 0 or not status.terminal:
        simulator.AdvanceTo(root.get_time() + 0.1)
        status = outputs["navigation_status"].Eval(there)
    goal = outputs["goal"].Eval(at).p_WG
    print(f"{status.state} {status.remaining:.2f} m from ({goal[0]:.2f}, {goal[1]:.2f})")
