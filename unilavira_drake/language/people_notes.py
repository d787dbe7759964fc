"""People in words, beside the view in which they are."""

from __future__ import annotations

import math

from unilavira_drake.messages import VIEW_YAW, Panorama
from unilavira_drake.messages.people import PeopleTracks, PersonTrack

FORGOTTEN = 10.0
"""Who was last seen longer ago is not told of, seconds: longer than a look around takes."""
RECENT = 1.5
"""Who was seen that lately is told of without saying when, seconds."""
WALKING = 0.2
"""Who is slower stands, metres a second."""
MIDDLE = 3.0
"""Nearer to the middle of a view than this there is no left or right, degrees."""


def people_in_view(
    people: PeopleTracks, panorama: Panorama, view: str, time: float
) -> tuple[str, ...]:
    """Returns what is said of each person in the quarter about a view, nearest first.

    E.g. ``person in blue, 2.1 m, 10 degrees to the left, walking towards you``.

    Args:
        people: as the tracker knows them.
        panorama: of the place where the robot is.
        view: one of its level directions; of ``down`` nothing is said.
        time: now, seconds.
    """
    if view not in VIEW_YAW:
        return ()
    x, y, _ = panorama.position
    axis = panorama.yaw + VIEW_YAW[view]
    found = []
    for track in people.tracks:
        dx, dy = track.position[0] - x, track.position[1] - y
        bearing = math.degrees(math.remainder(math.atan2(dy, dx) - axis, 2 * math.pi))
        if time - track.time <= FORGOTTEN and -45.0 <= bearing < 45.0:
            found.append((math.hypot(dx, dy), track.label, _words(track, dx, dy, bearing, time)))
    return tuple(words for _, _, words in sorted(found))


def _words(track: PersonTrack, dx: float, dy: float, bearing: float, time: float) -> str:
    parts = [f"person in {track.color}", f"{math.hypot(dx, dy):.1f} m"]
    if abs(bearing) >= MIDDLE:
        parts.append(f"{abs(bearing):.0f} degrees to the {'left' if bearing > 0 else 'right'}")
    parts.append(_motion(track, dx, dy))
    if time - track.time > RECENT:
        parts.append(f"seen {time - track.time:.0f} s ago")
    return ", ".join(part for part in parts if part)


def _motion(track: PersonTrack, dx: float, dy: float) -> str:
    if track.velocity is None:
        return ""
    vx, vy = track.velocity
    if math.hypot(vx, vy) < WALKING:
        return "standing"
    distance = max(math.hypot(dx, dy), 1e-6)
    away = (vx * dx + vy * dy) / distance
    left = (vy * dx - vx * dy) / distance
    if abs(away) >= abs(left):
        return "walking away from you" if away > 0 else "walking towards you"
    return f"walking to the {'left' if left > 0 else 'right'}"
