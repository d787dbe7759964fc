"""The layers of ``map.png``, each drawn onto matplotlib axes in metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import OccupancyMap
from unilavira_drake.recording.floor_plan import FloorPlan
from unilavira_drake.recording.occupancy_picture import FREE, OCCUPIED, UNKNOWN, grey_levels
from unilavira_drake.recording.plan_labels import Label
from unilavira_drake.recording.polylines import beside, dashes, without
from unilavira_drake.recording.polylines import stretch as part_of
from unilavira_drake.recording.trace import EpisodeTrace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection

ROOM_FONT, THING_FONT = 7.5, 4.6
"""Points."""

# Told apart by people who see colours differently (Okabe and Ito's palette).
START, END, GOAL = "#009e73", "#d55e00", "#b0206c"

_GREYS = {UNKNOWN: 0.90, FREE: 1.0, OCCUPIED: 0.62}
_WALL, _THING, _SLIGHT = "0.18", "#7a5230", "#c9b8a8"
_WAY_WIDTH = 2.2
_ELSEWHERE = "0.55"
_SCALES = (1, 2, 5, 10, 20, 50, 100)
"""Metres."""
# All marks below are in points too: they keep their size in a larger world.
_LANE = 4.0
"""Between a leg that was driven back and the way there."""
_DASH, _GAP = 5.5, 3.3
_WAYPOINT = 5.8
"""Radius of a waypoint's disc."""
_ARROW = ((17.0, 0.0), (-10.0, 10.5), (-4.5, 0.0), (-10.0, -10.5))
"""Corners of an arrow around a waypoint, along x."""
ARROW_REACH = _ARROW[0][0]
"""From the middle of an arrow to its tip."""
_RING = 8.0
"""Radius of the goal's ring."""


def draw_rooms(axes: Axes, plan: FloorPlan) -> None:
    """Draws the floors, as unknown as they are until they are mapped."""
    from matplotlib.patches import Rectangle

    for room in plan.rooms:
        x_min, y_min, x_max, y_max = room.rectangle
        axes.add_patch(
            Rectangle(
                (x_min, y_min),
                x_max - x_min,
                y_max - y_min,
                color=str(_GREYS[UNKNOWN]),
                linewidth=0,
                zorder=0,
            )
        )


def draw_occupancy(axes: Axes, occupancy: OccupancyMap) -> None:
    """Draws what was mapped: white is free, dark is occupied, unknown is left as it is."""
    levels = grey_levels(occupancy)
    grey = np.select([levels == level for level in _GREYS], list(_GREYS.values()))
    known = levels != UNKNOWN
    (x, y), (rows, columns), side = occupancy.origin, occupancy.shape, occupancy.resolution
    axes.imshow(
        np.dstack([grey, grey, grey, known.astype(float)]),
        origin="lower",
        extent=(x, x + columns * side, y, y + rows * side),
        interpolation="nearest",
        zorder=1,
        aspect="auto",
    )


def draw_plan(axes: Axes, plan: FloorPlan) -> None:
    """Draws walls, doorways and the outlines of things."""
    from matplotlib.collections import PolyCollection

    def add(outlines: Sequence[NDArray[np.float64]], **style: Any) -> None:
        axes.add_collection(PolyCollection(list(outlines), **style), autolim=False)

    add(plan.walls, facecolors=_WALL, edgecolors=_WALL, linewidths=0.3, zorder=4)
    add(
        plan.openings,
        facecolors="white",
        edgecolors="0.55",
        linewidths=0.5,
        linestyles=[(0, (2, 1.5))],
        zorder=2,
    )
    for slight, color in ((False, _THING), (True, _SLIGHT)):
        outlines = [
            outline for thing in plan.things if thing.slight == slight for outline in thing.outlines
        ]
        add(outlines, facecolors="none", edgecolors=color, linewidths=0.5, zorder=3)


def draw_words(axes: Axes, labels: Sequence[Label], points: float, *, bold: bool = False) -> None:
    """Writes labels: names of rooms bold and grey, categories small and brown."""
    from matplotlib import patheffects

    for label in labels:
        text = axes.text(
            label.x,
            label.y,
            label.text,
            ha="center",
            va="center",
            rotation=90 if label.upright else 0,
            fontsize=points,
            fontweight="bold" if bold else "normal",
            color="0.35" if bold else _THING,
            linespacing=1.0,
            parse_math=False,
            zorder=5,
        )
        halo = patheffects.withStroke(linewidth=1.4, foreground="white", alpha=0.8)
        text.set_path_effects([halo])


def draw_goal(
    axes: Axes,
    goals: tuple[tuple[float, float], ...],
    area: tuple[NDArray[np.float64], ...],
    point: float,
) -> None:
    """Draws a ring at each goal, and the floor on which a stop succeeds.

    Args:
        axes: in metres.
        goals: metres in the world.
        area: outlines, metres in the world.
        point: metres that a point of print covers.
    """
    from matplotlib.patches import Circle, Polygon

    for index, outline in enumerate(area):
        label = "success area" if index == 0 else "_"
        for fill, alpha in ((True, 0.10), (False, 1.0)):
            axes.add_patch(
                Polygon(
                    outline,
                    fill=fill,
                    facecolor=GOAL,
                    edgecolor=GOAL,
                    alpha=alpha,
                    linewidth=0 if fill else 0.8,
                    linestyle=(0, (4, 2)),
                    label="_" if fill else label,
                    zorder=3.5,
                )
            )
    for x, y in goals:
        axes.add_patch(
            Circle((x, y), _RING * point, fill=False, edgecolor="white", linewidth=3, zorder=8)
        )
        axes.add_patch(
            Circle((x, y), _RING * point, fill=False, edgecolor=GOAL, linewidth=1.6, zorder=8)
        )
        axes.add_patch(Circle((x, y), 2.2 * point, facecolor=GOAL, edgecolor="white", zorder=8))
    if goals:
        ring: dict[str, Any] = {
            "markerfacecolor": "none",
            "markeredgecolor": GOAL,
            "markeredgewidth": 1.5,
        }
        axes.plot([], [], "o", label="goal", markersize=6, **ring)


