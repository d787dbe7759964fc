"""Maps as numbers for SVG: the floor plan once, and what lies over it in each step."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import VIEW_YAW
from unilavira_drake.recording.floor_plan import Outline
from unilavira_drake.recording.plan_labels import Label, Lettering, room_labels, thing_labels
from unilavira_drake.recording.polylines import beside, stretch, without
from unilavira_drake.recording.trace import EpisodeTrace
from unilavira_drake.report.model import RunRecord, Step
from unilavira_drake.report.setting import Setting, Storey
from unilavira_drake.worlds.world import BELOW_FLOOR

WIDTH = 540.0
"""Units across the drawing, whatever the size of the world; about a pixel each."""
ROOM_LETTER, THING_LETTER = 14.0, 9.5
"""Font sizes, units."""
_COLORS = 24
_ELSEWHERE = "#8c8c8c"
_LANE = 5.0
"""Units between a leg that was driven back and the way there."""
_CONE = 50.0
"""Units that the cone of the chosen view reaches."""
_ARROW = ((20.0, 0.0), (-12.0, 12.5), (-5.5, 0.0), (-12.0, -12.5))
"""Corners of an arrow around a point, along x; units."""
_MARGIN = 1.0
"""Metres around the way where there is no floor plan."""


@dataclass(frozen=True)
class Word:
    """A text on the drawing, in units; turned by a quarter where ``upright``."""

    lines: tuple[str, ...]
    x: float
    y: float
    upright: bool


@dataclass(frozen=True)
class Mark:
    """A numbered point on the drawing, in units."""

    name: str
    x: float
    y: float


@dataclass(frozen=True)
class Floor:
    """The plan of one floor, in units."""

    name: str
    """What tells it from other floors on the page; empty for the lowest."""
    rooms: tuple[str, ...]
    walls: tuple[str, ...]
    openings: tuple[str, ...]
    things: tuple[tuple[str, str, bool], ...]
    """Name, outline and whether it is drawn lightly."""
    room_words: tuple[Word, ...]
    thing_words: tuple[Word, ...]
    goals: tuple[tuple[float, float], ...]
    goal_area: tuple[str, ...]


@dataclass(frozen=True)
class Overlay:
    """What lies over the plan in one step; points are texts for SVG, empty when there are none."""

    floor: str = ""
    """The name of the floor on which the step begins."""
    occupancy: tuple[str, float, float, float, float] | None = None
    """Data URI, x, y, width and height."""
    way: tuple[str, ...] = ()
    """Before this step, on its floor; in pieces."""
    leg: tuple[str, ...] = ()
    """That this step's action drove, on the floor on which the step begins; in pieces."""
    back: bool = False
    """Whether the leg is a backtrack."""
    cone: str = ""
    """The chosen view."""
    pose: str = ""
    """An arrow along the panorama's front."""
    aim: tuple[float, float] | None = None
    """The point that the action means."""
    sight: str = ""
    """From the robot to the aim."""
    waypoints: tuple[Mark, ...] = ()
    stairs: tuple[tuple[float, float], ...] = ()
    """Where way and leg lead to another floor or come from one."""


