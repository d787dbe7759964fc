"""Wires people into a station."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake.mapping.config import MappingConfig
from unilavira_drake.people.bodies import find_people
from unilavira_drake.people.config import PeopleConfig
from unilavira_drake.people.crowd import Person
from unilavira_drake.people.pedestrians import Pedestrians, PeopleWatch
from unilavira_drake.people.walking import Manners
from unilavira_drake.planning.config import PlanningConfig

AMONG_PEOPLE = {"travel": 0.08, "rest_period": 0.3}
"""Metres and seconds between two looks at most: a person walks a robot's width in half a second."""


WAIT = 15.0
"""Seconds for which the planner waits where people stand in the way."""


STALE = 2.0
"""After a failure the robot looks around again where its last look is older, seconds."""


def oldest_panorama(people: PeopleConfig) -> float:
    """Returns the observer's ``max_age`` for a world with these people, seconds."""
    return STALE if people.count else math.inf


def mapping_among(people: PeopleConfig, mapping: MappingConfig) -> MappingConfig:
    """Returns the mapper's numbers for a world with these people: it looks more often, and believes
    at once what appears on free floor and what is gone from it.
    """
    if people.count == 0:
        return mapping
    often = {name: min(getattr(mapping, name), most) for name, most in AMONG_PEOPLE.items()}
    return dataclasses.replace(mapping, moving=True, **often)


def planning_among(people: PeopleConfig, planning: PlanningConfig) -> PlanningConfig:
    """Returns the planner's numbers for a world with these people: it waits till they are gone."""
    if people.count == 0:
        return planning
    return dataclasses.replace(
        planning,
        patience=max(planning.patience, WAIT),
        stuck_time=max(planning.stuck_time, WAIT),
    )


def connect_people(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    people: Sequence[Person],
    config: PeopleConfig,
    robot: RigidBody,
    footprint: tuple[float, float],
) -> None:
    """Adds the Systems that walk people and watch them, after ``plant.Finalize()``.

    It exports the truth about them as ``cheat_people``.

    Args:
        builder: of the plant's diagram.
        plant: with the people's bodies (``add_people``).
        people: at least one.
        config: their manners.
        robot: the robot's body.
        footprint: length and width of the robot about that body, metres.
    """
    bodies = find_people(plant, people)
    manners = Manners(config.polite, config.stop_distance, config.patience)
    walking = builder.AddSystem(
        Pedestrians(bodies=bodies, robot=robot.index(), footprint=footprint, manners=manners)
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
    watch = builder.AddSystem(PeopleWatch(bodies=bodies, robot=robot.index(), footprint=footprint))
    for system in (walking, watch):
        builder.Connect(plant.get_body_poses_output_port(), system.GetInputPort("body_poses"))
    builder.Connect(plant.get_contact_results_output_port(), watch.GetInputPort("contact_results"))
    builder.ExportOutput(watch.GetOutputPort("cheat_people"), "cheat_people")
