"""Waypoints and second chances as a pure function of what happened (paper III-D, SCB).

One call of :func:`remember` per panorama: it adds or re-visits a waypoint, closes the edge that
led here, and, when a backtrack has arrived, names the direction that failed from this place with
the pictures of the failed leg.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from unilavira_drake.memory.pictures import (
    MOST_KEPT,
    SAME_LOOK,
    look_difference,
    of_failed_leg,
    shown,
)
from unilavira_drake.messages import (
    DOWN,
    ON_THE_WAY,
    VIEW_YAW,
    DecisionRecord,
    Edge,
    History,
    KeyPicture,
    LanguageAction,
    Message,
    Panorama,
    SecondChance,
    VisionAction,
    Waypoint,
    direction_of,
)

MOST_LOST = 128
"""Failures remembered of places that left the buffer."""


@dataclass(frozen=True)
class Sight(Message):
    """A picture that may be kept, and its look (``pictures.look_of``)."""

    jpeg: bytes = b""
    look: bytes = b""


@dataclass(frozen=True)
class Watch(Message):
    """Where the robot was watched on its way, and how far that is from the latest picture."""

    position: tuple[float, float] = (0.0, 0.0)
    """Metres in the world."""
    picture_yaw: float = 0.0
    """World yaw of the latest view that was considered for a picture, radians."""
    travelled: float = 0.0
    """Metres since then."""


@dataclass(frozen=True)
class WaypointState(Message):
    """What the waypoint memory holds between two panoramas."""

    history: History = History()
    second_chance: SecondChance = SecondChance()
    yaw: float = 0.0
    """World yaw of ``front`` of the latest panorama, radians."""
    pictures: tuple[KeyPicture, ...] = ()
    """All remembered pictures, oldest first."""
    look: bytes = b""
    """The look of the latest of them."""
    watch: Watch = Watch()
    next_id: int = 1
    lost: tuple[tuple[tuple[float, float, float], Edge], ...] = ()
    """Where the waypoints stood that left the buffer, and the ways that failed from there."""


@dataclass(frozen=True)
class MemoryBounds:
    """How much is kept; lengths in metres."""

    waypoints: int
    decisions: int
    keyframes: int
    """Pictures that a prompt shows at least, once there are so many."""
    merge_distance: float


def with_picture(
    state: WaypointState, sight: Sight, *, n: int, waypoint: int, direction: str = ""
) -> WaypointState:
    """Returns the memory with a picture more, unless it looks like the latest one.

    Args:
        n: the panorama whose front view it is, or the language action being carried out.
        direction: on the way: in which direction the waypoint was left.
    """
    if not sight.jpeg or look_difference(sight.look, state.look) < SAME_LOOK:
        return state
    number = state.pictures[-1].number + 1 if state.pictures else 1
    picture = KeyPicture(number, n, waypoint, direction, sight.jpeg)
    return dataclasses.replace(
        state, pictures=(*state.pictures, picture)[-MOST_KEPT:], look=sight.look
    )


OTHER_FLOOR = 1.2
"""A waypoint higher or lower than this is on another floor, metres."""


def remember(
    state: WaypointState,
    panorama: Panorama,
    action: LanguageAction,
    vision: VisionAction,
    sight: Sight,
    bounds: MemoryBounds,
) -> WaypointState:
    """Returns the memory after panorama n, to which ``action`` (n - 1) led.

    Args:
        vision: the vision action of ``action``; ignored unless its number is the same.
        sight: the front view, kept if a waypoint is added.
    """
    old = state.history
    target = vision.target_desc if vision.n == action.n and action.tool == "turn" else ""
    outcome = panorama.outcome.words
    state = _described(state, action)
    back = action.tool == "backtrack" and panorama.outcome.state == "arrived"
    if back and action.waypoint is not None and old.waypoint(action.waypoint) is not None:
        # Room to turn may have moved the goal a little; the place is the one that was meant.
        current = action.waypoint
    else:
        state, current = _place(state, panorama, target, sight, bounds)
    n, waypoints, edges = panorama.n, state.history.waypoints, old.edges
    way = _way(state, action)
    if way is not None:
        direction, bearing = way
        to = current if panorama.outcome.state == "arrived" and current != old.current else None
        left = current != old.current
        edges += (Edge(old.current, direction, bearing, action.n, outcome, to, left),)
    edges, lost = _kept(edges, old, state, bounds.merge_distance)
    edges = tuple(
        dataclasses.replace(e, back=n) if e.waypoint == current and e.left and not e.back else e
        for e in edges
    )
    returned = None
    if back:
        edges, returned = _mark_returned(edges, current)
    decisions = _decided(old, action, target, _told(panorama, target), bounds.decisions)
    # What is seen now is no picture of the past yet: the prompt shows it in full anyway.
    past = tuple(p for p in state.pictures if p.direction or p.n != panorama.first)
    window = shown(past, bounds.keyframes)
    return dataclasses.replace(
        state,
        history=History(n, current, waypoints, edges, decisions, window),
        second_chance=_second_chance(n, current, panorama, state, edges, returned, window),
        lost=lost,
        yaw=panorama.yaw,
        watch=Watch(panorama.position[:2], panorama.yaw),
    )


def _way(state: WaypointState, action: LanguageAction) -> tuple[str, float | None] | None:
    """Returns the word and the world bearing of the way that an action took, None if it took none.

    Straight down is a way without a bearing.  A flight straight up is none: no view shows it.
    """
    if action.tool == "turn":
        turned = VIEW_YAW.get(action.direction)
        return action.direction, None if turned is None else state.yaw + turned
    if action.tool != "fly":
        return None
    if action.distance:
        turned = math.radians(action.bearing)
        return direction_of(turned), state.yaw + turned
    return (DOWN, None) if (action.climb or 0.0) < 0.0 else None


def _kept(
    edges: tuple[Edge, ...], old: History, state: WaypointState, merge_distance: float
) -> tuple[tuple[Edge, ...], tuple[tuple[tuple[float, float, float], Edge], ...]]:
    """Returns the edges of the remembered waypoints, and those that failed elsewhere.

    A failure is remembered for the episode: where the robot comes again to a place that has left
    the buffer, its failures are those of the new waypoint.
    """
    here = {waypoint.id: waypoint.position for waypoint in state.history.waypoints}
    found, lost = [], []
    for position, edge in state.lost:
        again = next((i for i, p in here.items() if math.dist(p, position) < merge_distance), None)
        if again is None:
            lost.append((position, edge))
        else:
            found.append(dataclasses.replace(edge, waypoint=again))
    for edge in edges:
        if edge.waypoint in here:
            found.append(edge)
        elif edge.failed:
            place = old.waypoint(edge.waypoint)
            assert place is not None
            lost.append((place.position, edge))
    return tuple(sorted(found, key=lambda edge: edge.n)), tuple(lost[-MOST_LOST:])


def _described(state: WaypointState, action: LanguageAction) -> WaypointState:
    """Returns the memory with the action's words for the place where it was decided."""
    old = state.history
    if not action.scene:
        return state
    waypoints = tuple(
        dataclasses.replace(w, scene=action.scene) if w.id == old.current else w
        for w in old.waypoints
    )
    return dataclasses.replace(state, history=dataclasses.replace(old, waypoints=waypoints))


