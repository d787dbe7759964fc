"""What a target's description names: ``the red sofa beside the blue rug`` is a red sofa."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages import Message
from unilavira_drake.mllm.rules.lexicon import Token, tokenize
from unilavira_drake.mllm.rules.nouns import DOOR, read_noun

FLOOR = "floor"
_FLOOR_WORDS = frozenset({FLOOR, "ground"})
_RELATIONS = frozenset({"role", "in", "on", "from", "and", "see", "hint", "when", "stop_mark"})


@dataclass(frozen=True)
class TargetWords(Message):
    """The thing or region that a description names; empty fields were not said."""

    category: str = ""
    """Canonical class of thing, ``door`` and ``floor`` included."""
    room: str = ""
    """Canonical kind of room: of a floor, behind a door, or meant itself."""
    color: str = ""


def read_target(target_desc: str) -> TargetWords:
    """Returns what a noun phrase names.

    The words before its first relation decide: what follows says where the thing is.  Only the
    room of a floor (``floor in the hallway``) and the one behind a door may stand later.
    """
    tokens = tokenize(target_desc)
    head = _head(tokens)
    color = next((token.value for token in head if token.kind == "color"), "")
    if any(token.text in _FLOOR_WORDS for token in head):
        return TargetWords(FLOOR, _first(tokens, "room"), color)
    things = [i for i, token in enumerate(head) if token.kind == "thing"]
    if not things:
        return TargetWords("", _first(head, "room"), color)
    # The last one: "door of the fridge" and "sofa table" end with what is there.
    category = head[things[-1]].value
    if category != DOOR:
        return TargetWords(category, "", color)
    noun = read_noun(tokens, things[-1])
    return TargetWords(DOOR, "" if noun is None else noun[0].room, color)


def _head(tokens: list[Token]) -> list[Token]:
    """Returns the tokens before the first relation behind a word that names something."""
    named = False
    for i, token in enumerate(tokens):
        if named and token.kind in _RELATIONS:
            return tokens[:i]
        named |= token.kind in ("thing", "room", "color") or token.text in _FLOOR_WORDS
    return tokens


def _first(tokens: list[Token], kind: str) -> str:
    return next((token.value for token in tokens if token.kind == kind), "")
