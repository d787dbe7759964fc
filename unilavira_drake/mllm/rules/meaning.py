"""What a segment of a sentence asks: its verb, its prepositions and its nouns make clauses."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.nouns import DOOR, Noun

_WITH_LANDMARK = ("go", "stop", "door", "leave", "near_door")


@dataclass
class Segment:
    """The words between two commas or conjunctions, while they are read."""

    verb: str = ""
    """``move | stop | turn | search``; empty before any."""
    role: str = ""
    """What the last verb or preposition makes of the next noun phrase."""
    ordinal: int = 0
    until: bool = False
    """Whether the segment is a condition: ``until ...``, ``when ...``."""
    leave: bool = False
    """Whether ``leave`` or ``out`` still waits for what is left."""
    turning: bool = False
    """Whether ``turn`` or ``take`` still waits for its side."""
    straight: bool = False
    end: bool = False
    """Whether ``end (of)`` still waits for its room."""
    words: list[str] = field(default_factory=list)
    """Words outside the lexicon since the last role."""
    made: list[Clause] = field(default_factory=list)

    def take(self, noun: Noun) -> None:
        """Appends the clauses that a noun phrase makes under the present verb and role."""
        made = self.made
        if self.end and noun.is_room:
            self.end = False
            self._before_turn(Clause("end", room=noun.room))
            if self.role == "at" and len(made) > 1 and made[-2].category:
                made[-2:] = reversed(made[-2:])  # "the lamp at the end of the corridor"
        elif self.role == "leave" or (self.leave and noun.category == DOOR):
            self._leave_by(noun)
        elif noun.category == DOOR:
            self._door_clause(noun)
        elif noun.is_room:
            self._room_clause(noun)
        else:
            self._thing_clause(noun)

    def _before_turn(self, clause: Clause) -> None:
        """Adds a clause; one that says where to turn goes before the turn."""
        if self.made and self.made[-1].kind == "turn" and self.verb == "turn":
            self.made.insert(len(self.made) - 1, clause)
        else:
            self.made.append(clause)

    def _leave_by(self, noun: Noun) -> None:
        self.leave, self.role = False, ""
        if noun.category == DOOR:
            self.made.append(Clause("leave", side=noun.side, ordinal=noun.ordinal))
            if noun.room:
                self.made.append(Clause("enter", room=noun.room))
        else:
            self.made.append(Clause("leave", room=noun.room))

    def _door_clause(self, noun: Noun) -> None:
        last = self.made[-1] if self.made else Clause("")
        if self.role == "through" and last.kind == "leave":
            self.made[-1] = dataclasses.replace(last, side=noun.side, ordinal=noun.ordinal)
            if noun.room:
                self.made.append(Clause("enter", room=noun.room))
        elif self.role in ("through", "enter") or (self.verb == "turn" and self.role == "at"):
            if noun.room:
                self.made.append(Clause("enter", room=noun.room, side=noun.side))
            else:
                self.made.append(Clause("door", side=noun.side, ordinal=noun.ordinal))
        elif self.role == "at" and last.category:
            return  # "the trash can near the door": any door will do
        elif self.role == "pass":
            self._before_turn(Clause("pass", "door", noun.color, side=noun.side))
        elif self.role in ("to", "at", "find"):
            kind = "door" if noun.ordinal and not noun.room else "near_door"
            self.made.append(Clause(kind, room=noun.room, side=noun.side, ordinal=noun.ordinal))

    def _room_clause(self, noun: Noun) -> None:
        role, made = self.role, self.made
        if noun.generic == "here" and role in ("through", "in", "at", "", "find"):
            return
        if role == "in" and made:
            self._place_in(noun)
        elif role in ("through", "along"):
            made.append(Clause(role, room=noun.room))
        elif role == "pass":
            self._before_turn(Clause("pass", room=noun.room))
        elif role in ("enter", "to") and (noun.generic or noun.ordinal):
            made.append(Clause("door", side=noun.side, ordinal=noun.ordinal))
        elif role in ("enter", "to", "find", "at", "in") and not noun.generic:
            made.append(Clause("enter", room=noun.room, side=noun.side))

    def _place_in(self, noun: Noun) -> None:
        """Says in which room the last thing or turn is: that room comes first."""
        enter = Clause("enter", room=noun.room)
        if self.made[-1].category:
            if self.made[-1].kind != "pass":
                self.made.insert(len(self.made) - 1, enter)
        elif self.verb == "turn":
            self._before_turn(enter)
        elif not noun.generic:
            self.made.append(enter)

    def _thing_clause(self, noun: Noun) -> None:
        role, last = self.role, self.made[-1] if self.made else Clause("")
        clause = Clause("go", noun.category, noun.color, side=noun.side, ordinal=noun.ordinal)
        if role in ("at", "on") and self.verb != "turn" and last.kind in _WITH_LANDMARK:
            if not last.landmark:
                self.made[-1] = dataclasses.replace(last, landmark=noun.category)
            return
        if role == "see":
            clause = dataclasses.replace(clause, kind="see")
            if not self.until:
                return
        elif role == "pass" or (self.verb == "turn" and role in ("at", "to")):
            self._before_turn(dataclasses.replace(clause, kind="pass"))
            return
        elif role in ("at", "on") and self.verb == "stop":
            clause = dataclasses.replace(clause, kind="stop")
        elif role in ("", "in", "on", "leave") and not self.until:
            return
        if noun.room:
            self.made.append(Clause("enter", room=noun.room))
        self.made.append(clause)

    def finish(self) -> None:
        """Appends what the segment leaves open: a bare verb, or a noun outside the lexicon."""
        if self.leave:
            at = next((i for i, c in enumerate(self.made) if c.kind != "turn"), len(self.made))
            self.made.insert(at, Clause("leave"))
        if self.end:
            self._before_turn(Clause("end"))
        if self.straight and not self.made and self.verb in ("move", ""):
            self.made.append(Clause("straight"))
        wanted = self.role == "find" or (self.role in ("to", "at") and self.verb)
        if self.words and not self.made and wanted:
            kind = "stop" if self.verb == "stop" else "go"
            self.made.append(Clause(kind, " ".join(self.words)))
