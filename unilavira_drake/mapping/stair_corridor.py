"""Stairs under way: a corridor of free cells, where only what stands on the steps is an obstacle.

A map's heights count from the floor, and to them every step is an obstacle.  While the robot takes
stairs, readings are therefore judged against the slope on which it is; what lies beside the stairs
is left to the panoramas that are taken on level floor.
"""

from __future__ import annotations

import dataclasses as dc
import math

import numpy as np

from unilavira_drake.mapping.depth_scan import FREE_STEP
from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.messages import Goal, Message, OccupancyMap
from unilavira_drake.messages.cell_tiles import TILE

BEFORE = 0.9
"""The corridor begins so far before the first step, metres."""
ASIDE = 0.6
"""Who is farther than this from the stairs' axis is not on them, metres."""
AHEAD = 1.5
"""Obstacles and free cells are looked at so far ahead, metres."""
BEHIND = 0.6
"""Cells so far behind the robot are free, metres."""
USUAL_SLOPE = 0.7
"""Rise over run, unless the robot's own way was steeper."""
KNOWN_AFTER = 0.8
"""The robot's way tells the slope after so much of it, metres."""
STEP = 0.4
"""What stands less high over the slope is a step, metres."""
RISEN = 2.0
"""A storey is higher than this and a landing halfway lower, metres."""
LEVEL_AGAIN = 0.3
"""There the stairs are over after so much of level floor, metres."""
TALLEST = 1.4
"""What is higher above the feet is passed under, metres."""


@dc.dataclass(frozen=True)
class StairCorridor(Message):
    """The strip of stairs around a robot."""

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the robot's feet, metres in the world."""
    axis: tuple[float, float] = (0.0, 0.0)
    """A point of the stairs' axis, metres."""
    heading: float = 0.0
    """Yaw of the way over the stairs, radians."""
    slope: float = 0.0
    """Rise over run ahead; 0 where the way leads down: steps fall away from the feet."""
    half_width: float = 0.36
    """Metres."""

    def seen(self, view: DepthView) -> DepthView:
        """Returns a view with nothing but what stands in the corridor ahead."""
        depth = np.asarray(view.depth, np.float64)
        lens, (rows, columns) = view.intrinsics, depth.shape
        valid = (depth > 0.0) & np.isfinite(depth)
        d = np.where(valid, depth, 0.0)
        x = (np.arange(columns)[None, :] - lens.cx) / lens.fx * d
        y = (np.arange(rows)[:, None] - lens.cy) / lens.fy * d
        X = view.X_WC
        p = [X[i, 0] * x + X[i, 1] * y + X[i, 2] * d + X[i, 3] for i in range(3)]
        c, s = math.cos(self.heading), math.sin(self.heading)
        ahead = c * (p[0] - self.position[0]) + s * (p[1] - self.position[1])
        aside = c * (p[1] - self.axis[1]) - s * (p[0] - self.axis[0])
        height = p[2] - self.position[2]
        stands = valid & (ahead > 0.0) & (ahead <= AHEAD) & (np.abs(aside) <= self.half_width)
        stands &= (height >= STEP + self.slope * ahead) & (height <= TALLEST)
        kept = np.where(stands, view.depth, np.float32(0.0)).astype(np.float32)
        return dc.replace(view, depth=kept)

    def freed(self, occupancy: OccupancyMap) -> OccupancyMap:
        """Returns a map where the corridor around the robot is free floor."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        resolution = occupancy.resolution
        reach = math.hypot(AHEAD, self.half_width)
        low = [math.floor((self.position[k] - reach) / resolution) for k in (1, 0)]
        high = [math.ceil((self.position[k] + reach) / resolution) for k in (1, 0)]
        first = [index // TILE for index in low]
        last = [index // TILE for index in high]
        changed = {}
        for a in range(first[0], last[0] + 1):
            for b in range(first[1], last[1] + 1):
                tile = occupancy.cells.window(
                    (a * TILE, b * TILE), ((a + 1) * TILE, (b + 1) * TILE)
                )
                y = (a * TILE + np.arange(TILE)[:, None] + 0.5) * resolution
                x = (b * TILE + np.arange(TILE)[None, :] + 0.5) * resolution
                ahead = c * (x - self.position[0]) + s * (y - self.position[1])
                aside = c * (y - self.axis[1]) - s * (x - self.axis[0])
                inside = (ahead >= -BEHIND) & (ahead <= AHEAD) & (np.abs(aside) <= self.half_width)
                if (tile[inside] > -FREE_STEP).any():
                    tile[inside] = np.minimum(tile[inside], -FREE_STEP)
                    tile.flags.writeable = False
                    changed[a, b] = tile
        cells = occupancy.cells
        frame = {"first": cells.first, "shape": cells.shape}
        return OccupancyMap(
            n=occupancy.n,
            version=occupancy.version,
            time=occupancy.time,
            resolution=resolution,
            origin=occupancy.origin,
            cells=cells.updated(changed, **frame),
            rejected=occupancy.rejected,
        )


def corridor_at(
    goal: Goal, place: tuple[float, float, float], *, half_width: float, level: float = 0.0
) -> StairCorridor | None:
    """Returns the corridor of a goal over stairs, or None where the robot is not on them.

    Args:
        goal: ``climb`` or ``descend``.
        place: of the robot's feet, metres in the world.
        half_width: of the corridor, metres.
        level: way on level floor that lies behind the robot, metres.
    """
    if goal.p_WG is None or goal.heading is None or not all(map(math.isfinite, place)):
        return None
    dx, dy = place[0] - goal.p_WG[0], place[1] - goal.p_WG[1]
    c, s = math.cos(goal.heading), math.sin(goal.heading)
    along, aside = c * dx + s * dy, c * dy - s * dx
    if along < -BEFORE or abs(aside) > ASIDE:
        return None
    rise = place[2] - goal.p_WG[2]
    if abs(rise) >= RISEN and level >= LEVEL_AGAIN:
        return None
    slope = 0.0
    if goal.kind == "climb":
        # Behind a landing it goes on as steeply as before.
        slope = max(USUAL_SLOPE, rise / along if along > KNOWN_AFTER else 0.0)
    return StairCorridor(place, goal.p_WG[:2], goal.heading, slope, half_width)
