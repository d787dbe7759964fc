"""A mirrored flat with left and right exchanged in the words gives the mirrored path."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import LanguageAction, Panorama

EXCHANGED = {"left": "right", "right": "left"}


def exchange(text: str) -> str:
    """Returns the text with left and right exchanged."""
    return re.sub(r"\b(left|right)\b", lambda match: EXCHANGED[match.group()], text)


def walk(name: str, *, mirror: bool) -> tuple[bool | None, list[str], NDArray[np.float64]]:
    """Returns success, the words of the actions, and where each panorama was captured."""
    words: list[str] = []
    places: list[tuple[float, ...]] = []

    def listen(t: float, system: str, event: str, message: Any) -> None:
        if isinstance(message, LanguageAction):
            words.append(f"{message.tool} {message.argument}")
        if isinstance(message, Panorama):
            places.append(message.position[:2])

    # The robot's only handedness is mirrored, too: the side to which it turns to look around.
    overlay = "world: {mirror: true}\nrobot: {sweep_direction: right}" if mirror else ""
    scenario = load_scenario("flat", overlay)
    task = scenario.tasks[name]
    if mirror:
        task.text = exchange(task.text)
    scenario.task.text = f"@{name}"
    result = run_episode(scenario, on_event=listen)
    return result.success, words, np.array(places)


@pytest.mark.parametrize("name", ["fridge", "dining_table", "sofa", "desk"])
def test_mirrored_world_and_words_give_the_mirrored_path(name: str) -> None:
    success, words, places = walk(name, mirror=False)
    mirrored_success, mirrored_words, mirrored_places = walk(name, mirror=True)
    assert success
    assert mirrored_success
    assert mirrored_words == [exchange(word) for word in words]
    # Mostly exact; a pixel on an edge may be drawn the other way in the mirrored picture.
    gaps = np.abs(mirrored_places * [1.0, -1.0] - places).max(axis=1)
    assert np.median(gaps) < 0.05
    assert gaps.max() < 0.15
