"""What an instruction asks, clause by clause, and each clause in canonical words."""

from __future__ import annotations

from dataclasses import dataclass

HARD = ("leave", "enter", "through", "along", "door", "climb", "go", "stop")
"""Clauses that say where to be.  The others (turn, straight, pass, end, near_door, see) say how to
get there and become moot once a later hard clause is met."""

ORDINALS = {1: "first", 2: "second", 3: "third", 4: "fourth", -1: "last"}
_SIDES = {"left": "left", "right": "right"}


@dataclass(frozen=True)
class Clause:
    """One sub-goal of an instruction; empty fields were not said."""

    kind: str
    """``leave | enter | through | along | end | door | near_door | turn | straight | pass | see |
    climb | go | stop``."""
    category: str = ""
    """Class of the thing meant (``go``, ``stop``, ``pass``, ``see``)."""
    color: str = ""
    room: str = ""
    """Kind of room; for ``near_door`` the room behind the door."""
    side: str = ""
    """``left | right``; for ``turn`` also ``around``; for ``climb`` ``up | down``."""
    ordinal: int = 0
    """1, 2, ...; -1 is the last; 0 was not said."""
    landmark: str = ""
    """Class of a thing that stands beside the thing or door meant."""

    @property
    def hard(self) -> bool:
        """Whether this clause says where to be."""
        return self.kind in HARD

    @property
    def thing(self) -> str:
        """The thing in words, e.g. ``white refrigerator``."""
        return f"{self.color} {self.category}".strip()


def describe(clause: Clause) -> str:
    """Returns a clause in the words of a TODO item, which the parser reads back unchanged."""
    side = f" on the {_SIDES[clause.side]}" if clause.side in _SIDES else ""
    beside = f" near the {clause.landmark}" if clause.landmark else ""
    ordinal = f"{ORDINALS[clause.ordinal]} " if clause.ordinal in ORDINALS else ""
    room = f"the {clause.room}" if clause.room else ""
    if clause.kind == "leave":
        door = ""
        if clause.side or clause.ordinal or clause.landmark:
            door = f" through the {ordinal}door{beside}{side}"
        return f"Leave {room or 'this room'}{door}"
    if clause.kind == "turn":
        return "Turn around" if clause.side == "around" else f"Turn {clause.side}"
    texts = {
        "enter": f"Enter {room}{side}",
        "through": f"Go through {room or 'this room'}",
        "along": f"Walk along {room or 'the corridor'}",
        "end": f"Go to the end of {room or 'this room'}",
        "door": f"Go through the {ordinal}door{beside}{side}",
        "near_door": f"Go to the door of {room}{side}" if room else f"Go to the door{beside}{side}",
        "climb": "Go downstairs" if clause.side == "down" else "Go upstairs",
        "straight": "Go straight ahead",
        "pass": f"Go past the {clause.thing or clause.room}{side}",
        "see": f"Go on until you spot the {clause.thing}",
        "go": f"Go to the {ordinal}{clause.thing}{beside}{side}",
        "stop": f"Stop next to the {ordinal}{clause.thing}{beside}{side}",
    }
    return texts[clause.kind]