class Sheet:
    """A drawing of one run, y down; all its maps have the same bounds.

    Args:
        run: the run.
        setting: its scene; without a floor plan the bounds are those of way and aims.
    """

    def __init__(self, run: RunRecord, setting: Setting) -> None:
        self._trace = run.trace
        self._first_seen = _first_seen(run.steps)
        x_min, y_min, x_max, y_max = _bounds(run, setting)
        self._x_min, self._y_max = x_min, y_max
        self._scale = WIDTH / (x_max - x_min)
        self._lane = _LANE / self._scale
        self.width = WIDTH
        self.height = round((y_max - y_min) * self._scale, 1)
        self._elevations = [storey.elevation for storey in setting.storeys]
        self._parts = {name: self._part(name) for name in map(self._name, self._elevations)}
        last = self._name(self._trace.height(run.steps[-1].n)) if run.steps else ""
        self._shown = self._parts.get(last, self._trace)
        self.floors = tuple(map(self._floor, setting.storeys))
        """From the lowest up; none without a floor plan."""
        self.has_goals = any(floor.goals for floor in self.floors)

    def overlay(self, step: Step, occupancy: str) -> Overlay:
        """Returns what lies over the plan in a step.

        Args:
            step: the step.
            occupancy: the data URI of its map; empty without one.
        """
        points = self._trace.points
        decided = math.inf if step.decided is None else step.decided
        ended = decided if step.ended is None and step.status is None else step.ended
        until = math.inf if ended is None else ended
        back = step.action is not None and step.action.tool == "backtrack"
        pose = self._trace.poses.get(step.n)
        floor = self._name(self._trace.height(step.n))
        part = self._parts.get(floor, self._trace)
        before = without(stretch(points, -math.inf, decided), part.away)
        leg = without(stretch(points, decided, until), part.away)
        p_WG = step.goal.p_WG if step.goal is not None else None
        aim = self._point(*p_WG[:2]) if p_WG is not None else None
        here = self._point(*pose[:2]) if pose is not None else None
        return Overlay(
            floor=floor,
            occupancy=self._placed(step, occupancy),
            way=tuple(self._points(piece[:, 1:]) for piece in before),
            leg=tuple(
                self._points((beside(piece, self._lane) if back else piece)[:, 1:]) for piece in leg
            ),
            back=back,
            cone=self._cone(step, pose),
            pose="" if pose is None else self._arrow(*pose),
            aim=aim,
            sight="" if aim is None or here is None else f"{here[0]},{here[1]} {aim[0]},{aim[1]}",
            waypoints=self._waypoints(part, step.n),
            stairs=self._stairs(part, until),
        )

    def timed_way(self) -> tuple[tuple[str, str, bool], ...]:
        """Returns the whole way in pieces: points, color by time, whether driven back.

        On other floors than that of the last step it is gray.
        """
        points, backtracks = self._trace.points, self._shown.backtracks
        if len(points) < 2:
            return ()
        elsewhere = (stretch(points, *span)[:, 1:] for span in self._shown.away)
        pieces = [(self._points(piece), _ELSEWHERE, False) for piece in elsewhere if len(piece) > 1]
        legs = [(piece, False) for piece in without(points, (*backtracks, *self._shown.away))]
        legs += [(beside(stretch(points, *span), self._lane), True) for span in backtracks]
        bounds = np.linspace(points[0, 0], points[-1, 0], _COLORS + 1)
        colors = _viridis(_COLORS)
        for leg, back in legs:
            for color, begin, end in zip(colors, bounds[:-1], bounds[1:], strict=True):
                piece = stretch(leg, float(begin), float(end))
                if len(piece) > 1:
                    pieces.append((self._points(piece[:, 1:]), color, back))
        return tuple(pieces)

    @property
    def elsewhere(self) -> str:
        """The color of the way on other floors; empty where there is none."""
        return _ELSEWHERE if self._shown.away else ""

    def ends(self) -> tuple[str, ...]:
        """Returns the arrows at start and end, empty without a panorama or on another floor."""
        return tuple("" if pose is None else self._arrow(*pose) for pose in self._shown.ends)

    def waypoints(self) -> tuple[Mark, ...]:
        """Returns all waypoints of the floor of the last step."""
        return self._waypoints(self._shown, None)

    def _waypoints(self, trace: EpisodeTrace, n: int | None) -> tuple[Mark, ...]:
        return tuple(
            Mark(str(waypoint), *self._point(*place))
            for waypoint, place in sorted(trace.waypoints.items())
            if n is None or self._first_seen.get(waypoint, 0) <= n
        )

    def _stairs(self, part: EpisodeTrace, until: float) -> tuple[tuple[float, float], ...]:
        """Returns where the way changes between the floor of a part and others."""
        times = part.points[:, 0]
        ends = {t for span in part.away for t in span if times[0] < t < min(until, times[-1])}
        places = (stretch(part.points, t, t)[0, 1:] for t in sorted(ends))
        return tuple(self._point(x, y) for x, y in places)

    def _part(self, name: str) -> EpisodeTrace:
        return self._trace.on(lambda z: self._name(z) == name)

    def _name(self, z: float) -> str:
        below = sum(elevation <= z + BELOW_FLOOR for elevation in self._elevations)
        return str(below) if below > 1 else ""

    def _floor(self, storey: Storey) -> Floor:
        plan = storey.plan
        name = self._name(storey.elevation)
        here = self._parts[name]
        way = without(here.points, here.away)
        points = np.vstack([piece[:, 1:] for piece in way]) if way else np.zeros((0, 2))
        rooms = room_labels(plan, self._lettering(ROOM_LETTER, 0.66), points)
        taken = [rectangle for _, rectangle in rooms]
        words = thing_labels(plan, self._lettering(THING_LETTER, 0.56), taken)
        return Floor(
            name=name,
            rooms=tuple(self._points(_corners(room.rectangle)) for room in plan.rooms),
            walls=tuple(map(self._points, plan.walls)),
            openings=tuple(map(self._points, plan.openings)),
            things=tuple(
                (thing.name, self._points(outline), thing.slight)
                for thing in plan.things
                for outline in thing.outlines
            ),
            room_words=self._words(label for label, _ in rooms),
            thing_words=self._words(words),
            goals=tuple(self._point(x, y) for x, y in storey.goals),
            goal_area=tuple(self._points(outline) for outline in storey.goal_area),
        )

    def _words(self, labels: Iterable[Label]) -> tuple[Word, ...]:
        return tuple(
            Word(label.lines, *self._point(label.x, label.y), label.upright) for label in labels
        )

    def _cone(self, step: Step, pose: tuple[float, float, float] | None) -> str:
        action, panorama = step.action, step.panorama
        if pose is None or panorama is None or action is None or action.tool != "turn":
            return ""
        if action.direction not in VIEW_YAW:
            return ""  # Straight down: a cone on a map has a bearing.
        frames = [frame for frame in panorama.frames if frame.view == action.direction]
        if not frames:
            return ""
        x, y, yaw = pose
        half = frames[0].intrinsics.horizontal_fov / 2
        angles = yaw + VIEW_YAW[action.direction] + np.linspace(-half, half, 9)
        reach = _CONE / self._scale
        arc = np.column_stack([x + reach * np.cos(angles), y + reach * np.sin(angles)])
        return self._points(np.vstack([[x, y], arc]))

    def _placed(self, step: Step, occupancy: str) -> tuple[str, float, float, float, float] | None:
        if step.map is None or not occupancy:
            return None
        rows, columns = step.map.shape
        side = step.map.resolution
        x, y = self._point(step.map.origin[0], step.map.origin[1] + rows * side)
        return (
            occupancy,
            x,
            y,
            round(columns * side * self._scale, 1),
            round(rows * side * self._scale, 1),
        )

    def _arrow(self, x: float, y: float, yaw: float) -> str:
        c, s = math.cos(yaw), math.sin(yaw)
        shape = np.array(_ARROW) / self._scale
        return self._points(shape @ np.array([[c, s], [-s, c]]) + (x, y))

    def _lettering(self, units: float, letter: float) -> Lettering:
        height = units / self._scale
        return Lettering(height=height, letter_width=letter * height)

    def _point(self, x: float, y: float) -> tuple[float, float]:
        return (
            round((x - self._x_min) * self._scale, 1),
            round((self._y_max - y) * self._scale, 1),
        )

    def _points(self, points: NDArray[np.float64] | Outline) -> str:
        if len(points) < 2:
            return ""
        return " ".join("{:g},{:g}".format(*self._point(x, y)) for x, y in np.asarray(points))


