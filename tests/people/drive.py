"""A drive without an agent: station and navigation in one Diagram, and one goal."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

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


@dataclass
class Log:
    """What a drive came to."""

    times: list[float] = field(default_factory=list)
    positions: list[tuple[float, float]] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    gaps: list[float] = field(default_factory=list)
    people: list[tuple[Any, ...]] = field(default_factory=list)
    touched: bool = False
    state: str = "moving"


class Drive:
    """Drives the robot from a start to a goal among people."""

    def __init__(self, start, goal, people, name="apartment", **overlay):
        overlay = {"people": people, **overlay}
        scenario = load_scenario(name, json.dumps(overlay))
        world = with_people(load_world(scenario.world.name), scenario.people)
        labels = detected_labels(world, scenario.people)
        builder = DiagramBuilder()
        self.station = builder.AddSystem(make_navigation_station(scenario, start=start))
        self.navigation = builder.AddSystem(
            make_navigation(
                robot=scenario.robot,
                intrinsics=front_intrinsics(scenario.robot),
                mapping=mapping_among(scenario.people, scenario.mapping),
                planning=planning_among(scenario.people, scenario.planning),
                flight=scenario.flight,
                tick=scenario.tick,
                time_step=scenario.plant.time_step,
                moving_labels=labels,
            )
        )
        ports = ("front.label_image",) if labels else ()
        for port in (*ports, "front.depth_image", "front.X_BC", "pose_estimate", "twist"):
            builder.Connect(self.station.GetOutputPort(port), self.navigation.GetInputPort(port))
        builder.Connect(
            self.navigation.GetOutputPort("base_command"),
            self.station.GetInputPort("base_command"),
        )
        for port, value in (
            ("goal", Goal(n=1, kind="go", p_WG=(*goal, 0.0))),
            ("panorama", Panorama(n=1, first=1)),
            ("sweep", Sweep()),
        ):
            source = builder.AddSystem(ConstantValueSource(AbstractValue.Make(value)))
            builder.Connect(source.get_output_port(), self.navigation.GetInputPort(port))
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()

    def read(self, system, port):
        return system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(self.context))

    def run(self, seconds, until_arrived=True):
        log = Log()
        while self.context.get_time() < seconds:
            self.simulator.AdvanceTo(self.context.get_time() + 0.1)
            x, y, _ = self.read(self.station, "cheat_X_WB").translation().tolist()
            people = self.read(self.station, "cheat_people")
            log.times.append(self.context.get_time())
            log.positions.append((x, y))
            log.speeds.append(float(self.read(self.station, "twist")[3]))
            log.gaps.append(people.gap)
            log.people.append(tuple(person.position for person in people.people))
            log.touched |= people.touched
            status = self.read(self.navigation, "navigation_status")
            log.state = status.state
            if status.n == 1 and status.terminal and until_arrived:
                log.state = f"{status.state} {status.reason}".strip()
                break
        return log
