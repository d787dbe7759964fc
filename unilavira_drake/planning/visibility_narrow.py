"""Ways through gaps in which an aircraft cannot turn, for goals that cannot be reached otherwise.

What can be reached with room to turn falls into regions that such gaps connect.  A search with
less kept free tells through which gaps to go; each is then passed on the best line through it,
and between the gaps the way is one with room to turn.
"""

from __future__ import annotations

import dataclasses as dc
import itertools
import math

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Path
from unilavira_drake.planning import visibility_gaps
from unilavira_drake.planning.visibility import (
    NO_WAY_OUT,
    TOO_MANY,
    UNREACHABLE,
    FlightParameters,
    FlightPlan,
    Point,
    believable,
    end_in,
    escape,
    make_flight_plan,
    margins,
    route,
    window_around,
)
from unilavira_drake.planning.visibility_gaps import REACH, RUN_IN, RUN_OUT, best_line, free_beside
from unilavira_drake.planning.visibility_lines import unfold
from unilavira_drake.planning.visibility_path import path_is_blocked, remaining_way
from unilavira_drake.planning.visibility_snapping import way_out
from unilavira_drake.planning.visibility_space import Clearance, FlightSpace, update_space
from unilavira_drake.planning.visibility_window import FlightWindow, reachable

BEFORE_A_GAP = 1.0
"""Who is nearer to a gap than this does not plan anew without need, metres."""

AT_THE_END = 0.06
"""Who is nearer than this to the end of its path is in no gap, metres."""

MOST_GAPS = 8
"""So many gaps are looked at that turn out to be too narrow."""

Places = tuple[Point, Point, Point, "Point | None"]
"""Position, target, viewpoint, and the goal snapped before."""


def narrow_clearance(clearance: Clearance, narrow_radius: float, resolution: float) -> Clearance:
    """Returns what the search for gaps keeps free.

    Bits keep up to a voxel more than they are asked for; what is too narrow is found out later.
    """
    return dc.replace(clearance, radius=max(narrow_radius - 1.5 * resolution, 0.0))


def make_plan(
    space: FlightSpace, tight: FlightSpace, *, places: Places, parameters: FlightParameters
) -> tuple[FlightPlan, FlightSpace]:
    """Returns a plan with room to turn, or one through gaps where there is no other.

    So it does in place of a plan that ends elsewhere than at the goal.  Voxels larger than the
    narrow radius show no gaps: too little is known of where their sides are.  A gap in which the
    aircraft already is it leaves straight, by the end from which the way is shorter.

    Args:
        space: where the aircraft may fly and turn.
        tight: where the latest search for gaps took place; the new one is returned.
        places: as those of :func:`make_flight_plan`.
        parameters: size and limits.
    """
    position, target, viewpoint, goal = places
    ways = []
    for out in _ways_out(space, position, parameters):
        plan, tight = _plan(space, tight, (out, target, viewpoint, goal), parameters)
        if not plan.reason:
            ways.append(_from(position, plan, narrow=True))
    if ways:
        return min(ways, key=lambda plan: (plan.elsewhere, plan.length)), tight
    return _plan(space, tight, places, parameters)


def _has_gaps(space: FlightSpace, narrow_radius: float) -> bool:
    """Returns whether there may be gaps too narrow to turn, and voxels that show them."""
    return space.voxels.resolution <= narrow_radius < space.clearance.radius


def _ways_out(
    space: FlightSpace, position: Point, parameters: FlightParameters
) -> tuple[Point, ...]:
    """Returns the two ends of the gap in which an aircraft is; none: it is in no gap.

    What has less free than a gap needs, by no more than a voxel, is one too: it is there already.
    """
    resolution, radius = space.voxels.resolution, parameters.narrow_radius
    if radius is None or not _has_gaps(space, radius) or not believable(position):
        return ()
    margin = math.ceil((REACH + RUN_IN) / resolution)
    window = window_around(space, (position,), margin, parameters)
    if window is None or not window.is_blocked(window.point(position)):
        return ()
    here = window.point(position)
    line, free = best_line(space, here[None], window, window)
    if not radius - resolution <= free < space.clearance.radius:
        return ()
    p_WA, p_WB = window.world(line)
    way = p_WB[:2] - p_WA[:2]
    off = np.array(position[:2]) - p_WA[:2]
    off -= way * (float(off @ way) / float(way @ way))
    if math.hypot(*off) > space.clearance.radius - radius + resolution:
        return ()
    return tuple((float(x), float(y), float(z)) for x, y, z in (p_WB, p_WA))


