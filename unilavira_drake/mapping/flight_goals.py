"""Where an aircraft flies for what was marked: never into the thing, never onto the ground.

A mark is a point of a surface.  The aircraft goes

* to a place straight above it at its present height, for what lies lower and has free air above;
* to a place ``stand_off`` before it, for what stands in its way at its height or higher: it rises
  to the height of the mark, it does not sink;
* to ``clearance`` above it, for a mark in the view straight down.

A height that the language model asks for (``climb``) takes the place of these heights, down to
``clearance`` above the mark.  One move is at most ``horizon`` long (the plan horizon of the paper,
section V): a farther goal is cut to it, and so is a mark beyond the depth camera's range, at the
present height.  A mark beyond the range and ``SKY`` above the horizon is sky, which is no target.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.mapping.projection import BEYOND, Projection, project_to_pixel
from unilavira_drake.messages import DOWN, NO_TARGET, Frame, Goal, LanguageAction, Message, Panorama

SKY = math.radians(20.0)
"""Steeper above the horizon and beyond the range there is only sky."""
LOWER = 2.0
"""A mark counts as lower than the aircraft from here on, metres."""
OPEN_SKY = "only open sky there"

Point = tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class FlightGoals(Message):
    """How near an aircraft goes, and how far in one move; metres."""

    stand_off: float = 5.0
    """Along the ground, before what stands in the way."""
    clearance: float = 4.0
    """Above what is below."""
    horizon: float = 40.0
    """Longest way of one move."""


def flight_goal(
    action: LanguageAction,
    projection: Projection,
    frame: Frame,
    panorama: Panorama,
    pixel: tuple[float, float] | None,
    rules: FlightGoals,
) -> Goal:
    """Returns the goal of a ``turn`` in flight.

    Args:
        action: its number and the height that it asks for.
        projection: of the mark in the chosen view.
        frame: the chosen view.
        panorama: tells where the aircraft is.
        pixel: (u, v) that stands for the mark where the projection found no depth; None: no mark.
        rules: how near and how far.
    """
    here = panorama.position
    if projection.p_WG is None:
        if projection.reason != BEYOND or pixel is None:
            return Goal(action.n, "none", reason=f"{NO_TARGET}: {projection.reason}")
        return _far(action, frame, pixel, here, rules)
    mark = projection.p_WG
    if frame.view == DOWN:
        place = (mark[0], mark[1], mark[2] + rules.clearance)
    else:
        place = _beside(mark, frame, here, rules)
    if action.climb is not None:
        floor = mark[2] + rules.clearance if mark[2] < here[2] else -math.inf
        place = (place[0], place[1], max(here[2] + action.climb, min(floor, here[2])))
    p_WG, partial = _cut(here, place, rules.horizon)
    return Goal(action.n, "go", p_WG, pixel=projection.pixel, p_WT=mark, partial=partial)


def flown_goal(action: LanguageAction, panorama: Panorama, rules: FlightGoals) -> Goal:
    """Returns the goal of ``fly``: by its numbers, without a mark."""
    x, y, z = panorama.position
    angle = panorama.yaw + math.radians(action.bearing)
    away = action.distance
    place = (x + away * math.cos(angle), y + away * math.sin(angle), z + (action.climb or 0.0))
    p_WG, partial = _cut((x, y, z), place, rules.horizon)
    return Goal(action.n, "go", p_WG, partial=partial)


def _beside(mark: Point, frame: Frame, here: Point, rules: FlightGoals) -> Point:
    """Returns the place above or before a mark, at the present height or higher."""
    above = (mark[0], mark[1], here[2])
    if here[2] - mark[2] >= LOWER and _is_open(above, frame, rules.stand_off):
        return above
    dx, dy = mark[0] - here[0], mark[1] - here[1]
    away = math.hypot(dx, dy)
    share = max(away - rules.stand_off, 0.0) / away if away > 0.0 else 0.0
    return (here[0] + share * dx, here[1] + share * dy, max(here[2], mark[2]))


def _is_open(p_W: Point, frame: Frame, margin: float) -> bool:
    """Whether a view shows nothing at a place and for a margin behind it."""
    u, v, depth = project_to_pixel(p_W, intrinsics=frame.intrinsics, X_WC=frame.X_WC)
    rows, columns = frame.depth.shape
    if not (depth > 0.0 and -0.5 <= u <= columns - 0.5 and -0.5 <= v <= rows - 0.5):
        return False
    column, row = min(max(round(u), 0), columns - 1), min(max(round(v), 0), rows - 1)
    return bool(frame.depth[row, column] > depth + margin)


def _far(
    action: LanguageAction,
    frame: Frame,
    pixel: tuple[float, float],
    here: Point,
    rules: FlightGoals,
) -> Goal:
    """Returns the goal towards a mark beyond the depth camera's range."""
    ray = _ray(frame, pixel)
    if ray[2] > math.sin(SKY):
        return Goal(action.n, "none", reason=f"{NO_TARGET}: {OPEN_SKY}")
    if frame.view == DOWN:
        step = ray * rules.horizon
    else:
        level = math.hypot(ray[0], ray[1])
        step = np.array([ray[0], ray[1], 0.0]) / level * rules.horizon
    climb = float(step[2]) if action.climb is None else action.climb
    place = (here[0] + float(step[0]), here[1] + float(step[1]), here[2] + climb)
    p_WG, _ = _cut(here, place, rules.horizon)
    return Goal(action.n, "go", p_WG, pixel=pixel, partial=True)


def _ray(frame: Frame, pixel: tuple[float, float]) -> NDArray[np.float64]:
    """Returns the unit vector in the world from the camera through a pixel."""
    k = frame.intrinsics
    p_C = np.array([(pixel[0] - k.cx) / k.fx, (pixel[1] - k.cy) / k.fy, 1.0])
    ray: NDArray[np.float64] = frame.X_WC[:3, :3] @ (p_C / np.linalg.norm(p_C))
    return ray


def _cut(here: Point, place: Point, horizon: float) -> tuple[Point, bool]:
    """Returns a place, or how far one move goes towards it, and whether that is short of it."""
    away = math.dist(here, place)
    if away <= horizon:
        return place, False
    share = horizon / away
    x, y, z = (a + share * (b - a) for a, b in zip(here, place, strict=True))
    return (x, y, z), True
