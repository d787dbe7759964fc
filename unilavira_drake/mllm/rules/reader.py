"""Reads the tokens of an instruction, sentence by sentence, segment by segment.

A segment ends at a comma or a conjunction.  Inside it the nearest verb or preposition before a
noun phrase gives the noun its part: leave, enter, go to, pass, go through, walk along, stop at.
Statements ("you will see ...", "... is on your left") make no clause, but what they mention lends
its colour to later mentions and is what ``it`` and ``that door`` refer to.
"""

from __future__ import annotations

import dataclasses

from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.lexicon import Token, is_courtesy
from unilavira_drake.mllm.rules.meaning import Segment
from unilavira_drake.mllm.rules.nouns import DOOR, Noun, read_noun

_ON_FLOOR = ("upstairs", "downstairs", "upper", "lower", "floor", "ground", "top", "one", "next")
_NEW_ACTION = ("move", "stop", "turn", "turn_back", "search", "leave", "out")
_STARTS_NOUN = ("thing", "room", "here", "next_room", "color", "ordinal", "side")
_ROLE_VERBS = (
    *("enter", "entering", "cross", "crossing", "pass", "passing", "follow", "following"),
    *("approach", "approaching", "reach", "find", "locate", "visit", "traverse"),
)


class Reader:
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
                later, postponed = self._open.made, False
            else:
                self.clauses += self._open.made
        self.clauses += later

    def _segment(self, tokens: list[Token]) -> None:
        self._open = Segment(role=self._carry)
        if _is_statement(tokens):
            self._hint = True
        i = 0
        while i < len(tokens):
            found = read_noun(tokens, i) if tokens[i].kind in _STARTS_NOUN else None
            if found is None:
                self._read(tokens[i])
                i += 1
            else:
                self._noun(found[0])
                i = found[1]
        if not self._hint:
            self._open.finish()

    def _read(self, token: Token) -> None:
        """Takes a token that starts no noun phrase."""
        segment, kind = self._open, token.kind
        readers = {"role": self._set_role, "climb": self._climb}
        if kind in _NEW_ACTION:
            self._action(token)
        elif kind in readers:
            readers[kind](token)
        elif kind in ("until", "when", "before", "hint"):
            self._condition(token)
        elif kind in ("in", "on", "from", "see"):
            segment.role = kind
        elif kind in ("straight", "end"):
            setattr(segment, kind, True)
        elif kind == "it":
            self._pronoun()
        elif kind == "side":
            self._place_side(token.value, modifier=segment.role == "on")
        elif kind == "ordinal":
            segment.ordinal = int(token.value)
        elif kind == "word" and not is_courtesy(token.value):
            segment.words.append(token.value)

    def _climb(self, token: Token) -> None:
        """Takes stairs; what is said to be on another floor is gone to after them."""
        clause, made = Clause("climb", side=token.value), self._open.made
        if made and token.text.split()[0] in _ON_FLOOR:
            made.insert(0, clause)
        else:
            made.append(clause)
        self._open.role = ""

    def _condition(self, token: Token) -> None:
        segment = self._open
        if token.kind in ("until", "when"):
            segment.until, self._hint = True, False
            segment.role = "pass" if token.text == "after" else "to"
        elif token.kind == "before":
            segment.role = "at" if segment.verb == "stop" else ""
        elif segment.until:
            segment.role = "see" if "see" in token.text else segment.role
        else:
            self._hint = True

    def _action(self, token: Token) -> None:
        self._hint = False
        self._open.role = ""
        if token.kind == "turn_back":
            self._open.made.append(Clause("turn", side="around"))
        elif token.kind in ("leave", "out"):
            self._open.leave = True
            self._open.role = "leave" if token.kind == "leave" else ""
        else:
            self._open.verb = token.kind
            self._open.turning = token.kind == "turn"

    def _set_role(self, token: Token) -> None:
        if token.text == "for" and self._open.verb not in ("search", "move"):
            return
        if token.text in _ROLE_VERBS:
            self._hint = False
        if token.text == "by" and self._open.verb == "move":
            self._open.role = "pass"
        else:
            self._open.role = token.value
        self._open.words = []

    def _place_side(self, side: str, *, modifier: bool) -> None:
        if self._hint:
            self._door = dataclasses.replace(self._door, side=side)
            self._side = side
        elif self._open.turning and (not modifier or not self._open.made):
            self._open.turning = False
            if self._open.ordinal:
                self._open.made.append(Clause("door", side=side, ordinal=self._open.ordinal))
            else:
                self._open.made.append(Clause("turn", side=side))
        elif self._open.made and modifier:
            self._open.made[-1] = dataclasses.replace(self._open.made[-1], side=side)
        elif self._open.verb == "move" and not modifier:
            self._open.made.append(Clause("turn", side=side))
        elif self.clauses and modifier and not self._open.verb:
            if self.clauses[-1].kind != "turn":
                self.clauses[-1] = dataclasses.replace(self.clauses[-1], side=side)
        else:
            self._side = side
        self._open.role = "" if modifier else self._open.role

    def _pronoun(self) -> None:
        if self._open.role == "through" and self._door.category:
            self._noun(self._door)
        elif self._open.role in ("to", "at", "pass", "find") and self._thing.category:
            self._noun(self._thing)

    def _noun(self, noun: Noun) -> None:
        if noun.generic == "one":
            if not self._thing.category:
                return
            noun = dataclasses.replace(noun, category=self._thing.category, generic="")
        if noun.category == DOOR:
            noun = self._resolved_door(noun)
            self._door = noun
        elif noun.category:
            self._thing = noun
            self.mentions.append(noun)
        if self._hint or self._open.role == "from":
            return
        if self._open.turning and self._open.role == "" and noun.category == DOOR:
            self._open.role = "through"  # "take the second door"
        self._open.take(noun)
        made = self._open.made
        if made and self._side:
            made[-1] = dataclasses.replace(made[-1], side=made[-1].side or self._side)
            self._side = ""
        self._open.words = []
        self._carry = self._open.role if self._open.role in ("pass", "through") else ""

    def _resolved_door(self, noun: Noun) -> Noun:
        bare = not (noun.room or noun.side or noun.ordinal)
        if bare and self._door.category and self._open.role == "through" and not self._open.leave:
            return self._door
        return noun


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
