"""``map.png``: the true world, what the robot mapped of it, and the way it went."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import OccupancyMap, VoxelMap
from unilavira_drake.recording import map_layers
from unilavira_drake.recording.floor_plan import FloorPlan, floor_plan
from unilavira_drake.recording.plan_labels import Lettering, Rectangle, room_labels, thing_labels
from unilavira_drake.recording.trace import EpisodeTrace
from unilavira_drake.recording.voxel_picture import top_view
from unilavira_drake.worlds.world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

_DPI = 200
_WIDTH = 7.2
"""Inches: two columns of a paper."""
_TALLEST = 8.0
"""Inches of plan; a world that is higher than wide gets a narrower one."""
_BAR = 0.75
"""Inches to the right of the plan, for the colour bar."""
_LEGEND = 0.5
"""Inches below the plan, for scale bar and legend."""
_EDGE = 0.1
"""Inches around everything."""
_TITLE_LINE = 0.17
"""Inches."""
_MARK = 9.0
"""Points that a waypoint or a goal's ring reaches."""
_LETTER, _BOLD_LETTER = 0.58, 0.70
"""Mean width of a letter of the font, in letter heights."""


def map_picture(
    world: World,
    trace: EpisodeTrace,
    occupancy: OccupancyMap | VoxelMap | None = None,
    *,
    goals: tuple[tuple[float, float], ...] = (),
    goal_area: tuple[NDArray[np.float64], ...] = (),
    title: str = "",
) -> bytes:
    """Returns the picture of an episode as PNG, 1440 pixels wide, for a page or a paper.

    Lines are the true rooms and furniture, the grey under them is what the robot mapped.  The
    way is coloured by simulated time, dashed and a little to its left where the robot drove back
    to a waypoint; start and end have an arrow along the front of the first and last panorama.

    Args:
        world: the true world.
        trace: the way.
        occupancy: what was mapped; voxels are drawn as seen from above.
        goals: where the task's goal lies, metres in the world; none when it is not scored.
        goal_area: outlines, (k, 2) metres in the world, of the floor on which a stop succeeds.
        title: above the picture, wrapped.
    """
    plan = floor_plan(world)
    lines = textwrap.wrap(" ".join(title.split()), 100, max_lines=4, placeholder=" …")
    figure, axes, scale = _canvas(plan, len(lines))
    point = 1.0 / 72.0 / scale
    _write_title(figure, lines)
    map_layers.draw_rooms(axes, plan)
    if isinstance(occupancy, VoxelMap):
        occupancy = top_view(occupancy)
    if occupancy is not None:
        map_layers.draw_occupancy(axes, occupancy)
    map_layers.draw_plan(axes, plan)
    _write_names(axes, plan, scale, trace, goals)
    map_layers.draw_goal(axes, goals, goal_area, point)
    colors = map_layers.draw_way(axes, trace, point)
    map_layers.draw_places(axes, trace, point)
    map_layers.draw_scale(axes, plan, scale)
    if colors is not None:
        _color_bar(figure, axes, colors)
    _legend(figure, axes)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def stacked(pictures: Sequence[bytes]) -> bytes:
    """Returns pictures of the same width one above the other, the first on top, as PNG.

    One alone is returned as it is.
    """
    if len(pictures) == 1:
        return pictures[0]
    panels = [
        cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR) for picture in pictures
    ]
    _, png = cv2.imencode(".png", np.vstack([panel for panel in panels if panel is not None]))
    return bytes(png)


def _canvas(plan: FloorPlan, title_lines: int) -> tuple[Figure, Axes, float]:
    """Returns a figure around a plan at one scale (inches per metre), without ticks."""
    # Half a second to import, and only this picture needs it.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    x_min, y_min, x_max, y_max = plan.bounds
    scale = min((_WIDTH - _BAR - 2 * _EDGE) / (x_max - x_min), _TALLEST / (y_max - y_min))
    wide, tall = scale * (x_max - x_min), scale * (y_max - y_min)
    above = _EDGE + (_TITLE_LINE * title_lines + 0.06 if title_lines else 0.0)
    width, height = _WIDTH, tall + above + _LEGEND
    figure = Figure(figsize=(width, height), dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    left = (width - _BAR - wide) / 2
    axes = figure.add_axes((left / width, _LEGEND / height, wide / width, tall / height))
    axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max))
    axes.set_axis_off()
    return figure, axes, scale


def _write_title(figure: Figure, lines: list[str]) -> None:
    figure.text(
        _EDGE / figure.get_figwidth(),
        1.0 - _EDGE / figure.get_figheight(),
        "\n".join(lines),
        ha="left",
        va="top",
        fontsize=8.5,
        parse_math=False,
    )


def _write_names(
    axes: Axes,
    plan: FloorPlan,
    scale: float,
    trace: EpisodeTrace,
    goals: tuple[tuple[float, float], ...],
) -> None:
    """Writes names of rooms, then those of things that hide neither these nor marks."""
    marks = [
        mark
        for places, points in (
            (trace.waypoints.values(), _MARK),
            (goals, _MARK),
            ([end[:2] for end in trace.ends if end is not None], map_layers.ARROW_REACH),
        )
        for mark in _squares(places, points / 72.0 / scale)
    ]
    rooms = room_labels(
        plan, _lettering(map_layers.ROOM_FONT, scale, _BOLD_LETTER), trace.points[:, 1:], marks
    )
    taken = [rectangle for _, rectangle in rooms] + marks
    map_layers.draw_words(axes, [label for label, _ in rooms], map_layers.ROOM_FONT, bold=True)
    words = thing_labels(plan, _lettering(map_layers.THING_FONT, scale), taken)
    map_layers.draw_words(axes, words, map_layers.THING_FONT)


def _squares(places: Iterable[tuple[float, float]], reach: float) -> list[Rectangle]:
    return [(x - reach, y - reach, x + reach, y + reach) for x, y in places]


def _color_bar(figure: Figure, axes: Axes, colors: LineCollection) -> None:
    plan, width = axes.get_position(), figure.get_figwidth()
    left = 1.0 - (_BAR - 0.12) / width
    bar = figure.add_axes((left, plan.y0 + 0.1 * plan.height, 0.11 / width, 0.8 * plan.height))
    figure.colorbar(colors, cax=bar)
    bar.tick_params(labelsize=6.5, length=2)
    bar.set_ylabel("simulated time [s]", fontsize=7)


def _lettering(points: float, scale: float, letter: float = _LETTER) -> Lettering:
    height = points / 72.0 / scale
    return Lettering(height=height, letter_width=letter * height)


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(
            handles,
            labels,
            loc="lower right",
            bbox_to_anchor=(1.0 - _EDGE / _WIDTH, 0.02),
            ncols=len(handles),
            fontsize=6.5,
            frameon=False,
            handlelength=1.6,
            handletextpad=0.5,
            columnspacing=1.1,
        )