def _told(panorama: Panorama, target: str) -> str:
    """Returns the outcome as the history tells it, with how far the target still is."""
    outcome = panorama.outcome
    if not target or (outcome.remaining is None and outcome.reason != ON_THE_WAY):
        return outcome.words
    if outcome.remaining is None:
        return f"{outcome.words}, too far to measure"
    told = f"{outcome.words}, {outcome.remaining:.1f} m from it"
    if outcome.height is None or abs(outcome.height) < 0.05:
        return told
    side = "higher" if outcome.height > 0 else "lower"
    return f"{told} (it is {abs(outcome.height):.1f} m {side})"


def _decided(
    old: History, action: LanguageAction, target: str, outcome: str, most: int
) -> tuple[DecisionRecord, ...]:
    if not action.n:
        return old.decisions
    record = DecisionRecord(
        action.n, action.call, action.tool, action.argument, old.current, target, outcome
    )
    decisions = (*old.decisions, record)
    return decisions[max(0, len(decisions) - most) :]


def _second_chance(
    n: int,
    current: int,
    panorama: Panorama,
    state: WaypointState,
    edges: tuple[Edge, ...],
    returned: Edge | None,
    window: tuple[KeyPicture, ...],
) -> SecondChance:
    # Nobody backtracks over stairs; who flies does not need any.
    here, flies = panorama.position[2], panorama.in_flight
    offers = tuple(
        w.id
        for w in state.history.waypoints
        if w.id != current and (flies or abs(w.position[2] - here) <= OTHER_FLOOR)
    )
    failed = tuple(edge for edge in edges if edge.failed)
    if returned is None:
        return SecondChance(n, offers, failed)
    # From leaving the place until the robot was back; nothing is kept on a way back.
    leg = tuple(p for p in state.pictures if _on_leg(p, returned))
    bearing = returned.bearing
    direction = direction_of(None if bearing is None else bearing - panorama.yaw)
    return SecondChance(n, offers, failed, direction, of_failed_leg(leg, window))


def _on_leg(picture: KeyPicture, leg: Edge) -> bool:
    """Whether a picture was taken between leaving a place and being back there."""
    gone = picture.n > leg.n or (picture.n == leg.n and bool(picture.direction))
    return gone and (leg.back is None or picture.n < leg.back)


def _place(
    state: WaypointState,
    panorama: Panorama,
    target: str,
    sight: Sight,
    bounds: MemoryBounds,
) -> tuple[WaypointState, int]:
    """Returns the memory with the place of a panorama in it, and the place's id."""
    history = state.history
    if panorama.first != panorama.n:
        return state, history.current
    near = min(
        history.waypoints, key=lambda w: math.dist(w.position, panorama.position), default=None
    )
    if near is not None and math.dist(near.position, panorama.position) < bounds.merge_distance:
        return state, near.id
    state = with_picture(state, sight, n=panorama.n, waypoint=state.next_id)
    added = Waypoint(
        id=state.next_id,
        n=panorama.n,
        position=panorama.position,
        heading=panorama.yaw,
        target_desc=target,
        picture=state.pictures[-1].number if state.pictures else 0,
    )
    waypoints = history.waypoints
    if len(waypoints) >= bounds.waypoints:
        # The start stays: it is the one place from which everything else was reached.
        waypoints = (waypoints[0], *waypoints[2:])
    history = dataclasses.replace(history, waypoints=(*waypoints, added))
    return dataclasses.replace(state, history=history, next_id=added.id + 1), added.id


def _mark_returned(edges: tuple[Edge, ...], place: int) -> tuple[tuple[Edge, ...], Edge | None]:
    """Marks the edge by which ``place`` was last left as given up; returns it, too.

    A way that ended half-way (stuck) was left as well; its own failure stays its outcome.
    """
    for i in reversed(range(len(edges))):
        edge = edges[i]
        if edge.waypoint == place and edge.left:
            if edge.arrived:
                edge = dataclasses.replace(edge, outcome="returned")
            return (*edges[:i], edge, *edges[i + 1 :]), edge
    return edges, None
