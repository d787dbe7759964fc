"""One plan: from a map, a pose and a target to a path on free floor."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message, OccupancyMap
from unilavira_drake.planning import (
    fast_marching,
    navigation_grid,
    near_obstacles,
    polyline,
    snapping,
)
from unilavira_drake.planning.navigation_grid import NavigationGrid, make_navigation_grid
from unilavira_drake.planning.snapping import UNREACHABLE, snap

HORIZON = 30.0
"""A target outside the map farther than this from the robot is not looked for, metres; a robot
outside the map farther than this is lost."""

FARTHEST = 1e12
"""No place is farther from the world's origin than this, metres: its cell could not be counted."""

NO_PLACE = "goal or pose is not a place"
LOST = "the robot is outside the map"


@dataclass(frozen=True)
class PlanningParameters(Message):
    """The robot's size and the bound on snapping, metres."""

    radius: float = 0.36
    """Kept free around the base's centre."""
    turning_radius: float = 0.50
    """Swept when the base turns in place; goals keep it free where they can."""
    snap_distance: float = 1.5


@dataclass(frozen=True, eq=False)
class Plan(Message):
    """A path, or the reason why there is none."""

    p_WP: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    """(k, 2) float64, metres in the world, from the robot to the snapped goal."""
    length: float = 0.0
    """Metres."""
    reason: str = ""

    @property
    def goal(self) -> tuple[float, float]:
        """(x, y) of the snapped goal; only of a plan with a path."""
        return (float(self.p_WP[-1, 0]), float(self.p_WP[-1, 1]))


def make_plan(
    occupancy: OccupancyMap,
    *,
    position: tuple[float, float],
    target: tuple[float, float],
    viewpoint: tuple[float, float],
    goal: tuple[float, float] | None = None,
    parameters: PlanningParameters,
) -> Plan:
    """Returns a plan to the floor nearest to a target, or a plan with the reason why not.

    The field is marched from the goal and stops at the robot, so a near goal costs little in a
    large map.

    Args:
        occupancy: the map.
        position: (x, y) of the robot, metres.
        target: (x, y) of the selected point, metres.
        viewpoint: (x, y) from which the target was seen, metres.
        goal: (x, y) of the goal snapped before; kept while the robot can go, stand and turn there.
        parameters: the robot's size and the bound on snapping.
    """
    # Not a number is not less, either.
    if not all(abs(value) < FARTHEST for value in (*position, *target, *viewpoint, *(goal or ()))):
        return Plan(reason=NO_PLACE)
    if _is_lost(occupancy, position):
        return Plan(reason=LOST)
    grid = make_navigation_grid(
        occupancy,
        position=position,
        targets=(target,) if math.dist(target, position) <= HORIZON else (),
        radius=parameters.radius,
        turning_radius=parameters.turning_radius,
    )
    if goal is not None and _is_good(grid, goal, parameters.turning_radius):
        plan = _way(grid, position, grid.cell(*goal))
        if not plan.reason:
            return plan
    snapped = snap(
        grid,
        grid.reachable(grid.cell(*position)),
        target=target,
        position=position,
        viewpoint=viewpoint,
        max_distance=parameters.snap_distance,
        turning_radius=parameters.turning_radius,
    )
    if snapped.cell is None:
        return Plan(reason=snapped.reason)
    return _way(grid, position, snapped.cell)


def _is_lost(occupancy: OccupancyMap, position: tuple[float, float]) -> bool:
    """Returns whether the robot is so far off what is known that no window can hold both."""
    sides = zip(position, occupancy.origin, occupancy.shape[::-1], strict=True)
    far = any(
        not -HORIZON <= place - first <= count * occupancy.resolution + HORIZON
        for place, first, count in sides
    )
    return far and bool(occupancy.log_odds.any())


def _way(grid: NavigationGrid, position: tuple[float, float], cell: tuple[int, int]) -> Plan:
    """Returns the plan to a cell."""
    times = fast_marching.distance_field(
        grid.blocked, np.array([cell]), slowness=grid.slowness, stop=grid.cell(*position)
    )
    cells = polyline.extract_path(times, grid.blocked, grid.slowness, grid.point(*position))
    if not len(cells):
        return Plan(reason=UNREACHABLE)
    p_WP = cells * grid.resolution + np.array(grid.origin)
    return Plan(p_WP=p_WP, length=polyline.length(p_WP))


def _is_good(grid: NavigationGrid, goal: tuple[float, float], turning_radius: float) -> bool:
    """Returns whether the robot can stand and turn at a goal snapped before, as the map is now."""
    cell = grid.cell(*goal)
    if not grid.contains(cell):
        return False
    # One cell less than asked at first, so that the noise of a border does not move the goal.
    room = float(grid.clearance[cell]) >= turning_radius - grid.resolution
    return room and not grid.blocked[cell] and bool(grid.log_odds[cell] < 0)


def warm_up() -> None:
    """Compiles every kernel of planning, or loads it from numba's cache."""
    for module in (fast_marching, near_obstacles, navigation_grid, polyline, snapping):
        module.warm_up()
