"""Heights count from the floor under the robot: slopes, ramps and what hangs above."""

import math

import numpy as np
import pytest

from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.occupancy import MappingParameters, integrate
from unilavira_drake.messages import Intrinsics, OccupancyMap


def build(views, position=(0.0, 0.0), floor_height=0.0, **named):
    return integrate(
        OccupancyMap(), views, parameters=MappingParameters(), position=position,
        floor_height=floor_height, n=1, time=0.0, **named,
    )  # fmt: skip


def centers(occupancy, mask):
    rows, columns = np.nonzero(mask)
    r = occupancy.resolution
    return occupancy.origin[0] + (columns + 0.5) * r, occupancy.origin[1] + (rows + 0.5) * r


def on_a_slope(look, ray_cast, angle, x, **named):
    """A pose and the depth image of a robot on a plane that rises along x, and the plane's up."""
    c, s = math.cos(angle), math.sin(angle)
    R_WP = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    depth = ray_cast(look(0.0, 0.0), hall=(-40, -40, 40, 40), ceiling=30.0, **named)
    X_PC = look(0.0, 0.0)
    X_WC = np.eye(4)
    X_WC[:3, :3] = R_WP @ X_PC[:3, :3]
    X_WC[:3, 3] = R_WP @ X_PC[:3, 3] + (x, 0.0, x * math.tan(angle))
    return depth, X_WC, tuple(R_WP[:, 2].tolist())


@pytest.mark.parametrize("angle", [-0.2, -0.083, 0.083, 0.2])
def test_a_slope_is_floor_to_a_robot_on_it(look, ray_cast, intrinsics, angle):
    crate = (2.0, -0.3, 0.0, 2.4, 0.3, 0.6)
    depth, X_WC, up = on_a_slope(look, ray_cast, angle, 7.0, boxes=(crate,))
    named = {"position": (7.0, 0.0), "floor_height": 7.0 * math.tan(angle)}
    occupancy = build([DepthView(depth, intrinsics, X_WC)], up=up, **named)
    x, y = centers(occupancy, occupancy.log_odds > 0)
    # Seen from above the crate leans with the slope.
    assert 8.8 < x.min() <= x.max() < 9.6
    assert np.abs(y).max() <= 0.35
    x, y = centers(occupancy, occupancy.log_odds < 0)
    assert x[np.abs(y - 1.0) < 0.2].max() > 7.0 + 2.0
    # To one who takes the slope for level ground the same readings are a wall, or a drop.
    level = build([DepthView(depth, intrinsics, X_WC)], **named)
    x, y = centers(level, level.log_odds > 0)
    assert np.sum(np.abs(y) > 0.5) > 20


def ramp_ahead(X_WC, intrinsics, foot, angle):
    """The exact depth of level floor that rises from x = foot on; the walls are far away."""
    v, u = np.mgrid[: intrinsics.height, : intrinsics.width]
    beams = np.stack(
        ((u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy, u**0.0), -1
    )
    rays, p = beams @ X_WC[:3, :3].T, X_WC[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = np.where(rays[..., 2] < 0, -p[2] / rays[..., 2], np.inf)
        rise = rays[..., 2] - math.tan(angle) * rays[..., 0]
        d = (math.tan(angle) * (p[0] - foot) - p[2]) / rise
        slope = np.where((rise < 0) & (d > 0), d, np.inf)
    on_slope = np.where(np.isfinite(slope), p[0] + slope * rays[..., 0] >= foot, False)
    on_flat = np.where(np.isfinite(flat), p[0] + flat * rays[..., 0] < foot, False)
    return np.where(on_flat, flat, np.where(on_slope, slope, np.inf)).astype(np.float32)


def test_a_wheelchair_ramp_can_be_entered_and_a_steep_one_is_a_wall(look):
    X_WC = look(0.0, 0.0, pitch=0.15)
    intrinsics = Intrinsics(640, 480, 388.0, 388.0, 319.5, 239.5)
    for angle, room in ((math.atan(1 / 12), 1.2), (math.atan(1 / 3), 0.3)):
        depth = ramp_ahead(X_WC, intrinsics, 1.5, angle)
        occupancy = build([DepthView(depth, intrinsics, X_WC)])
        x, y = centers(occupancy, occupancy.log_odds > 0)
        # Floor for min_height / tan(angle), an obstacle from there on.
        assert x[np.abs(y) < 0.5].min() == pytest.approx(1.5 + room, abs=0.08)


def test_what_hangs_over_the_robot_is_passed_under(look, ray_cast, intrinsics):
    X_WC = look(0, 0)
    for bottom, blocked in ((1.5, False), (1.2, True)):
        beam = (1.5, -1.5, bottom, 1.7, 3.0, 2.6)
        occupancy = build([DepthView(ray_cast(X_WC, (beam,)), intrinsics, X_WC)])
        assert occupancy.state_at(1.52, 0.02) == ("occupied" if blocked else "free")
        # The floor beyond is seen below the beam; behind an obstacle nothing is believed.
        assert (occupancy.state_at(3.0, 0.0) == "free") != blocked
    # The robot's floor counts, not the world's.
    raised = look(0, 0, z=0.88 + 3.0)
    depth = ray_cast(X_WC, ((1.5, -1.5, 1.5, 1.7, 3.0, 2.6),))
    occupancy = build([DepthView(depth, intrinsics, raised)], floor_height=3.0)
    assert occupancy.state_at(1.62, 0.02) == "free"
