"""The way back of a stuck aircraft as a function of where it flew."""

import math

import numpy as np
import pytest

from unilavira_drake.messages import Path
from unilavira_drake.planning.flight_recovery import came_by, way_back

TOLERANCE = 0.2


def flown(*turns: float) -> np.ndarray:
    """Returns the way back after a flight along x through these places, by steps of 5 cm."""
    came, x = (), 0.0
    for turn in (0.0, *turns):
        for place in np.linspace(x, turn, 1 + round(abs(turn - x) / 0.05)).tolist():
            came = came_by(came, (place, 0.0, 1.0), TOLERANCE)
        x = turn
    path = way_back(Path(3, 5, np.zeros((2, 3))), came, (x, 0.0, 1.0))
    assert (path.n, path.version, path.backwards) == (3, 6, True)
    np.testing.assert_array_equal(path.p_WP[0], (x, 0.0, 1.0))
    return path.p_WP[:, 0]


def test_after_a_straight_flight_it_goes_back_six_tolerances():
    back = flown(5.0)
    assert (np.diff(back) < 0.0).all()
    assert back[0] - back[-1] == pytest.approx(6 * TOLERANCE, abs=TOLERANCE)


@pytest.mark.parametrize(("turn", "stuck"), [(0.5, 0.1), (1.0, 0.65)])
def test_who_has_turned_about_goes_back_to_the_turn(turn, stuck):
    back = flown(turn, stuck)
    assert (np.diff(back) > 0.0).all()
    assert back[-1] == pytest.approx(turn, abs=TOLERANCE)


def test_wavering_forgets_no_way():
    came = came_by(came_by((), (0.0, 0.0, 1.0), TOLERANCE), (0.5, 0.0, 1.0), TOLERANCE)
    for k in range(100):
        came = came_by(came, (0.5, 0.15 * math.sin(k), 1.0), TOLERANCE)
    assert came == ((0.5, 0.0, 1.0), (0.0, 0.0, 1.0))


def test_who_came_from_nowhere_stays():
    np.testing.assert_array_equal(way_back(Path(), (), (1.0, 2.0, 3.0)).p_WP, [(1.0, 2.0, 3.0)])
