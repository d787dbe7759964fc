"""The ground under a robot that climbs: its height follows floors and stairs without contact."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from unilavira_drake.errors import ScenarioError
from unilavira_drake.ports import vector_input
from unilavira_drake.robots.planar_base import BASE_JOINTS, HEIGHT_JOINT

GroundHeight = Callable[[float, float, float], float]
"""(x, y, z) -> height of the ground there nearest to z, metres in the world."""

STIFFNESS, DAMPING, EFFORT = 400.0, 40.0, 1000.0
"""Gains and limit of the height joint for each kilogram that it carries, N/m, N s/m and N: it is a
tenth of a second behind the ground."""
GRAVITY = 9.81
"""m/s^2; the joint carries the weight.  A body at rest without any defeats the contact solver: it
has no force by which to judge what is small."""


class TerrainFollower(LeafSystem):
    """Stands between a locomotion on level ground and a body with a height joint.

    Kinematic terrain following: the height joint is servoed to the ground under the base, and no
    foot touches a step.  The locomotion sees and moves the other joints as if there was none.

    .. pydrake_system::

        name: TerrainFollower
        input_ports:
        - joint_state
        - desired_level_joint_state
        output_ports:
        - level_joint_state
        - desired_joint_state

    All are [q; v]: the states of the model's joints, the desired ones of its actuators, in the
    plant's order, the level ones without ``base_height``.

    Args:
        joints: names of the model's joints in the order of the state; one coordinate each.
        actuated: names of the actuated joints in the order of the actuators.
        ground_height: of the world.
    """

    def __init__(
        self, *, joints: Sequence[str], actuated: Sequence[str], ground_height: GroundHeight
    ) -> None:
        super().__init__()
        self.set_name("terrain_follower")
        self._ground_height = ground_height
        names, count = list(joints), len(joints)
        self._place = [names.index(name) for name in (*BASE_JOINTS[:2], HEIGHT_JOINT)]
        level = [i for i, name in enumerate(names) if name != HEIGHT_JOINT]
        self._level = np.array([*level, *(count + i for i in level)])
        self._slot = list(actuated).index(HEIGHT_JOINT)
        self._joint_state = vector_input(self, "joint_state", 2 * count)
        size = 2 * len(actuated)
        self._desired = vector_input(self, "desired_level_joint_state", size - 2)
        state = {self.input_port_ticket(self.GetInputPort("joint_state").get_index())}
        self.DeclareVectorOutputPort(
            "level_joint_state",
            BasicVector(len(self._level)),
            self._calc_level,
            prerequisites_of_calc=state,
        )
        self.DeclareVectorOutputPort("desired_joint_state", BasicVector(size), self._calc_desired)

    def _calc_level(self, context: Context, output: Any) -> None:
        output.SetFromVector(self._joint_state(context)[self._level])

    def _calc_desired(self, context: Context, output: Any) -> None:
        state: Any = self._joint_state(context)
        x, y, z = (float(state[index]) for index in self._place)
        height = self._ground_height(x, y, z) if math.isfinite(x + y + z) else z
        # The servo sinks under the weight by this much.
        height += GRAVITY / STIFFNESS
        desired: Any = self._desired(context)
        half = len(desired) // 2
        positions = np.insert(desired[:half], self._slot, height)
        output.SetFromVector([*positions, *np.insert(desired[half:], self._slot, 0.0)])


def climbing_model(path: Path) -> str:
    """Returns the SDF of a ground robot with a height joint between its planar base and its body.

    Args:
        path: of an SDF whose joint ``base_yaw`` carries the link ``base``.  URIs that are relative
            to its folder are absolute in what is returned.

    Raises:
        ScenarioError: if it is no SDF or has no such joint.
    """
    try:
        root = ElementTree.fromstring(path.read_text(encoding="utf-8"))
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise ScenarioError(f"robot.model: {str(path)!r} is no SDF: {error}.") from None
    model = root.find("model")
    yaw = None if model is None else model.find("joint[@name='base_yaw']")
    child = None if yaw is None else yaw.find("child")
    if model is None or child is None:
        raise ScenarioError(
            f"robot.model: {str(path)!r} has no joint base_yaw in the model of an SDF; a robot "
            "with can_climb: true needs one. Convert it to SDF, or give robot.can_climb: false."
        )
    for uri in root.iter("uri"):
        if uri.text and "://" not in uri.text:
            uri.text = f"file://{path.resolve().parent / uri.text.strip()}"
    body, child.text = child.text, "lift"
    ElementTree.register_namespace("drake", "drake.mit.edu")
    mass = sum(float(one.text or 0.0) for one in model.iterfind("link/inertial/mass"))
    for part in _lift(str(body), mass):
        model.append(part)
    return ElementTree.tostring(root, encoding="unicode")


def _lift(body: str, mass: float) -> tuple[ElementTree.Element, ...]:
    zeros = "".join(f"<{name}>0</{name}>" for name in ("ixy", "ixz", "iyz"))
    own = "".join(f"<{name}>0.01</{name}>" for name in ("ixx", "iyy", "izz"))
    link = (
        f'<link name="lift"><inertial><mass>0.01</mass><inertia>{own}{zeros}</inertia>'
        "</inertial></link>"
    )
    joint = (
        f'<joint name="{HEIGHT_JOINT}" type="prismatic" xmlns:drake="drake.mit.edu">'
        f"<parent>lift</parent><child>{body}</child>"
        f"<axis><xyz>0 0 1</xyz><limit><effort>{EFFORT * mass:g}</effort></limit></axis>"
        f'<drake:controller_gains p="{STIFFNESS * mass:g}" d="{DAMPING * mass:g}"/></joint>'
    )
    return ElementTree.fromstring(link), ElementTree.fromstring(joint)


def set_start_height(
    plant: MultibodyPlant, model_instance: ModelInstanceIndex, height: float
) -> None:
    """Sets the height at which a robot starts, metres; one without a height joint starts at 0."""
    if plant.HasJointNamed(HEIGHT_JOINT, model_instance):
        position: Any = np.array([height])
        plant.GetJointByName(HEIGHT_JOINT, model_instance).set_default_positions(position)


def follow_terrain(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    model_instance: ModelInstanceIndex,
    ground: tuple[GeometryId, ...],
) -> None:
    """Lets a climbing robot pass through the geometry of the ground: no step stops it.

    Args:
        plant: not yet finalized.
        scene_graph: of the plant.
        model_instance: of the robot.
        ground: geometry of steps and floors, see ``add_scenery``.
    """
    own = GeometrySet()
    for body in plant.GetBodyIndices(model_instance):
        own.Add(plant.GetBodyFrameIdOrThrow(body))
    if ground:
        scene_graph.collision_filter_manager().Apply(
            CollisionFilterDeclaration().ExcludeBetween(own, GeometrySet(list(ground)))
        )
