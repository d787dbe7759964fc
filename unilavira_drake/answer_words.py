"""The words of an answer: which ones are the same, and which choice they name."""

from __future__ import annotations

import re
from collections.abc import Sequence

_ARTICLES = frozenset(("a", "an", "the", "it", "is"))
_NUMBERS = (
    *("zero", "one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)
_SAME = {"grey": "gray", **{word: str(number) for number, word in enumerate(_NUMBERS)}}


def folded(text: str) -> str:
    """Returns an answer without what makes no difference.

    Case, marks, articles, British spelling and numbers as words are folded: ``It is grey.`` gives
    ``gray``, ``four`` gives ``4``.
    """
    words = re.findall(r"[^\W_]+", text.casefold())
    return " ".join(_SAME.get(word, word) for word in words if word not in _ARTICLES)


def chosen(answer: str, choices: Sequence[str]) -> str:
    """Returns the one choice that an answer names, empty when it names none or several.

    A choice inside a longer one that is named does not count: of ``room`` and ``dining room``,
    ``the dining room`` names the latter.
    """
    said = f" {folded(answer)} "
    found = []
    for choice in sorted(choices, key=lambda text: -len(folded(text))):
        words = f" {folded(choice)} "
        if words.strip() and words in said:
            said = said.replace(words, " | ")
            found.append(choice)
    return found[0] if len(found) == 1 else ""