def _first_seen(steps: Iterable[Step]) -> dict[int, int]:
    """Waypoint -> the step at which it became one."""
    seen: dict[int, int] = {}
    for step in steps:
        if step.variables is not None:
            seen.setdefault(step.variables.current_waypoint, step.n)
    return seen


def _bounds(run: RunRecord, setting: Setting) -> tuple[float, float, float, float]:
    if setting.storeys:
        every = np.array([storey.plan.bounds for storey in setting.storeys])
        return (*every[:, :2].min(axis=0).tolist(), *every[:, 2:].max(axis=0).tolist())
    places = [*run.trace.points[:, 1:].tolist(), *run.trace.goals]
    places += [pose[:2] for pose in run.trace.poses.values()] or [(0.0, 0.0)]
    points = np.array(places, float)
    (x_min, y_min), (x_max, y_max) = points.min(axis=0), points.max(axis=0)
    return x_min - _MARGIN, y_min - _MARGIN, x_max + _MARGIN, y_max + _MARGIN


def _corners(rectangle: tuple[float, float, float, float]) -> NDArray[np.float64]:
    x_min, y_min, x_max, y_max = rectangle
    return np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])


def _viridis(count: int) -> tuple[str, ...]:
    # Not at the top: only a report needs it, and it takes a while to import.
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return tuple(to_hex(color) for color in colormaps["viridis"](np.linspace(0.0, 1.0, count)))
