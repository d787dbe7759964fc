"""Instruction -> clauses."""

from __future__ import annotations

import dataclasses

from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.lexicon import Token, tokenize
from unilavira_drake.mllm.rules.nouns import DOOR, Noun, read_noun
from unilavira_drake.mllm.rules.reader import Reader

_IN_ROOM = ("enter", "through", "along", "near_door")


def parse(text: str) -> tuple[Clause, ...]:
    """Returns the clauses of an instruction in the order in which they are to be done."""
    reader = Reader()
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
        if clause.kind == "climb" and clause == last:
            continue
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
