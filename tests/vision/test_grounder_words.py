"""What a target's description names."""

from __future__ import annotations

import pytest

from unilavira_drake.sensors.grounder_words import TargetWords, read_target


@pytest.mark.parametrize(
    ("text", "category", "room", "color"),
    [
        ("the blue sofa", "sofa", "", "blue"),
        ("open white door beside the shelf", "door", "", "white"),
        ("armrest of the red sofa", "sofa", "", "red"),
        ("couch with a green cushion", "sofa", "", ""),
        ("green potted plant next to the gray couch", "plant", "", "green"),
        ("kitchen table", "dining table", "", ""),
        ("the couch in the lounge", "sofa", "", ""),
        ("fridge, white, next to the blue counter", "refrigerator", "", "white"),
        ("towards the red sofa", "sofa", "", "red"),
        ("free floor in the hallway past the plant", "floor", "corridor", ""),
        ("kitchen floor", "floor", "kitchen", ""),
        ("open floor", "floor", "", ""),
        ("the hallway", "", "corridor", ""),
        ("far end of the hallway", "", "corridor", ""),
        ("doorway leading to the kitchen", "door", "kitchen", ""),
        ("door at the end of the corridor", "door", "", ""),
        ("the red thing", "", "", "red"),
        ("whatever this may be", "", "", ""),
        ("", "", "", ""),
    ],
)
def test_a_description_is_read(text: str, category: str, room: str, color: str) -> None:
    assert read_target(text) == TargetWords(category, room, color)
