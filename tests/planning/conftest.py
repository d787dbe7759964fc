"""Maps drawn as text: '#' occupied, '.' free, '?' unknown; the first line is the highest y."""

import numpy as np
import pytest

from unilavira_drake.messages import OccupancyMap


def draw_map(text, resolution=0.05, scale=1, origin=(0.0, 0.0), **named):
    values = {"#": 20, ".": -20, "?": 0}
    lines = text.split()[::-1]
    cells = np.array([[values[letter] for letter in line] for line in lines], np.int8)
    cells = np.kron(cells, np.ones((scale, scale), np.int8))
    named = {"n": 1, "version": 1, **named}
    return OccupancyMap(resolution=resolution, origin=origin, log_odds=cells, **named)


@pytest.fixture
def drawn():
    return draw_map
