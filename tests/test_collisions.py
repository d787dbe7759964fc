"""Collisions that the episode monitor counts, on plants that run into a wall or stand."""

import pytest
from pydrake.common.value import AbstractValue
from pydrake.geometry import Box, HalfSpace, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CoulombFriction,
)
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake.episode_monitor import EpisodeMonitor
from unilavira_drake.messages import LanguageAction, NavigationStatus, Panorama
from unilavira_drake.scenario import Budgets

PERIOD = 0.1


def watch(build, *, flies=False, status=None, later=None):
    """Runs a plant that ``build`` fills for 1.5 s under a monitor; returns its metrics."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.01)
    prepare = build(plant)
    plant.Finalize()
    monitor = builder.AddSystem(EpisodeMonitor(period=PERIOD, budgets=Budgets(), flies=flies))
    contacts = plant.get_contact_results_output_port()
    builder.Connect(contacts, monitor.GetInputPort("contact_results"))
    diagram = builder.Build()
    simulator = Simulator(diagram)
    prepare(plant.GetMyMutableContextFromRoot(simulator.get_mutable_context()))
    own = monitor.GetMyMutableContextFromRoot(simulator.get_mutable_context())

    def fix(name, value):
        monitor.GetInputPort(name).FixValue(own, AbstractValue.Make(value))

    for name, value in (
        ("cheat_X_WB", RigidTransform()),
        ("language_action", LanguageAction()),
        ("panorama", Panorama()),
        ("navigation_status", status or NavigationStatus()),
    ):
        fix(name, value)
    if later is not None:
        simulator.AdvanceTo(0.3)
        later(simulator, fix)
    simulator.AdvanceTo(1.5)
    return monitor.GetOutputPort("metrics").Eval(own)


def sliding_block(gap):
    """A block on a rail, pushed towards a wall ``gap`` metres ahead."""

    def build(plant):
        friction = CoulombFriction(0.5, 0.5)
        wall = RigidTransform([0.5 + gap + 0.1, 0.0, 0.0])
        plant.RegisterCollisionGeometry(
            plant.world_body(), wall, Box(0.2, 4.0, 1.0), "wall", friction
        )
        block = plant.AddRigidBody("block", SpatialInertia.SolidBoxWithMass(10.0, 1.0, 1.0, 1.0))
        plant.RegisterCollisionGeometry(block, RigidTransform(), Box(1, 1, 1), "block", friction)
        joint = plant.AddJoint(
            PrismaticJoint("rail", plant.world_frame(), block.body_frame(), [1.0, 0.0, 0.0])
        )
        plant.AddJointActuator("push", joint)
        return lambda context: plant.get_actuation_input_port().FixValue(context, [50.0])

    return build


def ball_on_the_floor(plant):
    friction = CoulombFriction(0.5, 0.5)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform(), HalfSpace(), "floor", friction
    )
    ball = plant.AddRigidBody("ball", SpatialInertia.SolidSphereWithMass(10.0, 0.5))
    plant.RegisterCollisionGeometry(ball, RigidTransform(), Sphere(0.5), "ball", friction)
    return lambda context: plant.SetFreeBodyPose(context, ball, RigidTransform([0.0, 0.0, 0.5]))


def test_pushing_against_a_wall_is_one_collision():
    metrics = watch(sliding_block(0.2))
    assert metrics.collisions == 1
    assert metrics.max_contact_force > 40.0


def test_a_wall_that_is_not_reached_is_none():
    assert watch(sliding_block(9.0)).collisions == 0


def test_standing_on_the_floor_is_none():
    metrics = watch(ball_on_the_floor)
    assert metrics.collisions == 0
    assert metrics.max_contact_force == 0.0


@pytest.mark.parametrize(
    ("status", "collisions"),
    [
        (NavigationStatus(0, "moving"), 0),
        (NavigationStatus(0, "failed"), 0),
        (NavigationStatus(0, "arrived"), 1),
        (NavigationStatus(3, "moving"), 1),
    ],
)
def test_the_floor_carries_an_aircraft_only_until_it_has_taken_off(status, collisions):
    metrics = watch(ball_on_the_floor, flies=True, status=status)
    assert metrics.collisions == collisions
    assert (metrics.max_contact_force > 40.0) == bool(collisions)


def test_an_aircraft_that_stands_may_bump_into_a_wall_all_the_same():
    metrics = watch(sliding_block(0.2), flies=True, status=NavigationStatus(0, "moving"))
    assert metrics.collisions == 1


@pytest.mark.parametrize(("moved", "collisions"), [(0.0, 0), (0.5, 1)])
def test_an_aircraft_that_could_not_take_off_stands_until_it_moves(moved, collisions):
    def later(simulator, fix):
        fix("navigation_status", NavigationStatus(0, "failed"))
        simulator.AdvanceTo(0.5)
        fix("navigation_status", NavigationStatus(1, "arrived"))
        fix("cheat_X_WB", RigidTransform([0.0, 0.0, moved]))

    metrics = watch(
        ball_on_the_floor, flies=True, status=NavigationStatus(0, "moving"), later=later
    )
    assert metrics.collisions == collisions
