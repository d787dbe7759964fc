"""Instruction -> clauses: one pass over the tokens of each sentence, segment by segment.

A segment ends at a comma or a conjunction.  Inside it the nearest verb or preposition before a
noun phrase gives the noun its part: leave, enter, go to, pass, go through, walk along, stop at.
Statements ("you will see ...", "... is on your left") make no clause, but what they mention lends
its colour to later mentions and is what ``it`` and ``that door`` refer to.
"""

from __future__ import annotations

import dataclasses

from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.lexicon import Token, is_courtesy, tokenize
from unilavira_drake.mllm.rules.nouns import DOOR, Noun, read_noun

_NEW_ACTION = ("move", "stop", "turn", "turn_back", "search", "leave", "out")
_ROLE_VERBS = frozenset(
    [
        "enter",
        "entering",
        "cross",
        "crossing",
        "pass",
        "passing",
        "follow",
        "following",
        "approach",
        "approaching",
        "reach",
        "find",
        "locate",
        "visit",
        "traverse",
    ]
)


def parse(text: str) -> tuple[Clause, ...]:
    """Returns the clauses of an instruction in the order in which they are to be done."""
    reader = _Reader()
    sentence: list[Token] = []
    for token in [*tokenize(text), Token("stop_mark")]:
        if token.kind != "stop_mark":
            sentence.append(token)
        elif sentence:
            reader.sentence(sentence)
            sentence = []
    clauses = reader.clauses or _bare_nouns(tokenize(text))
    return _tidy(clauses, reader.mentions)


def _bare_nouns(tokens: list[Token]) -> list[Clause]:
    """Reads a text without any verb, e.g. ``washing machine``, as a thing or room to go to."""
    for i in range(len(tokens)):
        found = read_noun(tokens, i)
        if found is not None and found[0].category not in ("", DOOR):
            return [Clause("go", found[0].category, found[0].color)]
        if found is not None and found[0].room:
            return [Clause("enter", room=found[0].room)]
    return []


def _tidy(clauses: list[Clause], mentions: list[Noun]) -> tuple[Clause, ...]:
    """Gives things the colours they were mentioned with; joins ``go to X, stop at X``."""
    colors = {noun.category: noun.color for noun in reversed(mentions) if noun.color}
    tidy: list[Clause] = []
    for clause in clauses:
        if clause.category and not clause.color:
            clause = dataclasses.replace(clause, color=colors.get(clause.category, ""))
        last = tidy[-1] if tidy else Clause("")
        same = (last.category, last.color, last.room) == (
            clause.category,
            clause.color,
            clause.room,
        )
        if same and clause.kind == "stop" and last.kind in ("go", "see"):
            tidy[-1] = dataclasses.replace(last, kind="stop")
        elif same and clause.kind == "go" and last.kind in ("go", "stop"):
            continue
        elif clause.kind == "enter" and clause.room == last.room and last.kind in _IN_ROOM:
            if last.kind == "near_door":
                tidy[-1] = clause
        else:
            tidy.append(clause)
    return tuple(tidy)


_IN_ROOM = ("enter", "through", "along", "near_door")


