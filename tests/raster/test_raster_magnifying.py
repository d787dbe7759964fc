"""Which surfaces need no smaller sizes of their pictures, against every pixel of the view."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from unilavira_drake.raster.culling import Pinhole
from unilavira_drake.raster.magnifying import facets_of, magnified
from unilavira_drake.raster.pictures import make_texture, only_color
from unilavira_drake.raster.primitives import box, ellipsoid
from unilavira_drake.raster.surface import make_surface

CAMERA = Pinhole(160, 120, 97.0, 99.0, 81.0, 58.0, 0.05, 40.0, 0.1, 10.0)


def picture(width, height):
    pixels = np.zeros((height, width, 4), np.uint8)
    pixels[0, 0] = 255
    return make_texture(pixels, repeats=False)


def floor(size, pixels):
    """Returns a square in the plane z = 0 with its picture."""
    corners = size / 2.0 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], float)
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    normals = np.tile((0.0, 0.0, 1.0), (4, 1))
    return make_surface(corners, normals, triangles, uv=uv, texture=picture(pixels, pixels))


def coarsest(X_CG, size, pixels):
    """Returns the most pixels of the picture on one of the view, by finite differences."""
    u, v = np.meshgrid(np.arange(0.0, 161.0), np.arange(0.0, 121.0))
    rays = np.stack(((u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u)), -1)
    X_GC = X_CG.inverse()
    origin, rays = X_GC.translation(), rays @ X_GC.rotation().matrix().T
    depth = -origin[2] / rays[..., 2]
    p = origin + depth[..., None] * rays
    on = (depth > 0.0) & (np.abs(p[..., :2]) <= size / 2.0).all(axis=-1)
    texel = p[..., :2] / size * pixels
    across = np.linalg.norm(np.diff(texel, axis=1)[:-1], axis=-1)
    down = np.linalg.norm(np.diff(texel, axis=0)[:, :-1], axis=-1)
    on = on[:-1, :-1] & on[1:, :-1] & on[:-1, 1:] & on[1:, 1:]
    return np.maximum(across, down)[on].max() if on.any() else None


@pytest.mark.parametrize("pixels", [32, 64, 128, 256])
def test_no_picture_in_view_is_taken_for_larger_than_it_is(pixels):
    rng = np.random.default_rng(pixels)
    size, found, large = 4.0, 0, 0
    facets = facets_of({0: floor(size, pixels)})
    for _ in range(200):
        R = RollPitchYaw(rng.uniform(-np.pi, np.pi, 3))
        X_CG = RigidTransform(R, rng.uniform((-2, -2, 0.3), (2, 2, 4)))
        truth = coarsest(X_CG, size, pixels)
        rows = X_CG.GetAsMatrix4()[None, :3]
        said = magnified(facets, np.array([0]), rows, np.eye(4), CAMERA)[0]
        if truth is not None:
            # Between the points of the grid a little more than two is let through.
            assert not said or truth <= 3.0
            found, large = found + said, large + (truth <= 1.0)
    assert found >= 0.6 * large


def test_what_is_not_asked_for_or_not_flat_is_not_magnified():
    round_one = ellipsoid(np.ones(3), picture(4, 4))
    facets = facets_of({0: floor(4.0, 8), 1: floor(4.0, 8), 2: round_one, 3: floor(4.0, 8)})
    assert facets.surface.tolist() == [0, 1, 3]
    X_CG = RigidTransform(RollPitchYaw(np.pi, 0, 0), [0, 0, 2.0]).GetAsMatrix4()[:3]
    rows = np.array([X_CG] * 4)
    said = magnified(facets, np.array([1, 2]), rows, np.eye(4), CAMERA)
    assert said.tolist() == [False, True, False, False]
    assert len(facets_of({0: box(np.ones(3), picture(8, 8))}).surface) == 6
    assert len(facets_of({}).surface) == 0
    assert not magnified(facets_of({}), np.array([0]), rows, np.eye(4), CAMERA).any()


def test_a_picture_of_one_colour_is_that_colour():
    pixels = np.full((4, 6, 4), (10, 20, 30, 255), np.uint8)
    np.testing.assert_array_equal(only_color(make_texture(pixels, repeats=True)), pixels[0, 0])
    pixels = pixels.copy()
    pixels[3, 5, 2] = 31
    assert only_color(make_texture(pixels, repeats=True)) is None
