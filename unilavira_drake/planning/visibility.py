"""One flight plan: from where things are, a position and a target to a path through free space."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message
from unilavira_drake.planning import (
    visibility_any_angle,
    visibility_graph,
    visibility_lines,
    visibility_path,
    visibility_snapping,
    visibility_space,
    visibility_window,
)
from unilavira_drake.planning.visibility_any_angle import FOUND, TOO_LARGE, any_angle_path
from unilavira_drake.planning.visibility_graph import corner_path
from unilavira_drake.planning.visibility_lines import (
    Slopes,
    path_cost,
    slopes_of,
    unfold,
)
from unilavira_drake.planning.visibility_path import shorten
from unilavira_drake.planning.visibility_snapping import snap_goal, way_out
from unilavira_drake.planning.visibility_space import Clearance, FlightSpace
from unilavira_drake.planning.visibility_window import FlightWindow, make_window, reachable

Point = tuple[float, float, float]

UNREACHABLE = "unreachable"
NO_WAY_OUT = "no free space around the aircraft"
TOO_MANY = "too many voxels to search"

FARTHEST = 1e6
"""Places farther than this from the world's origin along an axis are not believed, metres."""

NEAR = 80
"""To goals nearer than this the any-angle path is not compared with corners, voxels."""

SIZES = (2**11, 2**13, 2**16, 2**20)
"""Most nodes of an any-angle search, and of the next when that was not enough."""

ROUNDS = 10
"""Most rounds of shortening."""


def believable(p_WP: Point) -> bool:
    """Returns whether a point lies where flights take place; NaN and inf do not."""
    return all(abs(value) <= FARTHEST for value in p_WP)


@dataclass(frozen=True)
class FlightParameters(Message):
    """The aircraft's size and limits.

    Raises:
        ValueError: if the limits leave nothing to fly in.
    """

    clearance: Clearance = Clearance()
    min_altitude: float = 1.0
    max_altitude: float = 60.0
    """Lowest and highest z of the aircraft's centre in the world, metres."""
    climb_angle: float = math.radians(45.0)
    descend_angle: float = math.radians(45.0)
    """Steepest path above and below the horizon, radians; 90 degrees is no limit."""
    snap_distance: float = 3.0
    """A goal moves at most this far to free space, metres."""
    max_distance: float = 200.0
    """Targets farther than this are not looked for, metres."""
    narrow_radius: float | None = None
    """As much is kept free beside a gap's middle where there is no other way, metres; None: there
    it does not fly."""

    def __post_init__(self) -> None:
        if not -math.inf < self.min_altitude < self.max_altitude < math.inf:
            raise ValueError("altitudes must be finite, the lower one first")
        for angle in (self.climb_angle, self.descend_angle):
            if not 0.01 < angle <= 0.5 * math.pi + 1e-9:
                raise ValueError("angles of climb and descent must lie in (0.01, pi / 2] radians")
        if not (0.0 <= self.snap_distance < math.inf and 0.0 < self.max_distance < math.inf):
            raise ValueError("distances must be finite and not negative")
        if self.narrow_radius is not None and not 0.0 < self.narrow_radius < math.inf:
            raise ValueError("the narrow radius must be finite and positive")

    @property
    def slopes(self) -> Slopes:
        """What the kernels need to know of the angles."""
        return slopes_of(self.climb_angle, self.descend_angle)


@dataclass(frozen=True, eq=False)
class FlightPlan(Message):
    """A path, or the reason why there is none."""

    p_WP: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    """(k, 3) float64, metres in the world, from the aircraft to the snapped goal."""
    length: float = 0.0
    """Metres."""
    reason: str = ""
    elsewhere: bool = False
    """Whether it ends where the aircraft gets, as there is no way to the goal."""
    narrow: tuple[int, ...] = ()
    """Segments on which only an aircraft that flies straight along them fits."""


def make_flight_plan(
    space: FlightSpace,
    *,
    position: Point,
    target: Point,
    viewpoint: Point,
    goal: Point | None = None,
    parameters: FlightParameters,
) -> FlightPlan:
    """Returns a plan to the free space nearest to a target.

    It is searched in a box around aircraft and target, and when there is no way in it, in a much
    larger one; only then may it end at another place, the nearest that can be reached.  Unknown
    space is taken to be free.

    Args:
        space: where the aircraft may fly.
        position: (x, y, z) of the aircraft, metres in the world.
        target: the selected point.
        viewpoint: from where the target was seen.
        goal: the goal snapped before; kept while it is free and there is a way.
        parameters: size and limits.
    """
    if not all(map(believable, (position, target, viewpoint))):
        return FlightPlan(reason=f"a position is not finite, or beyond {FARTHEST:g} m")
    if math.dist(position, target) > parameters.max_distance:
        return FlightPlan(reason=f"farther than {parameters.max_distance:g} m")
    near, far = margins(position, target, space.voxels.resolution)
    reason = ""
    # The last resort is for goals whose larger box has too many voxels.
    for margin, elsewhere in ((near, False), (far, True), (near, True)):
        window = window_around(space, (position, target), margin, parameters)
        if window is None:
            reason = reason or TOO_MANY
            continue
        start = way_out(space, window, position, escape(position, parameters))
        if start is None:
            return FlightPlan(reason=NO_WAY_OUT)
        places = (position, target, viewpoint, goal)
        plan = _plan_in(space, window, start, places, parameters, elsewhere=elsewhere)
        if not plan.reason:
            return plan
        reason = plan.reason
        if reason != (TOO_MANY if margin == far else UNREACHABLE):
            break
    return FlightPlan(reason=reason)


