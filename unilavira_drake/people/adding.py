"""Wires people into a station."""

from __future__ import annotations

from collections.abc import Sequence

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import DiagramBuilder, System

from unilavira_drake.people.bodies import PersonBody
from unilavira_drake.people.config import PeopleConfig
from unilavira_drake.people.pedestrians import Pedestrians, PeopleWatch
from unilavira_drake.people.walking import Manners


def connect_people(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    bodies: Sequence[PersonBody],
    config: PeopleConfig,
    *,
    robot: BodyIndex,
    footprint: tuple[float, float],
) -> System:
    """Adds the Systems that walk people and watch them, after ``plant.Finalize()``.

    Args:
        builder: of the plant's diagram.
        plant: with the people's bodies.
        bodies: of the people, at least one.
        config: their manners.
        robot: the robot's body.
        footprint: length and width of the robot about that body, metres.

    Returns:
        The System whose output ``cheat_people`` is the truth about them.
    """
    manners = Manners(config.polite, config.stop_distance, config.patience)
    walking = builder.AddSystem(
        Pedestrians(bodies=bodies, robot=robot, footprint=footprint, manners=manners)
    )
    for one in bodies:
        name = one.person.name
        builder.Connect(
            plant.get_state_output_port(one.instance), walking.GetInputPort(f"{name}.joint_state")
        )
        builder.Connect(
            walking.GetOutputPort(f"{name}.desired_joint_state"),
            plant.get_desired_state_input_port(one.instance),
        )
    watch = builder.AddSystem(PeopleWatch(bodies=bodies, robot=robot, footprint=footprint))
    for system in (walking, watch):
        builder.Connect(plant.get_body_poses_output_port(), system.GetInputPort("body_poses"))
    builder.Connect(plant.get_contact_results_output_port(), watch.GetInputPort("contact_results"))
    return watch