def _plan(
    space: FlightSpace, tight: FlightSpace, places: Places, parameters: FlightParameters
) -> tuple[FlightPlan, FlightSpace]:
    """Returns the plan of an aircraft that is in no gap; see :func:`make_plan`."""
    position, target, viewpoint, goal = places
    plan = make_flight_plan(
        space,
        position=position,
        target=target,
        viewpoint=viewpoint,
        goal=goal,
        parameters=parameters,
    )
    wanted, resolution = plan.reason == UNREACHABLE or plan.elsewhere, space.voxels.resolution
    radius = parameters.narrow_radius
    if radius is None or not _has_gaps(space, radius) or not wanted:
        return plan, tight
    clearance = narrow_clearance(space.clearance, radius, resolution)
    if tight.clearance != clearance:
        tight = FlightSpace(clearance=clearance)
    tight = update_space(tight, space.voxels)
    through = make_plan_through_gaps(space, tight, places=places, parameters=parameters)
    return (plan if through.reason else through), tight


def make_plan_through_gaps(
    space: FlightSpace, tight: FlightSpace, *, places: Places, parameters: FlightParameters
) -> FlightPlan:
    """Returns a plan to the free space nearest to a target that leads through gaps.

    Args:
        space: where the aircraft may fly and turn.
        tight: the same with what the search for gaps keeps free.
        places: as those of :func:`make_flight_plan`.
        parameters: size and limits, with a narrow radius.
    """
    position, target = places[:2]
    reason = UNREACHABLE
    for margin in margins(position, target, space.voxels.resolution):
        window = window_around(space, (position, target), margin, parameters)
        wider = window_around(tight, (position, target), margin, parameters)
        if window is None or wider is None:
            return FlightPlan(reason=TOO_MANY)
        start = way_out(space, window, position, escape(position, parameters))
        if start is None:
            return FlightPlan(reason=NO_WAY_OUT)
        end = end_in(space, window, places, parameters)
        if end is None:
            return FlightPlan(reason=f"no free space within {parameters.snap_distance:g} m")
        plan = _through_gaps(space, window, wider, start, end, parameters)
        if not plan.reason:
            return _from(position, plan)
        reason = plan.reason
    return FlightPlan(reason=reason)


def _from(position: Point, plan: FlightPlan, *, narrow: bool = False) -> FlightPlan:
    """Returns a plan that begins at the aircraft; ``narrow`` tells whether that is in a gap."""
    out = math.dist(plan.p_WP[0], position)
    if out <= 1e-9:
        return plan
    p_WP = np.concatenate((np.array([position]), plan.p_WP))
    segments = (*((0,) if narrow else ()), *(k + 1 for k in plan.narrow))
    return dc.replace(plan, p_WP=p_WP, length=plan.length + out, narrow=segments)


def _through_gaps(
    space: FlightSpace,
    window: FlightWindow,
    wider: FlightWindow,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    parameters: FlightParameters,
) -> FlightPlan:
    words = wider.words.copy()
    for _ in range(MOST_GAPS):
        nodes = route(FlightWindow(wider.low, wider.resolution, words), start, end,
                      parameters.slopes)  # fmt: skip
        if not len(nodes):
            break
        legs = _legs(space, window, nodes, parameters)
        if isinstance(legs, FlightPlan):
            return legs
        # No such gap: its voxels are none that lead anywhere.
        _close(words, window.words, legs)
    return FlightPlan(reason=UNREACHABLE)


def _legs(
    space: FlightSpace,
    window: FlightWindow,
    nodes: NDArray[np.float64],
    parameters: FlightParameters,
) -> FlightPlan | NDArray[np.float64]:
    """Returns the plan that goes through the gaps of a way, or the points in one too narrow."""
    assert parameters.narrow_radius is not None
    points = _points_along(nodes)
    open_to_turn = [not window.is_blocked(point) for point in points]
    here, k = nodes[0], 0
    legs: list[NDArray[np.float64]] = []
    while True:
        region = reachable(window, here)
        if not region.is_blocked(nodes[-1]):
            break
        inside = [i for i in range(k, len(points)) if not region.is_blocked(points[i])]
        last = inside[-1] if inside else k
        rest = (i for i in range(last + 1, len(points)) if open_to_turn[i])
        k = next(rest, len(points) - 1)
        gap = points[last : k + 1]
        beyond = reachable(window, points[k])
        line, free = best_line(space, gap, region, beyond)
        if free < parameters.narrow_radius - 1e-6:
            return gap
        line[1] = _end(line, nodes[-1], beyond)
        legs += [_leg(window, here, line[0], parameters), line]
        here = line[1]
    legs.append(_leg(window, here, nodes[-1], parameters))
    if not all(map(len, legs)):
        return FlightPlan(reason=TOO_MANY)
    return _joined(window, legs, parameters)


