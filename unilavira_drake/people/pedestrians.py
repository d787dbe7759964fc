"""The people's walking as a System, and the truth about them."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactResults
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, EventStatus, LeafSystem, State

from unilavira_drake.messages import Message
from unilavira_drake.messages.people import PeopleTruth, PersonTruth
from unilavira_drake.people.bodies import COLUMNS, JOINTS, THICKNESS, PersonBody
from unilavira_drake.people.walking import Manners, RobotSeen, Walker, Wish, next_step, swing
from unilavira_drake.ports import InputReader, vector_input

CONTACT_FORCE = 1.0
"""A weaker contact is none, newtons."""


class Pedestrians(LeafSystem):
    """Walks people along their ways: measured joints in, wished joint velocities out.

    People turn to where they go, swing legs and arms, rest at the ends of their walk and walk
    back.  Polite ones stop while the robot is near ahead of them; who could not go on for longer
    than the patience turns back.

    .. pydrake_system::

        name: Pedestrians
        input_ports:
        - body_poses
        - NAME.joint_state (for each person)
        output_ports:
        - NAME.desired_joint_state (for each person)

    ``joint_state`` and ``desired_joint_state`` are the positions and velocities of x, y, yaw, left
    leg, right leg, left arm, right arm (metres, radians); the plant servoes velocities of the
    first three and positions of the others.

    Args:
        bodies: of the people in the plant.
        robot: the robot's body.
        footprint: length and width of the robot about that body, metres.
        manners: how they treat the robot.
        period: seconds.
    """

    def __init__(
        self,
        *,
        bodies: Sequence[PersonBody],
        robot: BodyIndex,
        footprint: tuple[float, float],
        manners: Manners,
        period: float = 0.05,
    ) -> None:
        super().__init__()
        self.set_name("pedestrians")
        self._people = tuple(one.person for one in bodies)
        self._robot = robot
        self._footprint = footprint
        self._manners = manners
        self._period = period
        self._poses = self.DeclareAbstractInputPort("body_poses", Value[list[RigidTransform]]())
        self._joints = tuple(
            vector_input(self, f"{person.name}.joint_state", 2 * JOINTS) for person in self._people
        )
        walkers = (RobotSeen(), *(Walker() for _ in bodies))
        self._walkers = self.DeclareAbstractState(AbstractValue.Make(walkers))
        self._wishes = []
        for person in self._people:
            index = self.DeclareDiscreteState(2 * JOINTS)
            self._wishes.append(int(index))
            self.DeclareStateOutputPort(f"{person.name}.desired_joint_state", index)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: State) -> EventStatus:
        index = int(self._walkers)
        kept: Any = context.get_abstract_state(index)
        seen, *walkers = kept.get_value()
        poses: Any = self._poses.Eval(context)
        robot = _seen(poses[int(self._robot)], self._footprint)
        if context.get_time() > 0.0:
            vx, vy = (robot.x - seen.x) / self._period, (robot.y - seen.y) / self._period
            robot = dataclasses.replace(robot, vx=vx, vy=vy)
        stepped: list[Message] = [robot]
        for k, person in enumerate(self._people):
            joints = self._joints[k](context).tolist()
            x, y, yaw = joints[:3]
            walker, wish = next_step(
                person,
                walkers[k],
                self._manners,
                time=context.get_time(),
                period=self._period,
                pose=(x, y, yaw),
                moving=math.hypot(joints[JOINTS], joints[JOINTS + 1]),
                robot=robot,
            )
            stepped.append(walker)
            desired: Any = state.get_mutable_discrete_state(self._wishes[k])
            desired.SetFromVector(_desired(walker, wish))
        state.get_mutable_abstract_state(index).set_value(tuple(stepped))
        return EventStatus.Succeeded()


def _desired(walker: Walker, wish: Wish) -> list[float]:
    leg = swing(walker)
    positions = [0.0, 0.0, 0.0, leg, -leg, -leg / 2.0, leg / 2.0]
    return [*positions, wish.vx, wish.vy, wish.yaw_rate, 0.0, 0.0, 0.0, 0.0]


class PeopleWatch(LeafSystem):
    """Tells the truth about people: where they are, how near, and whom the robot touches.

    .. pydrake_system::

        name: PeopleWatch
        input_ports:
        - body_poses
        - contact_results
        output_ports:
        - cheat_people

    Args:
        bodies: of the people in the plant.
        robot: the robot's body.
        footprint: length and width of the robot about that body, metres.
    """

    def __init__(
        self, *, bodies: Sequence[PersonBody], robot: BodyIndex, footprint: tuple[float, float]
    ) -> None:
        super().__init__()
        self.set_name("people_watch")
        self._bodies = tuple(bodies)
        self._robot = robot
        self._footprint = footprint
        self._poses = self.DeclareAbstractInputPort("body_poses", Value[list[RigidTransform]]())
        self._contacts = InputReader(
            self, "contact_results", ContactResults, AbstractValue.Make(ContactResults())
        )
        self.DeclareAbstractOutputPort(
            "cheat_people", functools.partial(AbstractValue.Make, PeopleTruth()), self._calc
        )

    def _calc(self, context: Any, output: Any) -> None:
        poses: Any = self._poses.Eval(context)
        touched = _touched(self._contacts(context))
        robot = _seen(poses[int(self._robot)], self._footprint)
        people = []
        for one in self._bodies:
            X_WP = poses[int(one.body)].GetAsMatrix34()
            x, y = float(X_WP[0, 3]), float(X_WP[1, 3])
            c, s = float(X_WP[0, 0]), float(X_WP[1, 0])
            gaps = (math.hypot(*robot.nearest(x - s * side, y + c * side)) for side in COLUMNS)
            people.append(
                PersonTruth(
                    name=one.person.name,
                    position=(x, y),
                    yaw=math.atan2(s, c),
                    gap=max(min(gaps) - THICKNESS, 0.0) if robot.within_reach else math.inf,
                    touched=int(one.body) in touched,
                )
            )
        output.set_value(PeopleTruth(tuple(people)))


def _seen(X_WB: RigidTransform, footprint: tuple[float, float]) -> RobotSeen:
    X = X_WB.GetAsMatrix34()
    yaw = math.atan2(X[1, 0], X[0, 0])
    x, y, z = (float(value) for value in X[:, 3])
    return RobotSeen(x, y, yaw, footprint[0] / 2.0, footprint[1] / 2.0, z=z)


def _touched(contacts: ContactResults) -> set[int]:
    """Returns the bodies that press on others; people's contacts are with robots alone."""
    found = set()
    for index in range(contacts.num_point_pair_contacts()):
        info = contacts.point_pair_contact_info(index)
        if float(np.linalg.norm(info.contact_force())) > CONTACT_FORCE:
            found |= {int(info.bodyA_index()), int(info.bodyB_index())}
    return found
