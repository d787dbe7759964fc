"""What the agent is asked: the task itself, without its goal, and what its family says of it.

Families are data: whatever differs between them stands in ``FAMILY_TABLE`` and in the words of
``prompts/tasks/``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from unilavira_drake.errors import TaskError, unknown_name
from unilavira_drake.messages import Message

MAX_TASK_WORDS = 2000
HOME = "home"
"""The protocol of the worlds that come with the package."""


@dataclass(frozen=True)
class SuccessRule(Message):
    """What makes a stop a success; a stop that the agent has not verified never is one."""

    protocol: str = HOME
    """``home``: ours.  ``habitat``: R2R and RxR, HM3D ObjectNav.  ``ovon``: HM3D-OVON.
    ``uni_lavira``: the released code of the paper.  Where these measure to view points, the goal
    gives them as ``X,Y|X,Y|...``; of a thing without any it is the free floor beside it."""
    radius: float = 1.5
    """Metres of geodesic between the robot and the free floor at the goal, or straight ones."""
    strict: bool = False
    """Whether the distance must be below the radius, not at most the radius."""
    in_room: bool = True
    """Whether the robot must be in the goal's room."""
    seen: bool = True
    """Whether the last panorama must show the goal instance."""
    straight: bool = False
    """Whether distances to the goal are straight through the air, in three dimensions, and the
    shortest way leads over roofs; else both are geodesic over the floor."""
    to_middle: bool = False
    """Whether a straight distance is to the middle of a thing, not to the nearest point of it."""
    unflown: float = 0.0
    """Metres at the end of the shortest way that SPL does not ask for."""
    by_answer: bool = False
    """Whether a correct answer decides, and the place is only kept beside it."""

    def reached(self, distance: float) -> bool:
        """Returns whether a distance to the goal, metres, is near enough."""
        return distance < self.radius if self.strict else distance <= self.radius


@dataclass(frozen=True)
class FamilyBudgets(Message):
    """What a task of a family may take unless the scenario says otherwise."""

    decisions: int = 40
    simulated_time: float = 1800.0
    """Simulated seconds."""


@dataclass(frozen=True)
class TaskFamily(Message):
    """One family of tasks (paper III-A)."""

    name: str = ""
    meaning: str = ""
    rules: tuple[SuccessRule, ...] = ()
    """One for each protocol under which it can be scored, ``home`` first."""
    answer: str = "none"
    """``none`` | ``open``: whether the agent answers after its last stop."""
    budgets: FamilyBudgets = FamilyBudgets()


def _radius(protocol: str, radius: float, *, strict: bool, by_answer: bool = False) -> SuccessRule:
    return SuccessRule(
        protocol, radius, strict=strict, in_room=False, seen=False, by_answer=by_answer
    )


def _flight(protocol: str, *, to_middle: bool = False) -> SuccessRule:
    """OpenUAV's rule: within 20 m, and SPL of a way that is 20 m shorter."""
    return SuccessRule(
        protocol,
        20.0,
        in_room=False,
        seen=False,
        straight=True,
        to_middle=to_middle,
        unflown=20.0,
    )


FAMILY_TABLE: Mapping[str, TaskFamily] = {
    family.name: family
    for family in (
        TaskFamily(
            "vln",
            "route instruction",
            (
                SuccessRule(),
                _radius("habitat", 3.0, strict=True),
                _radius("uni_lavira", 3.0, strict=False),
            ),
        ),
        TaskFamily(
            "objectnav",
            "object goal",
            (
                SuccessRule(),
                _radius("habitat", 0.1, strict=True),
                _radius("ovon", 0.25, strict=True),
                _radius("uni_lavira", 1.0, strict=True),
            ),
        ),
        TaskFamily(
            "eqa",
            "embodied question",
            (
                SuccessRule(by_answer=True),
                _radius("habitat", 3.0, strict=True, by_answer=True),
                _radius("uni_lavira", 3.0, strict=True, by_answer=True),
            ),
            answer="open",
        ),
        TaskFamily(
            "aerial_vln",
            "flight directive",
            (
                _flight(HOME),
                # OpenUAV measures to one point.
                _flight("uni_lavira", to_middle=True),
            ),
            # OpenUAV gives a flight at most 70 waypoints.
            budgets=FamilyBudgets(decisions=70, simulated_time=3600.0),
        ),
    )
}
FAMILIES = tuple(FAMILY_TABLE)
"""Route instruction, object goal, embodied question, flight directive (paper III-A)."""


@dataclass(frozen=True)
class TaskSpec(Message):
    """A task as the agent receives it.  The goal that scores it is not part of it."""

    family: str = "vln"
    text: str = ""
    choices: tuple[str, ...] = ()
    """The closed vocabulary of a question's answer; empty when any words will do."""

    @property
    def answer_type(self) -> str:
        """``none`` | ``open`` | ``closed``: what the agent gives at the end beside its stop."""
        return "closed" if self.choices else FAMILY_TABLE[self.family].answer

    @property
    def success(self) -> SuccessRule:
        """How a stop is judged under the protocol ``home``."""
        return success_rule(self.family)

    @property
    def budgets(self) -> FamilyBudgets:
        """What the task may take unless the scenario says otherwise."""
        return FAMILY_TABLE[self.family].budgets


def asks(family: str) -> bool:
    """Returns whether the tasks of a family are questions, answered after the last stop."""
    return FAMILY_TABLE[family].answer != "none"


def success_rule(family: str, protocol: str = HOME) -> SuccessRule:
    """Returns how a task of a family is scored under a protocol.

    Raises:
        TaskError: if the protocol does not score that family.
    """
    rules = {rule.protocol: rule for rule in FAMILY_TABLE[family].rules}
    if protocol not in rules:
        raise TaskError(unknown_name(f"protocol of {family!r}", protocol, rules, "task.protocol"))
    return rules[protocol]


def checked_task(text: str, family: str = "vln", choices: Sequence[str] = ()) -> TaskSpec:
    """Returns a task with its spaces folded.

    Raises:
        TaskError: if the text is empty or longer than 2,000 words, the family is unknown, or
            choices are given for a task without an answer, or fewer than two different ones.
    """
    words = text.split()
    if not words:
        raise TaskError("task: the text is empty; say where to go, e.g. 'Go to the red sofa.'")
    if len(words) > MAX_TASK_WORDS:
        raise TaskError(
            f"task: {len(words)} words, at most {MAX_TASK_WORDS} are read; shorten the text "
            f"(it starts {' '.join(words[:6])!r})."
        )
    if family not in FAMILY_TABLE:
        raise TaskError(f"task: unknown family {family!r}; valid: {', '.join(FAMILIES)}.")
    folded = tuple(" ".join(choice.split()) for choice in choices)
    if folded and not asks(family):
        raise TaskError(
            f"task: choices are for questions; remove them, or set the family {family!r} to 'eqa'."
        )
    if folded and (not all(folded) or len({choice.casefold() for choice in folded}) < 2):
        raise TaskError(
            f"task: choices {list(folded)} must be two different answers at least, none empty."
        )
    return TaskSpec(family=family, text=" ".join(words), choices=folded)