def draw_way(axes: Axes, trace: EpisodeTrace, point: float) -> LineCollection | None:
    """Draws the way coloured by time and returns what a colour bar needs, if there is a way."""
    points = trace.points
    if len(points) < 2:
        return None
    pieces = list(without(points, (*trace.backtracks, *trace.away)))
    away = [part_of(points, begin, end) for begin, end in trace.away if begin < end]
    if away:
        _lines(axes, away, 0.5 * _WAY_WIDTH, color=_ELSEWHERE, zorder=5.5)
        axes.plot([], [], color=_ELSEWHERE, linewidth=0.5 * _WAY_WIDTH, label="on another floor")
    back = [part_of(points, begin, end) for begin, end in trace.backtracks]
    broken = [
        dash
        for leg in back
        for dash in dashes(beside(leg, _LANE * point), _DASH * point, _GAP * point)
    ]
    colored = None
    for pieces_of, width in ((pieces, _WAY_WIDTH), (broken, 0.9 * _WAY_WIDTH)):
        if not pieces_of:
            continue
        _lines(axes, pieces_of, width + 1.6, color="white", zorder=6)
        colored = _lines(axes, pieces_of, width, cmap="viridis", zorder=6.5)
        colored.set_clim(float(points[0, 0]), float(points[-1, 0]))
    middle = "#21918c"
    axes.plot([], [], "-", color=middle, linewidth=_WAY_WIDTH, label="way")
    if broken:
        style = (0, (2.2, 1.3))
        axes.plot([], [], color=middle, linewidth=2, linestyle=style, label="drove back")
    return colored


def draw_places(axes: Axes, trace: EpisodeTrace, point: float) -> None:
    """Draws the points that the agent aimed at, the numbered waypoints, start and end."""
    if trace.goals:
        aims = np.array(trace.goals)
        axes.plot(
            *aims.T, "x", color="0.1", markersize=3.5, markeredgewidth=0.8, zorder=7, label="aim"
        )
    first, last = trace.ends
    if trace.waypoints:
        disc: dict[str, Any] = {"color": "white", "markeredgecolor": "0.1", "markeredgewidth": 0.8}
        axes.plot([], [], "o", markersize=6, label="waypoint", **disc)
    for name, place, color in (("start", first, START), ("end", last, END)):
        if place is not None:
            _arrow(axes, place, color, point)
            axes.plot([], [], ">", color=color, markersize=5.5, label=name)
    for waypoint, (x, y) in sorted(trace.waypoints.items()):
        _waypoint(axes, x, y, str(waypoint), point)


def draw_scale(axes: Axes, plan: FloorPlan, inches_per_metre: float) -> None:
    """Draws a bar below the plan, of up to a fifth of its width."""
    x_min, y_min, x_max, _ = plan.bounds
    metres = max(m for m in _SCALES if m == 1 or m <= 0.2 * (x_max - x_min))
    x, y = x_min + 0.3, y_min - 0.14 / inches_per_metre
    style: dict[str, Any] = {
        "color": "0.15",
        "clip_on": False,
        "linewidth": 1.2,
        "solid_capstyle": "butt",
    }
    axes.plot([x, x + metres], [y, y], **style)
    tick = 0.03 / inches_per_metre
    for end in (x, x + metres):
        axes.plot([end, end], [y - tick, y + tick], **style)
    axes.text(x + metres / 2, y - tick * 1.5, f"{metres} m", ha="center", va="top", fontsize=6.5)


def _lines(
    axes: Axes, pieces: Sequence[NDArray[np.float64]], width: float, **style: Any
) -> LineCollection:
    from matplotlib.collections import LineCollection

    segments = [
        np.stack([piece[:-1, 1:], piece[1:, 1:]], axis=1) for piece in pieces if len(piece) > 1
    ]
    lines = LineCollection(
        list(np.concatenate(segments)), linewidths=width, capstyle="round", **style
    )
    if "cmap" in style:
        lines.set_array(np.concatenate([piece[1:, 0] for piece in pieces if len(piece) > 1]))
    axes.add_collection(lines, autolim=False)
    return lines


def _arrow(axes: Axes, place: tuple[float, float, float], color: str, point: float) -> None:
    from matplotlib.patches import Polygon

    x, y, yaw = place
    c, s = math.cos(yaw), math.sin(yaw)
    shape = np.array(_ARROW) * point
    corners = shape @ np.array([[c, s], [-s, c]]) + (x, y)
    axes.add_patch(Polygon(corners, facecolor=color, edgecolor="white", linewidth=0.8, zorder=7.5))


def _waypoint(axes: Axes, x: float, y: float, text: str, point: float) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(
        Circle(
            (x, y), _WAYPOINT * point, facecolor="white", edgecolor="0.1", linewidth=0.8, zorder=9
        )
    )
    size = 5.6 if len(text) < 2 else 4.8
    axes.text(x, y, text, ha="center", va="center_baseline", fontsize=size, zorder=9.5)