class _Reader:
    """Reads sentences; holds what earlier words refer to."""

    def __init__(self) -> None:
        self.clauses: list[Clause] = []
        self.mentions: list[Noun] = []
        self._thing = Noun()
        self._door = Noun()

    def sentence(self, tokens: list[Token]) -> None:
        """Appends the clauses of one sentence."""
        postponed = tokens[0].kind == "before"
        self._hint, self._carry, self._side = False, "", ""
        later: list[Clause] = []
        for segment in _segments(tokens):
            self._segment(segment)
            if postponed:
                later, postponed = self._made, False
            else:
                self.clauses += self._made
        self.clauses += later

    def _segment(self, tokens: list[Token]) -> None:
        self._made: list[Clause] = []
        self._verb, self._role, self._ordinal = "", self._carry, 0
        self._until = self._leave = self._turning = self._straight = self._end = False
        self._words: list[str] = []
        if _is_statement(tokens):
            self._hint = True
        i = 0
        while i < len(tokens):
            i = self._step(tokens, i)
        self._finish()

    def _step(self, tokens: list[Token], i: int) -> int:
        """Handles the token (or noun phrase) at ``i``; returns the next index."""
        token = tokens[i]
        found = None
        if token.kind in ("thing", "room", "here", "next_room", "color", "ordinal", "side"):
            found = read_noun(tokens, i)
        if found is not None:
            self._noun(found[0])
            return found[1]
        if token.kind in _NEW_ACTION:
            self._action(token)
        elif token.kind == "role":
            self._set_role(token)
        elif token.kind in ("until", "when"):
            self._until, self._hint = True, False
            self._role = "pass" if token.text == "after" else "to"
        elif token.kind == "before":
            self._role = "at" if self._verb == "stop" else ""
        elif token.kind == "hint" and self._until:
            self._role = "see" if "see" in token.text else self._role
        elif token.kind == "hint":
            self._hint = True
        elif token.kind in ("in", "on", "from", "see"):
            self._role = token.kind
        elif token.kind == "straight":
            self._straight = True
        elif token.kind == "end":
            self._end = True
        elif token.kind == "it":
            self._pronoun()
        elif token.kind == "side":
            self._place_side(token.value, modifier=self._role == "on")
        elif token.kind == "ordinal":
            self._ordinal = int(token.value)
        elif token.kind == "word" and not is_courtesy(token.value):
            self._words.append(token.value)
        return i + 1

    def _action(self, token: Token) -> None:
        self._hint = False
        self._role = ""
        if token.kind == "turn_back":
            self._made.append(Clause("turn", side="around"))
        elif token.kind in ("leave", "out"):
            self._leave = True
            self._role = "leave" if token.kind == "leave" else ""
        else:
            self._verb = token.kind
            self._turning = token.kind == "turn"

    def _set_role(self, token: Token) -> None:
        if token.text == "for" and self._verb not in ("search", "move"):
            return
        if token.text in _ROLE_VERBS:
            self._hint = False
        if token.text == "by" and self._verb == "move":
            self._role = "pass"
        else:
            self._role = token.value
        self._words = []

    def _place_side(self, side: str, *, modifier: bool) -> None:
        if self._hint:
            self._door = dataclasses.replace(self._door, side=side)
            self._side = side
        elif self._turning and (not modifier or not self._made):
            self._turning = False
            if self._ordinal:
                self._made.append(Clause("door", side=side, ordinal=self._ordinal))
            else:
                self._made.append(Clause("turn", side=side))
        elif self._made and modifier:
            self._made[-1] = dataclasses.replace(self._made[-1], side=side)
        elif self._verb == "move" and not modifier:
            self._made.append(Clause("turn", side=side))
        elif self.clauses and modifier and not self._verb:
            if self.clauses[-1].kind != "turn":
                self.clauses[-1] = dataclasses.replace(self.clauses[-1], side=side)
        else:
            self._side = side
        self._role = "" if modifier else self._role

    def _pronoun(self) -> None:
        if self._role == "through" and self._door.category:
            self._noun(self._door)
        elif self._role in ("to", "at", "pass", "find") and self._thing.category:
            self._noun(self._thing)

    def _noun(self, noun: Noun) -> None:
        if noun.category == DOOR:
            noun = self._resolved_door(noun)
            self._door = noun
        elif noun.category:
            self._thing = noun
            self.mentions.append(noun)
        if self._hint or self._role == "from":
            return
        if self._turning and self._role == "" and noun.category == DOOR:
            self._role = "through"  # "take the second door"
        made = self._clauses_for(noun)
        if made and self._side:
            made[-1] = dataclasses.replace(made[-1], side=made[-1].side or self._side)
            self._side = ""
        self._words = []
        self._carry = self._role if self._role in ("pass", "through") else ""

    def _resolved_door(self, noun: Noun) -> Noun:
        bare = not (noun.room or noun.side or noun.ordinal)
        if bare and self._door.category and self._role == "through" and not self._leave:
            return self._door
        return noun

    def _clauses_for(self, noun: Noun) -> list[Clause]:
        """Appends what a noun phrase means under the present role; returns the list it is in."""
        made = self._made
        if self._end and noun.is_room:
            self._end = False
            self._before_turn(Clause("end", room=noun.room))
            if self._role == "at" and len(made) > 1 and made[-2].category:
                made[-2:] = reversed(made[-2:])  # "the lamp at the end of the corridor"
        elif self._role == "leave" or (self._leave and noun.category == DOOR):
            self._leave_by(noun)
        elif noun.category == DOOR:
            self._door_clause(noun)
        elif noun.is_room:
            self._room_clause(noun)
        else:
            self._thing_clause(noun)
        return made

    def _before_turn(self, clause: Clause) -> None:
        """Adds a clause; one that says where to turn goes before the turn."""
        if self._made and self._made[-1].kind == "turn" and self._verb == "turn":
            self._made.insert(len(self._made) - 1, clause)
        else:
            self._made.append(clause)

    def _leave_by(self, noun: Noun) -> None:
        self._leave, self._role = False, ""
        if noun.category == DOOR:
            self._made.append(Clause("leave", side=noun.side, ordinal=noun.ordinal))
            if noun.room:
                self._made.append(Clause("enter", room=noun.room))
        else:
            self._made.append(Clause("leave", room=noun.room))

    def _door_clause(self, noun: Noun) -> None:
        last = self._made[-1] if self._made else Clause("")
        if self._role == "through" and last.kind == "leave":
            self._made[-1] = dataclasses.replace(last, side=noun.side, ordinal=noun.ordinal)
            if noun.room:
                self._made.append(Clause("enter", room=noun.room))
        elif self._role in ("through", "enter") or (self._verb == "turn" and self._role == "at"):
            if noun.room:
                self._made.append(Clause("enter", room=noun.room, side=noun.side))
            else:
                self._made.append(Clause("door", side=noun.side, ordinal=noun.ordinal))
        elif self._role == "at" and last.category:
            return  # "the trash can near the door": any door will do
        elif self._role == "pass":
            self._before_turn(Clause("pass", "door", noun.color, side=noun.side))
        elif self._role in ("to", "at", "find"):
            kind = "door" if noun.ordinal and not noun.room else "near_door"
            self._made.append(Clause(kind, room=noun.room, side=noun.side, ordinal=noun.ordinal))

    def _room_clause(self, noun: Noun) -> None:
        role = self._role
        if noun.generic == "here" and role in ("through", "in", "at", "", "find"):
            return
        if role == "in" and self._made and self._made[-1].category:
            if self._made[-1].kind != "pass":
                self._made.insert(len(self._made) - 1, Clause("enter", room=noun.room))
        elif role == "in" and self._verb == "turn" and self._made:
            self._before_turn(Clause("enter", room=noun.room))
        elif role in ("through", "along"):
            self._made.append(Clause(role, room=noun.room))
        elif role == "pass":
            self._before_turn(Clause("pass", room=noun.room))
        elif noun.generic:
            if role in ("enter", "to"):
                self._made.append(Clause("door", side=noun.side, ordinal=noun.ordinal))
        elif noun.ordinal and role in ("enter", "to"):
            self._made.append(Clause("door", side=noun.side, ordinal=noun.ordinal))
        elif role in ("enter", "to", "find", "at", "in"):
            self._made.append(Clause("enter", room=noun.room, side=noun.side))

    def _thing_clause(self, noun: Noun) -> None:
        role, last = self._role, self._made[-1] if self._made else Clause("")
        clause = Clause("go", noun.category, noun.color, side=noun.side, ordinal=noun.ordinal)
        if role in ("at", "on") and self._verb != "turn" and last.kind in _WITH_LANDMARK:
            if not last.landmark:
                self._made[-1] = dataclasses.replace(last, landmark=noun.category)
            return
        if role == "see":
            clause = dataclasses.replace(clause, kind="see")
            if not self._until:
                return
        elif role == "pass" or (self._verb == "turn" and role in ("at", "to")):
            self._before_turn(dataclasses.replace(clause, kind="pass"))
            return
        elif role in ("at", "on") and self._verb == "stop":
            clause = dataclasses.replace(clause, kind="stop")
        elif role in ("", "in", "on", "leave") and not self._until:
            return
        if noun.room:
            self._made.append(Clause("enter", room=noun.room))
        self._made.append(clause)

    def _finish(self) -> None:
        if self._leave and not self._hint:
            at = next((i for i, c in enumerate(self._made) if c.kind != "turn"), len(self._made))
            self._made.insert(at, Clause("leave"))
        if self._end and not self._hint:
            self._before_turn(Clause("end"))
        if self._straight and not self._made and not self._hint and self._verb in ("move", ""):
            self._made.append(Clause("straight"))
        if self._words and not self._made and not self._hint:
            if self._role == "find" or (self._role in ("to", "at") and self._verb):
                kind = "stop" if self._verb == "stop" else "go"
                self._made.append(Clause(kind, " ".join(self._words)))


_WITH_LANDMARK = ("go", "stop", "door", "leave", "near_door")


def _segments(tokens: list[Token]) -> list[list[Token]]:
    segments: list[list[Token]] = [[]]
    for i, token in enumerate(tokens):
        starts = token.kind in ("and", "comma", "until", "when") or (
            token.kind == "before" and i > 0 and tokens[i - 1].kind != "stop"
        )
        if starts:
            segments.append([])
        if token.kind not in ("and", "comma"):
            segments[-1].append(token)
    return [segment for segment in segments if segment]


def _is_statement(tokens: list[Token]) -> bool:
    """Whether a segment only tells something: ``the kitchen is on your left``."""
    told = next((i for i, t in enumerate(tokens) if t.kind == "hint"), None)
    if told is None or tokens[0].kind in ("until", "when"):
        return False
    before = tokens[:told]
    return not any(t.kind in _NEW_ACTION or t.text in _ROLE_VERBS for t in before)
