"""What the prompts say where people walk; all others are in ``test_prompt``.

After a deliberate change of the templates: python tests/mllm/test_prompt_among_people.py
"""

from __future__ import annotations

import dataclasses

import pytest
from test_prompt import DECIDE, GOLDEN, RECOVER, VARIABLES, _text, _with

FOLDER = GOLDEN / "people"
# With nobody in the left view.
PEOPLE = {
    "front": (
        "person in red, 1.4 m, 12 degrees to the left, walking towards you",
        "person in blue, 3.0 m, standing, seen 4 s ago",
    ),
    "back": ("person in green, 0.9 m",),
}
AMONG_PEOPLE = {
    "people": True,
    "views": tuple(
        dataclasses.replace(view, people=PEOPLE.get(view.direction, ())) for view in VARIABLES.views
    ),
}
GOLDENS = {"decide": _with(DECIDE, **AMONG_PEOPLE), "recover": _with(RECOVER, **AMONG_PEOPLE)}


@pytest.mark.parametrize("name", GOLDENS)
def test_golden(name: str) -> None:
    assert _text(GOLDENS[name]) == (FOLDER / f"{name}.txt").read_text(encoding="utf-8")


if __name__ == "__main__":
    for name, request in GOLDENS.items():
        (FOLDER / f"{name}.txt").write_text(_text(request), encoding="utf-8")