def margins(position: Point, target: Point, resolution: float) -> tuple[int, int]:
    """Returns how far around position and target a way is looked for first, and then; voxels."""
    voxels = math.dist(position, target) / resolution
    return max(20, int(0.3 * voxels)), max(200, int(1.5 * voxels))


def _plan_in(
    space: FlightSpace,
    window: FlightWindow,
    start: NDArray[np.float64],
    places: tuple[Point, Point, Point, Point | None],
    parameters: FlightParameters,
    *,
    elsewhere: bool,
) -> FlightPlan:
    """Returns the plan within one window.

    ``places`` are the caller's position, target, viewpoint and goal; ``elsewhere`` tells whether
    the plan may end at another place when there is no way to the free space nearest to the target.
    """
    position = places[0]
    end = end_in(space, window, places, parameters)
    if end is None:
        return FlightPlan(reason=f"no free space within {parameters.snap_distance:g} m")
    slopes = parameters.slopes
    nodes = route(window, start, end, slopes)
    found = None
    if not len(nodes):
        within_reach = reachable(window, start)
        other = elsewhere and within_reach.is_blocked(end)
        found = _snapped(space, within_reach, places, parameters) if other else None
        if found is not None:
            nodes = route(window, start, found, slopes)
        if not len(nodes):
            failed = not within_reach.is_blocked(end) or found is not None
            return FlightPlan(reason=TOO_MANY if failed else UNREACHABLE)
    p_WP = window.world(unfold(window.words, nodes, slopes))
    length = path_cost(nodes, slopes) * window.resolution
    out = math.dist(p_WP[0], position)
    if out > 1e-9:
        p_WP = np.concatenate((np.array([position]), p_WP))
    return FlightPlan(p_WP, length + out, elsewhere=found is not None)


def end_in(
    space: FlightSpace,
    window: FlightWindow,
    places: tuple[Point, Point, Point, Point | None],
    parameters: FlightParameters,
) -> NDArray[np.float64] | None:
    """Returns where a way to a target ends: at the goal snapped before, while that is free."""
    goal = places[3]
    end = None if goal is None else window.point(goal)
    if end is None or window.is_blocked(end):
        return _snapped(space, window, places, parameters)
    return end


def _snapped(
    space: FlightSpace,
    window: FlightWindow,
    places: tuple[Point, Point, Point, Point | None],
    parameters: FlightParameters,
) -> NDArray[np.float64] | None:
    position, target, viewpoint, _ = places
    return snap_goal(
        space,
        window,
        target=target,
        position=position,
        viewpoint=viewpoint,
        max_distance=parameters.snap_distance,
    )


def route(
    window: FlightWindow,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    slopes: Slopes,
) -> NDArray[np.float64]:
    """Returns the (k, 3) nodes of a short path between two free points of a window, in voxels.

    Empty when there is none.  Edges steeper than the limits are flown as switchbacks, see
    :func:`unfold`.
    """
    words = window.words
    for size in SIZES:
        # Before anything costly: is there a way at all?
        if size == SIZES[1] and reachable(window, start).is_blocked(goal):
            break
        outcome, nodes = any_angle_path(words, start, goal, slopes, size)
        if outcome != TOO_LARGE:
            break
    if outcome != FOUND:
        return np.zeros((0, 3))
    if len(nodes) == 2:
        return nodes
    nodes = shorten(words, nodes, slopes, ROUNDS)
    if path_cost(nodes, slopes) > NEAR:
        nodes = shorten(words, corner_path(words, nodes, slopes), slopes, ROUNDS)
    return nodes


def escape(position: Point, parameters: FlightParameters) -> float:
    """Returns how far from the aircraft a free voxel is looked for, metres."""
    keep = parameters.clearance
    below = max(parameters.min_altitude - position[2], position[2] - parameters.max_altitude, 0.0)
    return below + keep.radius + max(keep.ground_margin, keep.ceiling_margin, 1.0) + 1.0


def window_around(
    space: FlightSpace, points: tuple[Point, ...], margin: int, parameters: FlightParameters
) -> FlightWindow | None:
    """Returns the window around some points, or None if it would be too large."""
    resolution = space.voxels.resolution
    cells = [[math.floor(value / resolution) for value in point] for point in points]
    (x0, x1), (y0, y1), (z0, z1) = (
        (min(values), max(values) + 1) for values in zip(*cells, strict=True)
    )
    floor = math.ceil(parameters.min_altitude / resolution - 1e-9)
    ceiling = math.floor(parameters.max_altitude / resolution + 1e-9)
    try:
        return make_window(
            space.blocked,
            low=(x0 - margin, y0 - margin, max(z0 - margin, min(floor, z0))),
            high=(x1 + margin, y1 + margin, min(z1 + margin, max(ceiling, z1))),
            resolution=resolution,
            floor=floor,
            ceiling=ceiling,
        )
    except ValueError:
        return None


def warm_up() -> None:
    """Compiles every kernel of flight planning, or loads it from numba's cache."""
    for module in (
        visibility_lines,
        visibility_space,
        visibility_window,
        visibility_any_angle,
        visibility_graph,
        visibility_snapping,
        visibility_path,
    ):
        module.warm_up()
