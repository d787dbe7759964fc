"""Waypoints and second chances as a pure function of what happened (paper III-D, SCB).

One call of :func:`remember` per panorama: it adds or re-visits a waypoint, closes the edge that
led here, and, when a backtrack has arrived, names the direction that failed from this place with
the egocentric frames of the failed leg.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from unilavira_drake.messages import (
    VIEW_YAW,
    DecisionRecord,
    Edge,
    History,
    LanguageAction,
    Message,
    Panorama,
    SecondChance,
    VisionAction,
    Waypoint,
    direction_of,
)


@dataclass(frozen=True)
class Leg(Message):
    """The egocentric JPEG frames captured while action ``n`` was carried out."""

    n: int = 0
    frames: tuple[bytes, ...] = ()


@dataclass(frozen=True)
class WaypointState(Message):
    """What the waypoint memory holds between two panoramas."""

    history: History = History()
    second_chance: SecondChance = SecondChance()
    yaw: float = 0.0
    """World yaw of ``front`` of the latest panorama, radians."""
    legs: tuple[Leg, ...] = ()
    """Finished legs, oldest first."""
    frames: tuple[bytes, ...] = ()
    """Frames of the running leg."""
    last_frame_position: tuple[float, float] = (math.inf, math.inf)
    next_id: int = 1


@dataclass(frozen=True)
class MemoryBounds:
    """How much is kept; lengths in metres."""

    waypoints: int
    decisions: int
    keyframes: int
    merge_distance: float


def remember(
    state: WaypointState,
    panorama: Panorama,
    action: LanguageAction,
    vision: VisionAction,
    thumbnail: bytes,
    bounds: MemoryBounds,
) -> WaypointState:
    """Returns the memory after panorama n, to which ``action`` (n - 1) led.

    Args:
        vision: the vision action of ``action``; ignored unless its number is the same.
        thumbnail: small JPEG of the front view, kept if a waypoint is added.
    """
    old = state.history
    target = vision.target_desc if vision.n == action.n and action.tool == "turn" else ""
    outcome = panorama.outcome.state
    if panorama.outcome.reason:
        outcome += f": {panorama.outcome.reason}"
    waypoints = tuple(
        dataclasses.replace(w, scene=action.scene) if w.id == old.current and action.scene else w
        for w in old.waypoints
    )
    back = action.tool == "backtrack" and panorama.outcome.state == "arrived"
    if back and action.waypoint is not None and old.waypoint(action.waypoint) is not None:
        # Room to turn may have moved the goal a little; the place is the one that was meant.
        current, next_id = action.waypoint, state.next_id
    else:
        current, waypoints, next_id = _place(state, waypoints, panorama, target, thumbnail, bounds)
    kept = {waypoint.id for waypoint in waypoints}
    edges = tuple(edge for edge in old.edges if edge.waypoint in kept)
    if action.tool == "turn":
        bearing = state.yaw + VIEW_YAW[action.direction]
        to = current if panorama.outcome.state == "arrived" and current != old.current else None
        edges += (Edge(old.current, action.direction, bearing, action.n, outcome, to),)
    legs = (*state.legs, Leg(action.n, state.frames))[-bounds.waypoints :]
    returned = None
    if back:
        edges, returned = _mark_returned(edges, current, action.n)
    decisions = old.decisions
    if action.n:
        record = DecisionRecord(
            action.n, action.call, action.tool, action.argument, old.current, target, outcome
        )
        decisions = (*decisions, record)
        decisions = decisions[max(0, len(decisions) - bounds.decisions) :]
    n = panorama.n
    history = History(n, current, waypoints, edges, decisions, _spread(state.frames, bounds))
    second_chance = SecondChance(
        n=n,
        offers=tuple(w.id for w in waypoints if w.id != current),
        failed_edges=tuple(e for e in edges if e.outcome.startswith(("failed", "returned"))),
        failed_direction="" if returned is None else direction_of(returned.bearing - panorama.yaw),
        failed_frames=() if returned is None else _failed_frames(legs, returned, action.n, bounds),
    )
    return WaypointState(
        history=history,
        second_chance=second_chance,
        yaw=panorama.yaw,
        legs=legs,
        last_frame_position=panorama.position[:2],
        next_id=next_id,
    )


def _place(
    state: WaypointState,
    waypoints: tuple[Waypoint, ...],
    panorama: Panorama,
    target: str,
    thumbnail: bytes,
    bounds: MemoryBounds,
) -> tuple[int, tuple[Waypoint, ...], int]:
    """Returns the current waypoint's id, the buffer and the next free id."""
    if panorama.first != panorama.n:
        return state.history.current, waypoints, state.next_id
    near = min(waypoints, key=lambda w: math.dist(w.position, panorama.position), default=None)
    if near is not None and math.dist(near.position, panorama.position) < bounds.merge_distance:
        return near.id, waypoints, state.next_id
    added = Waypoint(
        id=state.next_id,
        n=panorama.n,
        position=panorama.position,
        heading=panorama.yaw,
        target_desc=target,
        thumbnail=thumbnail,
    )
    if len(waypoints) >= bounds.waypoints:
        # The start stays: it is the one place from which everything else was reached.
        waypoints = (waypoints[0], *waypoints[2:])
    return added.id, (*waypoints, added), state.next_id + 1


def _mark_returned(
    edges: tuple[Edge, ...], place: int, backtrack: int
) -> tuple[tuple[Edge, ...], Edge | None]:
    """Marks the edge by which ``place`` was last left as failed; returns it, too.

    A way that ended half-way (stuck) was left as well; its own failure stays its outcome.
    """
    for i in reversed(range(len(edges))):
        edge = edges[i]
        if edge.waypoint == place and edge.n < backtrack:
            if edge.outcome == "arrived":
                edge = dataclasses.replace(edge, outcome="returned")
            return (*edges[:i], edge, *edges[i + 1 :]), edge
    return edges, None


def _failed_frames(
    legs: tuple[Leg, ...], returned: Edge, backtrack: int, bounds: MemoryBounds
) -> tuple[bytes, ...]:
    """Returns the frames from leaving the place until the backtrack began."""
    frames = tuple(f for leg in legs if returned.n <= leg.n < backtrack for f in leg.frames)
    return _spread(frames, bounds)


def _spread(frames: tuple[bytes, ...], bounds: MemoryBounds) -> tuple[bytes, ...]:
    """Returns at most ``bounds.keyframes`` frames, evenly spread, the last one included."""
    count, most = len(frames), bounds.keyframes
    if count <= most:
        return frames
    return tuple(frames[round((i + 1) * count / most) - 1] for i in range(most))
