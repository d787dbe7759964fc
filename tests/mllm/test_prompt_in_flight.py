"""What the prompts of an aircraft say; the ground's are in ``test_prompt``.

After a deliberate change of the templates: python tests/mllm/test_prompt_in_flight.py
"""

from __future__ import annotations

import dataclasses

import pytest
from test_prompt import DECIDE, GOLDEN, GROUND, IMAGES, PAST, VARIABLES, _text, _with

from unilavira_drake.messages import DOWN
from unilavira_drake.mllm.request import DirectionNote, ImagePart, ViewNote, WaypointNote

FOLDER = GOLDEN / "flight"
FLIGHT = _with(
    dataclasses.replace(DECIDE, images=(*PAST, *IMAGES, ImagePart("view down", b"down", "medium"))),
    family="aerial_vln",
    task="The target is 120 m at 30 degrees from you. It is a red car.",
    in_flight=True,
    compass=112.0,
    reach=40.0,
    views=(*VARIABLES.views, ViewNote(DOWN, 18.5)),
    waypoints=(
        WaypointNote(1, 31.2, 178.0, -90.0, "a street", (), True, "H1", height=-12.4),
        WaypointNote(2, 0.0, 0.0, 0.0, "above a park", ("down: failed: stuck",)),
    ),
)
NOT_GROUNDED = _with(
    FLIGHT,
    outcome="failed: no target: only sky",
    bearings=DirectionNote((30.5, -10.0, 12.4, 90.0), 96.3, -20.5),
)

GOLDENS = {
    "decide": FLIGHT,
    "decide_not_grounded": NOT_GROUNDED,
    "plan_todo": dataclasses.replace(FLIGHT, call="plan_todo"),
    "recover": _with(dataclasses.replace(FLIGHT, call="recover"), failed_direction=DOWN),
    "double_check": dataclasses.replace(FLIGHT, call="double_check"),
    "ground": _with(GROUND, in_flight=True, family="aerial_vln", direction=DOWN),
}


@pytest.mark.parametrize("name", GOLDENS)
def test_golden(name: str) -> None:
    assert _text(GOLDENS[name]) == (FOLDER / f"{name}.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", sorted(set(GOLDENS) - {"ground"}))
def test_nothing_of_the_ground_is_left(name: str) -> None:
    text = _text(GOLDENS[name])
    for word in ("four views", "floor", "door frame, ", "ten metres in one turn"):
        assert word not in text.replace("door frame'", "")
    assert ("REASON ON DIRECTIONS" in text) is (name == "decide_not_grounded")


def test_how_far_one_move_goes() -> None:
    text = _text(_with(FLIGHT, reach=7.5))
    assert "around obstacles, up to 7.5 metres in one turn;" in text


@pytest.mark.parametrize(
    ("compass", "words"),
    [(0.0, "north (0"), (44.0, "north-east (44"), (180.0, "south (180"), (359.0, "north (359")],
)
def test_the_compass_is_told_in_words(compass: float, words: str) -> None:
    text = _text(_with(FLIGHT, compass=compass))
    assert f"Front looks to the {words} degrees by the compass)." in text


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, request in GOLDENS.items():
        (FOLDER / f"{name}.txt").write_text(_text(request), encoding="utf-8")
