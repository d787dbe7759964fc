"""Frontiers: where the known free floor borders on what was never seen (Yamauchi, 1997)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.mapping.clearance import distance_field
from unilavira_drake.messages import Message, OccupancyMap, read_only


@dataclass(frozen=True, eq=False)
class Frontier(Message):
    """Free cells beside unknown ones that hang together, corners counted."""

    centroid: tuple[float, float]
    """(x, y) of the middle of its cells, metres; not always one of them."""
    size: float
    """Number of its cells times the side of a cell: about its length, metres."""
    goal: tuple[float, float] | None
    """(x, y) of the one of its cells nearest to the centroid that the robot can reach over known
    free floor, metres; None where it can reach none."""
    p_WF: NDArray[np.float64] = field(default_factory=lambda: read_only(np.zeros((0, 2))))
    """(k, 2) float64 centres of its cells, metres, row by row; read-only."""


def find_frontiers(
    occupancy: OccupancyMap,
    *,
    position: tuple[float, float],
    radius: float,
    min_size: float = 0.3,
) -> tuple[Frontier, ...]:
    """Returns the frontiers of a map, the largest first.

    Args:
        occupancy: the map.
        position: (x, y) of the robot, metres.
        radius: radius that must be free around the robot's centre, metres.
        min_size: smaller ones are left out, metres.
    """
    log_odds = occupancy.log_odds
    free = log_odds < 0
    unknown = np.pad(log_odds == 0, 1, constant_values=True)
    beside = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    count, labels = cv2.connectedComponents(
        (free & beside).view(np.uint8), connectivity=8, ltype=cv2.CV_32S
    )
    if count < 2:
        return ()
    reachable = reachable_cells(occupancy, position=position, radius=radius)
    rows, columns = np.nonzero(labels)
    # Group by group, and row by row in each.
    order = np.argsort(labels[rows, columns], kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(labels[rows, columns])[1:-1]))
    found = []
    for group in groups:
        size = len(group) * occupancy.resolution
        if size >= min_size - 1e-9:
            within = reachable[rows[group], columns[group]]
            found.append(_frontier(occupancy, rows[group], columns[group], within, size))
    return tuple(sorted(found, key=lambda frontier: (-frontier.size, frontier.centroid)))


def reachable_cells(
    occupancy: OccupancyMap, *, position: tuple[float, float], radius: float
) -> NDArray[np.bool_]:
    """Returns the cells that the robot's centre can reach over known free floor.

    A robot that stands nearer to an obstacle than its radius starts at the nearest cell that has
    room, if there is one within twice its radius.

    Returns:
        (rows, columns) bool.
    """
    # From a cell's centre to the border, not the centre, of the obstacle's cell.
    room = distance_field(occupancy) - 0.5 * occupancy.resolution >= radius
    open_floor = (occupancy.log_odds < 0) & room
    start = _nearest(open_floor, occupancy, position, 2.0 * radius)
    if start is None:
        return np.zeros(open_floor.shape, np.bool_)
    _, labels = cv2.connectedComponents(open_floor.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    found: NDArray[np.bool_] = labels == labels[start]
    return found


def _nearest(
    cells: NDArray[np.bool_], occupancy: OccupancyMap, position: tuple[float, float], reach: float
) -> tuple[int, int] | None:
    """Returns the set cell nearest to a point, within a distance."""
    steps = math.ceil(reach / occupancy.resolution) + 1
    row, column = occupancy.cell(*position)
    i, j = max(row - steps, 0), max(column - steps, 0)
    rows, columns = np.nonzero(cells[i : max(row + steps + 1, 0), j : max(column + steps + 1, 0)])
    if rows.size == 0:
        return None
    x = occupancy.origin[0] + (columns + j + 0.5) * occupancy.resolution
    y = occupancy.origin[1] + (rows + i + 0.5) * occupancy.resolution
    distances = np.hypot(x - position[0], y - position[1])
    best = int(np.argmin(distances))
    # The robot's own cell counts, wherever in it the robot stands.
    if distances[best] > max(reach, occupancy.resolution):
        return None
    return int(rows[best]) + i, int(columns[best]) + j


def _frontier(
    occupancy: OccupancyMap,
    rows: NDArray[np.intp],
    columns: NDArray[np.intp],
    reachable: NDArray[np.bool_],
    size: float,
) -> Frontier:
    cells = np.stack((columns, rows), axis=1)
    p_WF = np.array(occupancy.origin) + (cells + 0.5) * occupancy.resolution
    middle = p_WF.mean(axis=0)
    goal = None
    if reachable.any():
        candidates = p_WF[reachable]
        x, y = candidates[int(np.argmin(np.hypot(*(candidates - middle).T)))].tolist()
        goal = (x, y)
    return Frontier((float(middle[0]), float(middle[1])), size, goal, read_only(p_WF))
