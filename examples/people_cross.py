"""A person steps into the robot's way: it stops for them, goes on, and nobody is touched."""

import matplotlib.pyplot as plt
import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource

from unilavira_drake import load_scenario
from unilavira_drake.messages import Goal, Panorama, Sweep
from unilavira_drake.navigation import make_navigation
from unilavira_drake.people.adding import mapping_among, planning_among
from unilavira_drake.people.crowd import detected_labels, with_people
from unilavira_drake.sensors.rig import front_intrinsics
from unilavira_drake.station import make_navigation_station
from unilavira_drake.worlds.load import load_world

ROUTE = '{waypoints: ["7.6,4.2", "7.6,5.7"], speed: 0.6, pause: 4.0, delay: 1.0}'
PEOPLE = f"people: {{count: 1, polite: false, routes: [{ROUTE}]}}"

if __name__ == "__main__":
    scenario, builder = load_scenario("apartment", PEOPLE), DiagramBuilder()
    people = scenario.people
    world = with_people(load_world("apartment"), people)
    station = builder.AddSystem(make_navigation_station(scenario, start=(3.0, 5.7, 0.0)))
    navigation = builder.AddSystem(
        make_navigation(
            robot=scenario.robot,
            intrinsics=front_intrinsics(scenario.robot),
            mapping=mapping_among(people, scenario.mapping),
            planning=planning_among(people, scenario.planning),
            flight=scenario.flight,
            tick=scenario.tick,
            time_step=scenario.plant.time_step,
            moving_labels=detected_labels(world, people),
        )
    )
    for port in ("front.depth_image", "front.label_image", "front.X_BC", "pose_estimate", "twist"):
        builder.Connect(station.GetOutputPort(port), navigation.GetInputPort(port))
    builder.Connect(navigation.get_output_port(0), station.GetInputPort("base_command"))
    goal = Goal(n=1, kind="go", p_WG=(11.0, 5.7, 0.0))
    for port, value in (("goal", goal), ("panorama", Panorama(n=1, first=1)), ("sweep", Sweep())):
        source = builder.AddSystem(ConstantValueSource(AbstractValue.Make(value)))
        builder.Connect(source.get_output_port(), navigation.GetInputPort(port))
    simulator = Simulator(builder.Build())
    there = station.GetMyContextFromRoot(simulator.get_context())
    rows = []
    for time in np.arange(0.1, 22.0, 0.1):
        simulator.AdvanceTo(time)
        people, twist = (station.GetOutputPort(p).Eval(there) for p in ("cheat_people", "twist"))
        rows.append((time, twist[3], people.gap, people.touched))
    time, speed, gap, touched = np.transpose(rows)
    figure, axes = plt.subplots(2, sharex=True, layout="constrained")
    axes[0].plot(time, speed), axes[0].set(ylabel="speed, m/s")
    axes[1].plot(time, gap), axes[1].set(xlabel="s", ylabel="to the person, m")
    figure.savefig("people_cross.png")
    stood = 0.1 * np.sum((np.abs(speed) < 0.05) & (gap < 1.0))
    print(f"stood {stood:.1f} s, drove {0.1 * speed.sum():.1f} m; see people_cross.png")
    print(f"nearest {gap.min():.2f} m, touched: {any(touched)}")
