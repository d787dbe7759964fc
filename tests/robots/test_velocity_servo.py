"""The closed form of a base's servos does what Drake's own servos do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from unilavira_drake.robots.robot_model import add_robot_model
from unilavira_drake.robots.velocity_servo import VelocityServo, take_servos
from unilavira_drake.scenario import robot_kinds

TIME_STEP = 0.025
COBOT = Path(__file__).resolve().parents[2] / "models" / "robots" / "cobot_magic.sdf"


def cobot(
    builder: DiagramBuilder, old: str = "", new: str = ""
) -> tuple[MultibodyPlant, ModelInstanceIndex]:
    text = COBOT.read_text()
    assert old in text
    plant, _ = AddMultibodyPlantSceneGraph(builder, TIME_STEP)
    [instance] = Parser(plant).AddModelsFromString(text.replace(old, new) if old else text, "sdf")
    plant.Finalize()
    return plant, instance


def speeds(desired: list[float], *, closed_form: bool, steps: int) -> NDArray[np.float64]:
    """The joints' speeds after each step from rest."""
    builder = DiagramBuilder()
    plant, instance = cobot(builder)
    source = builder.AddSystem(ConstantVectorSource([0.0, 0.0, 0.0, *desired]))
    port = plant.get_desired_state_input_port(instance)
    if closed_form:
        gains = take_servos(plant, instance)
        assert gains is not None
        servo = builder.AddSystem(VelocityServo(gains))
        builder.Connect(plant.get_state_output_port(instance), servo.GetInputPort("joint_state"))
        builder.Connect(servo.GetOutputPort("actuation"), plant.get_actuation_input_port(instance))
        port = servo.GetInputPort("desired_joint_state")
    builder.Connect(source.get_output_port(), port)
    simulator = Simulator(builder.Build())
    context = plant.GetMyContextFromRoot(simulator.get_context())
    simulator.Initialize()
    rows = []
    for step in range(steps):
        simulator.AdvanceTo((step + 0.5) * TIME_STEP)
        rows.append(np.array(plant.GetVelocities(context)))
    return np.array(rows)


@pytest.mark.parametrize(
    "desired",
    [[0.05, -0.02, 0.1], [0.8, 0.0, 0.0], [0.8, -0.8, 1.0]],
    ids=["within the effort", "one saturates", "two saturate"],
)
def test_a_free_base_moves_as_with_drakes_servos(desired: list[float]) -> None:
    drake = speeds(desired, closed_form=False, steps=30)
    assert speeds(desired, closed_form=True, steps=30) == pytest.approx(drake, abs=1e-5)
    assert drake[-1] == pytest.approx(desired, abs=1e-6)


def test_no_force_is_larger_than_the_effort() -> None:
    builder = DiagramBuilder()
    gains = take_servos(*cobot(builder))
    assert gains is not None
    servo = VelocityServo(gains)
    context = servo.CreateDefaultContext()
    state: Any = np.zeros(6)
    servo.GetInputPort("joint_state").FixValue(context, state)
    desired: Any = np.array([0.0, 0.0, 0.0, 9.0, -9.0, 0.01])
    servo.GetInputPort("desired_joint_state").FixValue(context, desired)
    force = servo.GetOutputPort("actuation").Eval(context)
    assert force[:2].tolist() == [300.0, -300.0]
    # d / (1 + dt d / m) with the yaw's d = 2000 and m = 8.
    assert force[2] == pytest.approx(2000.0 / (1.0 + TIME_STEP * 2000.0 / 8.0) * 0.01)


def has_servos(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[bool]:
    actuators = plant.GetJointActuatorIndices(instance)
    return [plant.get_joint_actuator(index).has_controller() for index in actuators]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<pose>0 0 0.35 0 0 0</pose>", "<pose>0.1 0 0.35 0 0 0</pose>"),
        ('p="0" d="20000"', 'p="5" d="20000"'),
        ("<xyz>0 1 0</xyz>", "<xyz>0 0.6 0.8</xyz>"),
        ('<drake:controller_gains p="0" d="2000"/>', ""),
        ("<limit><effort>100", "<dynamics><damping>5</damping></dynamics><limit><effort>100"),
    ],
    ids=[
        "the mass turns about another axis",
        "held in place",
        "carries weight",
        "no servo",
        "damped",
    ],
)
def test_servos_that_no_closed_form_stands_for_stay_drakes(old: str, new: str) -> None:
    plant, instance = cobot(DiagramBuilder(), old, new)
    had = has_servos(plant, instance)
    assert take_servos(plant, instance) is None
    assert has_servos(plant, instance) == had
    assert any(had)


@pytest.mark.parametrize("name", ["unitree_go1", "unitree_g1"])
def test_legs_keep_drakes_servos(name: str) -> None:
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), TIME_STEP)
    instance = add_robot_model(plant, robot_kinds()[name]())
    plant.Finalize()
    assert take_servos(plant, instance) is None


ARM = """
<sdf version="1.9" xmlns:drake="drake.mit.edu"><model name="arm">
  <link name="hub"/><link name="slider"><inertial><mass>20</mass></inertial></link>
  <joint name="yaw" type="continuous"><parent>world</parent><child>hub</child>
    <axis><xyz>0 0 1</xyz><limit><effort>100</effort></limit></axis>
    <drake:controller_gains p="0" d="2000"/></joint>
  <joint name="reach" type="prismatic"><parent>hub</parent><child>slider</child>
    <axis><xyz>1 0 0</xyz><limit><effort>100</effort></limit></axis>
    <drake:controller_gains p="0" d="2000"/></joint>
</model></sdf>
"""


def test_an_inertia_that_changes_with_the_joints_is_seen() -> None:
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), TIME_STEP)
    [instance] = Parser(plant).AddModelsFromString(ARM, "sdf")
    plant.Finalize()
    assert take_servos(plant, instance) is None


def test_what_another_model_hangs_on_a_base_is_seen() -> None:
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), TIME_STEP)
    [instance] = Parser(plant).AddModelsFromString(COBOT.read_text(), "sdf")
    mass = SpatialInertia.SolidBoxWithMass(5.0, 0.2, 0.2, 0.2)
    body = plant.AddRigidBody("load", plant.AddModelInstance("load"), mass)
    axis: Any = np.array([1.0, 0.0, 0.0])
    base = plant.GetBodyByName("base", instance)
    plant.AddJoint(PrismaticJoint("slide", base.body_frame(), body.body_frame(), axis))
    plant.Finalize()
    assert take_servos(plant, instance) is None


def test_a_model_beside_the_base_does_not_matter() -> None:
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), TIME_STEP)
    parser = Parser(plant)
    [instance] = parser.AddModelsFromString(COBOT.read_text(), "sdf")
    parser.AddModelsFromString(ARM, "sdf")
    plant.Finalize()
    assert take_servos(plant, instance) is not None


def test_a_plant_with_constraints_keeps_drakes_servos() -> None:
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), TIME_STEP)
    [instance] = Parser(plant).AddModelsFromString(COBOT.read_text(), "sdf")
    joints = [plant.GetJointByName(name, instance) for name in ("base_x", "base_y")]
    plant.AddCouplerConstraint(*joints, 2.0)
    plant.Finalize()
    assert take_servos(plant, instance) is None


def test_servos_are_taken_once() -> None:
    plant, instance = cobot(DiagramBuilder())
    assert take_servos(plant, instance) is not None
    assert take_servos(plant, instance) is None