def _end(
    line: NDArray[np.float64], goal: NDArray[np.float64], beyond: FlightWindow
) -> NDArray[np.float64]:
    """Returns where a line through a gap ends: beside a goal that lies just behind the gap."""
    begin: NDArray[np.float64] = line[0]
    end: NDArray[np.float64] = line[1].copy()
    way: NDArray[np.float64] = end - begin
    length = math.hypot(*way)
    run = RUN_OUT / beyond.resolution
    t = max(float((goal - begin) @ way) / length, 0.0)
    if t >= length or math.dist(begin + way * (t / length), goal) > run:
        return end
    while t < length:
        point: NDArray[np.float64] = begin + way * (t / length)
        if not beyond.is_blocked(point):
            return point
        t += 0.5
    return end


def _leg(
    window: FlightWindow,
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    parameters: FlightParameters,
) -> NDArray[np.float64]:
    if math.dist(a, b) < 1e-9:
        return a[None]
    return route(window, a, b, parameters.slopes)


def _joined(
    window: FlightWindow, legs: list[NDArray[np.float64]], parameters: FlightParameters
) -> FlightPlan:
    """Returns the plan of legs of which every other one leads through a gap."""
    p_WP, narrow = [window.world(legs[0][0])], []
    for number, leg in enumerate(legs):
        straight = number % 2 or len(leg) == 1
        way = leg if straight else unfold(window.words, leg, parameters.slopes)
        for k, point in enumerate(window.world(way)):
            if math.dist(point, p_WP[-1]) > 1e-9:
                p_WP.append(point)
            if number % 2 and k == 0:
                narrow.append(len(p_WP) - 1)
    path = np.array(p_WP)
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(path))
    return FlightPlan(path, length, narrow=tuple(narrow))


def _points_along(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns points along a way, at most a voxel from one another; (k, 3)."""
    parts = [nodes[:1]]
    for a, b in itertools.pairwise(nodes):
        count = max(math.ceil(float(np.linalg.norm(b - a))), 1)
        parts.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(parts)


def _close(
    words: NDArray[np.uint32], blocked: NDArray[np.uint32], gap: NDArray[np.float64]
) -> None:
    """Blocks the voxels around points of a gap that are no room to turn."""
    for x, y, _ in np.floor(gap).astype(int):
        around = (slice(max(x - 1, 0), x + 2), slice(max(y - 1, 0), y + 2))
        words[around] |= blocked[around]


def way_is_blocked(
    space: FlightSpace, path: Path, *, position: Point, narrow_radius: float | None
) -> bool:
    """Returns whether something is in the rest of a path: of its gaps, or of the way between."""
    if narrow_radius is None or not path.narrow:
        return path_is_blocked(space, path.p_WP, position=position)
    _, ahead = remaining_way(path.p_WP, position)
    way = [np.array(position)]
    for k in range(max(ahead - 1, 0), len(path.p_WP) - 1):
        a, b = path.p_WP[k], path.p_WP[k + 1]
        if k not in path.narrow:
            way.append(b)
            continue
        if free_beside(space, a, b) < narrow_radius - 1e-6:
            return True
        if len(way) > 1 and _blocked(space, way):
            return True
        way = [b]
    return len(way) > 1 and _blocked(space, way)


def _blocked(space: FlightSpace, way: list[NDArray[np.float64]]) -> bool:
    x, y, z = way[0].tolist()
    return path_is_blocked(space, np.array(way), position=(x, y, z))


def out_of_gaps(path: Path, position: Point) -> bool:
    """Returns whether an aircraft is in no gap of its path; one that ends right behind it is past.

    Near to the end of such a path nobody can tell on which of its segments the aircraft is.
    """
    _, ahead = remaining_way(path.p_WP, position)
    if ahead - 1 not in path.narrow or math.dist(path.p_WP[-1], position) < AT_THE_END:
        return True
    a, b = path.p_WP[ahead - 1], path.p_WP[ahead]
    return float((np.array(position) - b) @ (b - a)) >= 0.0


def near_a_gap(path: Path, position: Point) -> bool:
    """Returns whether an aircraft is in a gap, or soon will be."""
    if not path.narrow:
        return False
    _, ahead = remaining_way(path.p_WP, position)
    if ahead - 1 in path.narrow:
        return True
    return ahead in path.narrow and math.dist(path.p_WP[ahead], position) < BEFORE_A_GAP


def warm_up() -> None:
    """Compiles the kernels, or loads them from numba's cache."""
    visibility_gaps.warm_up()
