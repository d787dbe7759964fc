"""A quadrotor over a floor, without cameras and worlds: what the flight tests fly."""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake.resources import package_xml
from unilavira_drake.robots.actuation import add_actuation
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.quadrotor_actuation import (
    add_landing_ground,
    set_flight_start,
)
from unilavira_drake.robots.wind import STILL_AIR

TIME_STEP = Quadrotor().max_time_step


def add_flying_body(builder, robot, wind, start=(0.0, 0.0, 0.0)):
    """Adds the plant with its actuation; its ports are exported."""
    config = MultibodyPlantConfig(time_step=TIME_STEP, discrete_contact_approximation="lagged")
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(package_xml())
    (model,) = parser.AddModelsFromUrl("package://unilavira_drake/robots/quadrotor.sdf")
    add_landing_ground(plant)
    plant.Finalize()
    set_flight_start(plant, model, robot, start)
    add_actuation(builder, plant, model, robot, wind=wind)


class Flight:
    """Simulates the flying body under commands that a test gives."""

    def __init__(self, *, robot=None, wind=STILL_AIR):
        builder = DiagramBuilder()
        add_flying_body(builder, robot or Quadrotor(), wind)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.command([np.nan] * 7)

    def command(self, setpoint):
        self.diagram.GetInputPort("base_command").FixValue(self.context, np.array(setpoint, float))

    def fly(self, duration, sample=0.02):
        """Returns the states every ``sample`` seconds: (k, 7) position, velocity and tilt."""
        start, rows = self.context.get_time(), []
        for k in range(1, round(duration / sample) + 1):
            self.simulator.AdvanceTo(start + k * sample)
            rows.append(self.state())
        return np.array(rows)

    def state(self):
        pose, twist = (
            self.diagram.GetOutputPort(name).Eval(self.context) for name in ("cheat_X_WB", "twist")
        )
        R = pose.rotation().matrix()
        tilt = np.arccos(np.clip(R[2, 2], -1.0, 1.0))
        return np.concatenate((pose.translation(), R @ twist[3:], [tilt]))

    @property
    def yaw(self):
        pose = self.diagram.GetOutputPort("cheat_X_WB").Eval(self.context)
        return pose.rotation().ToRollPitchYaw().yaw_angle()


def hovering(height=2.0, **options):
    """Returns a flight that hovers at rest."""
    flight = Flight(**options)
    flight.command([0, 0, height, 0, 0, 0, 0])
    flight.fly(8.0)
    return flight
