"""Noun phrases of an instruction: ``the second white door on the left``."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.mllm.rules.lexicon import Token

DOOR = "door"


@dataclass(frozen=True)
class Noun:
    """What a noun phrase names; empty fields were not said."""

    category: str = ""
    """Class of thing, ``door`` included; empty when a room is meant."""
    room: str = ""
    """Kind of room; of a door: the room behind it; of a thing: where it is."""
    color: str = ""
    side: str = ""
    ordinal: int = 0
    generic: str = ""
    """``here`` (this room), ``next`` (another room) or ``one`` (the thing spoken of)."""

    @property
    def is_room(self) -> bool:
        """Whether a room is meant, known by kind or not."""
        return not self.category


def read_noun(tokens: list[Token], start: int) -> tuple[Noun, int] | None:
    """Returns the noun phrase that starts at a token and the index behind it, or None.

    Colour, side and ordinal must stand before the head; a side alone is not a noun.
    """
    color, side, ordinal = "", "", 0
    i = start
    while i < len(tokens):
        token = tokens[i]
        if token.kind == "color":
            color = token.value
        elif token.kind == "ordinal":
            ordinal = int(token.value)
        elif token.kind == "side" and i > 0 and tokens[i - 1].kind in ("article", "ordinal"):
            side = token.value
        elif token.kind == "one":
            said = color or side or ordinal
            return (Noun("", "", color, side, ordinal, "one"), i + 1) if said else None
        elif token.kind in ("thing", "room", "here", "next_room"):
            noun, end = _head(tokens, i)
            return (
                Noun(noun.category, noun.room, color, side, ordinal, noun.generic),
                end,
            )
        elif token.kind not in ("article", "word") or (i == start and token.kind == "word"):
            return None
        i += 1
    return None


def _head(tokens: list[Token], i: int) -> tuple[Noun, int]:
    token = tokens[i]
    if token.kind == "here":
        return Noun(generic="here"), i + 1
    if token.kind == "next_room":
        return Noun(generic="next"), i + 1
    following = tokens[i + 1] if i + 1 < len(tokens) else Token("stop_mark")
    if token.kind == "room":
        if following.kind == "thing":
            return Noun(following.value, token.value), i + 2
        return Noun(room=token.value), i + 1
    if token.value == DOOR:
        room, end = _behind(tokens, i + 1)
        return Noun(DOOR, room), end
    return Noun(token.value), i + 1


def _behind(tokens: list[Token], start: int) -> tuple[str, int]:
    """Returns the room in ``(door) of|to|into|leading to the ROOM`` and the index behind it."""
    linked = False
    for i in range(start, min(start + 5, len(tokens))):
        token = tokens[i]
        if token.kind == "room" and linked:
            following = tokens[i + 1] if i + 1 < len(tokens) else Token("stop_mark")
            return (token.value, i + 1) if following.kind != "thing" else ("", start)
        if token.kind == "of" or (token.kind == "role" and token.value in ("to", "enter")):
            linked = True
        elif token.kind not in ("article", "word"):
            break
    return "", start
