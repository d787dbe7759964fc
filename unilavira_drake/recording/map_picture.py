"""``map.png``: the true world, what the robot mapped of it, and the way it went."""

from __future__ import annotations

import io
import textwrap
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import OccupancyMap
from unilavira_drake.recording.trace import EpisodeTrace
from unilavira_drake.worlds.world import World, WorldObject

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH = 10.0
"""Inches, at ``_DPI``."""
_DPI = 120
_MARGIN = 0.3
"""Metres around the rooms."""
_UNKNOWN, _FREE, _OCCUPIED = 0.92, 1.0, 0.68
"""Grey of the mapped cells."""


def map_picture(
    world: World,
    trace: EpisodeTrace,
    occupancy: OccupancyMap | None = None,
    *,
    goals: tuple[tuple[float, float], ...] = (),
    title: str = "",
) -> bytes:
    """Returns the picture of an episode as PNG.

    Thin lines are the true rooms and furniture, the grey under them is what the robot mapped.
    The way is coloured by simulated time, dashed where the robot drove back to a waypoint.

    Args:
        goals: where the task's goal lies, metres in the world; none when it is not scored.
        title: one line above the picture.
    """
    # Half a second to import, and only this picture needs it.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    x_min, y_min, x_max, y_max = _bounds(world)
    figure = Figure(figsize=(_WIDTH, _WIDTH * (y_max - y_min) / (x_max - x_min) + 1.2), dpi=_DPI)
    figure.set_layout_engine("constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect="equal")
    axes.set_title(textwrap.fill(title, 110, max_lines=4, placeholder=" …"), fontsize=10)
    axes.set(xlabel="x [m]", ylabel="y [m]", facecolor=str(_UNKNOWN))
    if occupancy is not None:
        _draw_occupancy(axes, occupancy)
    _draw_world(axes, world)
    _draw_way(axes, trace)
    _draw_places(axes, trace, goals)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=7, frameon=False)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", bbox_inches="tight", metadata={"Software": None})
    return stream.getvalue()


def _bounds(world: World) -> tuple[float, float, float, float]:
    rectangles = np.array([room.rectangle for room in world.rooms])
    x_min, y_min = rectangles[:, :2].min(axis=0) - _MARGIN
    x_max, y_max = rectangles[:, 2:].max(axis=0) + _MARGIN
    return float(x_min), float(y_min), float(x_max), float(y_max)


def _draw_occupancy(axes: Axes, occupancy: OccupancyMap) -> None:
    grey = np.full(occupancy.shape, _UNKNOWN)
    grey[occupancy.log_odds < 0] = _FREE
    grey[occupancy.log_odds > 0] = _OCCUPIED
    (x, y), (rows, columns), side = occupancy.origin, occupancy.shape, occupancy.resolution
    axes.imshow(
        grey,
        cmap="gray",
        vmin=0.0,
        vmax=1.0,
        origin="lower",
        extent=(x, x + columns * side, y, y + rows * side),
        interpolation="nearest",
        zorder=0,
    )


def _draw_world(axes: Axes, world: World) -> None:
    from matplotlib.patches import Polygon

    for room in world.rooms:
        x_min, _, x_max, y_max = room.rectangle
        axes.text(
            (x_min + x_max) / 2,
            y_max - 0.2,
            room.kind,
            ha="center",
            va="top",
            fontsize=9,
            color="0.45",
            zorder=2,
        )
    outlines = [(np.array(wall.corners()), "0.25") for wall in world.walls]
    labels: list[NDArray[np.float64]] = []
    for thing in world.objects:
        outline = _footprint(thing)
        is_door = thing.category == "door"
        outlines.append((outline, "tab:cyan" if is_door else "tab:brown"))
        if not is_door:
            place = (outline.min(axis=0) + outline.max(axis=0)) / 2
            # What stands on something else is written below it.
            while any(np.all(np.abs(place - other) < (0.6, 0.2)) for other in labels):
                place = place - (0.0, 0.2)
            labels.append(place)
            axes.text(
                place[0],
                place[1],
                thing.name,
                ha="center",
                va="center",
                fontsize=6,
                color="tab:brown",
                zorder=2,
            )
    for corners, color in outlines:
        axes.add_patch(Polygon(corners, fill=False, linewidth=0.6, edgecolor=color, zorder=1))


def _footprint(thing: WorldObject) -> NDArray[np.float64]:
    """The convex outline of a thing on the floor, (k, 2) metres."""
    corners = np.array([corner for box in thing.boxes for corner in box.corners()], np.float32)
    return np.asarray(cv2.convexHull(corners)[:, 0, :], np.float64)


def _draw_way(axes: Axes, trace: EpisodeTrace) -> None:
    from matplotlib.collections import LineCollection

    points = trace.points
    if len(points) < 2:
        return
    segments = np.stack([points[:-1, 1:], points[1:, 1:]], axis=1)
    times = points[1:, 0]
    way = LineCollection(list(segments), cmap="viridis", linewidth=3.5, zorder=4)
    way.set_array(times)
    axes.add_collection(way)
    axes.figure.colorbar(way, ax=axes, label="simulated time [s]", shrink=0.7, pad=0.01)
    axes.plot([], [], linewidth=3.5, color=way.cmap(0.5), label="way")
    # On top of the way there, which it often retraces.
    label = "drove back to a waypoint"
    for begin, end in trace.backtracks:
        back = points[(points[:, 0] >= begin) & (points[:, 0] <= end), 1:]
        axes.plot(*back.T, "--", color="tab:red", linewidth=1.6, zorder=5, label=label)
        label = "_"  # one entry in the legend


def _draw_places(axes: Axes, trace: EpisodeTrace, goals: tuple[tuple[float, float], ...]) -> None:
    points = trace.points
    if trace.goals:
        axes.plot(
            *np.array(trace.goals).T, "+", color="tab:blue", markersize=7, zorder=5, label="aim"
        )
    for index, (waypoint, (x, y)) in enumerate(sorted(trace.waypoints.items())):
        axes.plot(
            x,
            y,
            "o",
            color="white",
            markeredgecolor="black",
            markersize=10,
            zorder=7,
            label="waypoint" if index == 0 else "_",
        )
        axes.text(x, y, str(waypoint), ha="center", va="center", fontsize=7, zorder=8)
    if len(points):
        axes.plot(*points[0, 1:], "s", color="tab:green", markersize=14, zorder=6, label="start")
        axes.plot(*points[-1, 1:], "D", color="tab:red", markersize=12, zorder=6, label="end")
    if goals:
        axes.plot(
            *np.array(goals).T,
            "*",
            color="gold",
            markeredgecolor="black",
            markersize=16,
            linestyle="none",
            zorder=9,
            label="goal",
        )
