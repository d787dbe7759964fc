"""People as bodies of the plant: they push and are pushed, and both renderers see them.

Each is a model instance of seven moving joints: x, y and yaw of the body, whose velocities are
servoed with the effort of a person, and two legs and two arms.  Measured in ``apartment``: 0.8 ms
of CPU a simulated second for each, with the limbs; geometry that a System moves outside of the
plant would need contacts of its own.  They touch robots alone: walls and things are what their
walks keep clear of, and each other they pass like ghosts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    Cylinder,
    GeometryId,
    GeometryInstance,
    GeometrySet,
    IllustrationProperties,
    PerceptionProperties,
    RenderLabel,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    FixedOffsetFrame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
)

from unilavira_drake.people.crowd import Person
from unilavira_drake.people.figure import HIP, SHOULDER, USUAL_HEIGHT, figure

MASS = 70.0
"""Kilograms."""
PUSH = 150.0
"""How hard a person pushes at most, newtons."""
COLUMNS = (-0.12, 0.0, 0.12)
"""A body collides as upright cylinders side by side, from arm to arm; metres to the left."""
THICKNESS = 0.13
"""Their radius, metres."""
JOINTS = 7
"""x, y, yaw, left leg, right leg, left arm, right arm."""

_LIMBS = (
    ("left_leg", HIP, 0.09),
    ("right_leg", HIP, -0.09),
    ("left_arm", SHOULDER, 0.205),
    ("right_arm", SHOULDER, -0.205),
)

_ALONG_X: Any = [1.0, 0.0, 0.0]
_ALONG_Y: Any = [0.0, 1.0, 0.0]
_ABOUT_Z: Any = [0.0, 0.0, 1.0]
_SWING: Any = [0.0, -1.0, 0.0]
"""A limb hangs down, and its angle is positive when it points forward."""


@dataclass(frozen=True)
class PersonBody:
    """Where a person is in the plant."""

    person: Person
    instance: ModelInstanceIndex
    body: BodyIndex


def add_people(plant: MultibodyPlant, scene_graph: SceneGraph, people: Sequence[Person]) -> None:
    """Adds people to a plant, after its scenery and before ``plant.Finalize()``."""
    if not people:
        return
    ids = [id_ for person in people for id_ in _add(plant, person)]
    world = plant.GetCollisionGeometriesForBody(plant.world_body())
    rule = CollisionFilterDeclaration()
    rule.ExcludeWithin(GeometrySet(ids))
    rule.ExcludeBetween(GeometrySet(ids), GeometrySet(world))
    scene_graph.collision_filter_manager().Apply(rule)


def find_people(plant: MultibodyPlant, people: Sequence[Person]) -> tuple[PersonBody, ...]:
    """Returns where people are in a finalized plant, who by default begin where their walks do."""
    bodies = []
    for person in people:
        instance = plant.GetModelInstanceByName(person.name)
        body = plant.GetBodyByName(person.name, instance)
        bodies.append(PersonBody(person, instance, body.index()))
        (x, y), (to_x, to_y) = person.walk[:2]
        q: Any = np.zeros(JOINTS)
        q[:3] = x, y, np.arctan2(to_y - y, to_x - x)
        plant.SetDefaultPositions(instance, q)
    return tuple(bodies)


def _add(plant: MultibodyPlant, person: Person) -> list[GeometryId]:
    """Adds one person and returns the collision geometries."""
    instance = plant.AddModelInstance(person.name)
    scale = person.height / USUAL_HEIGHT
    light = SpatialInertia.SolidBoxWithMass(0.01, 0.1, 0.1, 0.1)
    carriage_x = plant.AddRigidBody("carriage_x", instance, light)
    carriage_y = plant.AddRigidBody("carriage_y", instance, light)
    body = plant.AddRigidBody(
        person.name, instance, SpatialInertia.SolidBoxWithMass(MASS, 0.3, 0.4, person.height)
    )
    world, x, y = plant.world_frame(), carriage_x.body_frame(), carriage_y.body_frame()
    _actuate(plant, PrismaticJoint("x", world, x, _ALONG_X), PUSH, damping=20000.0)
    _actuate(plant, PrismaticJoint("y", x, y, _ALONG_Y), PUSH, damping=20000.0)
    _actuate(plant, RevoluteJoint("yaw", y, body.body_frame(), _ABOUT_Z), 50.0, damping=1000.0)
    carriers = {"body": body}
    for name, height, side in _LIMBS:
        limb = plant.AddRigidBody(name, instance, SpatialInertia.SolidBoxWithMass(1, 0.1, 0.1, 0.8))
        p_BJ: Any = [0.0, side * scale, height * scale]
        mount = plant.AddFrame(
            FixedOffsetFrame(f"{name}_joint", body.body_frame(), RigidTransform(p_BJ))
        )
        joint = RevoluteJoint(name, mount, limb.body_frame(), _SWING)
        _actuate(plant, joint, 50.0, stiffness=200.0, damping=20.0)
        carriers[name] = limb
    _dress(plant, person, carriers, scale)
    length = 0.9 * person.height
    for k, side in enumerate(COLUMNS):
        p_BG: Any = [0.0, side, length / 2]
        plant.RegisterCollisionGeometry(
            body,
            RigidTransform(p_BG),
            Cylinder(THICKNESS, length),
            f"{person.name}_collision_{k}",
            CoulombFriction(0.4, 0.4),
        )
    return list(plant.GetCollisionGeometriesForBody(body))


def _actuate(
    plant: MultibodyPlant, joint: Any, effort: float, *, damping: float, stiffness: float = 0.0
) -> None:
    added = plant.AddJoint(joint)
    actuator = plant.AddJointActuator(added.name(), added, effort)
    actuator.set_controller_gains(PdControllerGains(p=stiffness, d=damping))


def _dress(
    plant: MultibodyPlant, person: Person, carriers: dict[str, RigidBody], scale: float
) -> None:
    for part in figure(person):
        color = Rgba(*part.color, 1.0)
        perception, illustration = PerceptionProperties(), IllustrationProperties()
        for properties in (perception, illustration):
            properties.AddProperty("phong", "diffuse", color)
        perception.AddProperty("label", "id", RenderLabel(person.label))
        name = f"{person.name}_{part.limb}_{part.name}"
        instance = GeometryInstance(RigidTransform(), part.mesh(scale), name)
        instance.set_perception_properties(perception)
        instance.set_illustration_properties(illustration)
        plant.RegisterVisualGeometry(carriers[part.limb], instance)
