"""Buildings and shapes: closed from outside, and within what a robot collides with."""

import dataclasses as dc
import math

import numpy as np
import pytest

from unilavira_drake.worlds.outdoors import solids
from unilavira_drake.worlds.outdoors.buildings import ROOF_FORMS, building_boxes, building_quads
from unilavira_drake.worlds.outdoors.shapes import SHAPES, exterior_quads, shape_boxes
from unilavira_drake.worlds.outdoors.things import Building, Exterior

EAVES = 0.9
"""By which a mesh may stand out of its boxes, metres."""


def volume(quads):
    """The enclosed volume of outward faces; positive where they look outward."""
    a, b, c, d = (quads[:, i] for i in range(4))
    first = np.einsum("ij,ij->i", a, np.cross(b, c))
    second = np.einsum("ij,ij->i", a, np.cross(c, d))
    return float((first + second).sum() / 6.0)


def reach(boxes):
    corners = np.array(
        [
            (*corner, box.center[2] + sign * box.size[2] / 2)
            for box in boxes
            for corner in box.corners()
            for sign in (-1, 1)
        ]
    )
    return corners.min(axis=0), corners.max(axis=0)


def test_a_box_and_a_ball_look_outward():
    assert volume(solids.box((1, 2, 3), (2, 3, 4))) == pytest.approx(24.0)
    ball = solids.blob((0, 0, 0), (1, 1, 1), np.random.default_rng(0))
    assert 1.5 < volume(ball) < 4.2


def test_a_prism_without_its_underside_looks_outward():
    prism = solids.prism((0, 0, 0), (1.0, 1.0), 2.0, 64)
    assert volume(prism) == pytest.approx(2 * math.pi, rel=0.01)
    cone = solids.prism((0, 0, 0), (1.0, 0.0), 3.0, 64)
    assert volume(cone) == pytest.approx(math.pi, rel=0.01)


def test_roofs_look_outward():
    slopes, ends = solids.gable((0, 0, 0), (4.0, 6.0, 2.0))
    assert volume(np.concatenate((slopes, ends))) == pytest.approx(4 * 6 * 2 / 2)
    assert volume(solids.pyramid((0, 0, 0), (4.0, 6.0, 3.0))) == pytest.approx(24.0)


@pytest.mark.parametrize("mirrored", [False, True])
def test_moving_keeps_faces_outward(mirrored):
    box = solids.box((1, 2, 0), (2, 3, 4))
    placed = solids.moved(box, (10.0, -4.0, 2.0, 0.7), mirrored=mirrored)
    middle = placed.reshape(-1, 3).mean(axis=0)
    assert volume(placed - middle) == pytest.approx(24.0)
    sign = -1.0 if mirrored else 1.0
    c, s = math.cos(0.7), math.sin(0.7)
    expected = (10 + c * 1 - s * sign * 2, -4 + s * 1 + c * sign * 2, 2.0)
    assert middle == pytest.approx(expected)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_lies_in_its_boxes(shape):
    place = (5.0, -3.0, 0.0, 0.0)
    mesh = exterior_quads(Exterior(shape, "", (place,), 3))
    corners = mesh.corners.reshape(-1, 3)
    low, high = reach(shape_boxes(shape, place))
    assert (corners.min(axis=0) >= low - EAVES).all()
    assert (corners.max(axis=0) <= high + EAVES + 0.1 * (high - low)).all()
    assert mesh.triangles <= 400


def test_a_row_is_the_same_shape_several_times():
    one = exterior_quads(Exterior("car", "red", ((0.0, 0.0, 0.0, 0.0),)))
    row = exterior_quads(Exterior("car", "red", tuple((4.0 * i, 0.0, 0.0, 0.0) for i in range(5))))
    assert row.triangles == 5 * one.triangles
    assert np.allclose(row.corners[-1], one.corners[-1] + [16.0, 0.0, 0.0])


@pytest.mark.parametrize("roof", ROOF_FORMS)
@pytest.mark.parametrize("yaw", [0.0, math.pi / 2])
def test_a_building_lies_in_its_boxes(roof, yaw):
    building = Building((3.0, 4.0, 0.0, yaw), (10.0, 16.0), 6.2, roof=roof, chimneys=1)
    corners = np.concatenate([part.corners for part in building_quads(building)]).reshape(-1, 3)
    low, high = reach(building_boxes(building))
    over = np.array([EAVES, EAVES, 1.5])
    assert (corners.min(axis=0) >= low - over).all()
    assert (corners.max(axis=0) <= high + over).all()
    assert corners[:, 2].max() >= 6.2


def test_a_tower_stands_in_front_and_is_solid():
    building = Building(size=(20.0, 10.0), height=8.0, roof="nave", tower=(4.0, 20.0))
    _, high = reach(building_boxes(building))
    corners = np.concatenate([part.corners for part in building_quads(building)]).reshape(-1, 3)
    assert high[2] == pytest.approx(corners[:, 2].max())
    tip = corners[corners[:, 2].argmax()]
    assert tip[0] > 10.0
    assert abs(tip[1]) < 1e-9


def test_words_over_a_door_can_be_read_in_a_mirrored_world():
    building = Building((0.0, 0.0, 0.0, 0.3), sign="BANK")
    sign = building_quads(building)[1]
    mirror = dc.replace(building, place=(0.0, 0.0, 0.0, -0.3), mirrored=True)
    other = building_quads(mirror)[1]
    assert np.array_equal(sign.image, other.image)
    assert np.array_equal(sign.uv, other.uv)
    # From outside, the words run from left to right.
    for quads in (sign.corners, other.corners):
        a, b, c, _ = quads[0]
        normal = np.cross(b - a, c - a)
        assert normal @ a > 0.0
