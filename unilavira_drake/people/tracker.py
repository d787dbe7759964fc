"""Who is where and moves how, from pictures: the evidence that prompts tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageDepth32F, ImageLabel16I

from unilavira_drake.mapping.moving_things import LEAST_PIXELS
from unilavira_drake.messages import Intrinsics
from unilavira_drake.messages.people import PeopleTracks, PersonTrack
from unilavira_drake.ports import Level, image_input, pixels, pose_input, pose_matrix

DEPTH = 0.10
"""A body's middle lies so far behind what is seen of it, metres."""
STRIDE = 2
"""Every second row and column is read."""
LONGEST_GAP = 1.6
"""A velocity is told from two looks not farther apart than this, seconds."""
SMOOTHING = 0.5
"""Share of the newest look in a velocity."""


class PeopleTracker(Level):
    """Looks twice a second, and keeps where each person was last seen and how it moved.

    Label images say which pixels are whose (``perception: ground_truth``); where they are comes
    from depth and the pose estimate, how they move from two looks.  Who is not in view stays where
    last seen.

    .. pydrake_system::

        name: PeopleTracker
        input_ports:
        - (view).depth_image
        - (view).label_image
        - (view).X_BC
        - pose_estimate
        output_ports:
        - people

    Args:
        clothes: colour word of each person's clothes, by render label.
        intrinsics: of all views.
        views: names of the robot's cameras.
        period: seconds between two looks.
    """

    def __init__(
        self,
        *,
        clothes: Mapping[int, str],
        intrinsics: Intrinsics,
        views: Sequence[str] = ("front",),
        period: float = 0.5,
    ) -> None:
        super().__init__(PeopleTracks(), period=period)
        self._clothes = dict(sorted(clothes.items()))
        self._intrinsics = intrinsics
        self._cameras = [
            (
                image_input(self, f"{view}.depth_image", ImageDepth32F),
                image_input(self, f"{view}.label_image", ImageLabel16I),
                pose_input(self, f"{view}.X_BC"),
            )
            for view in views
        ]
        self._pose = pose_input(self, "pose_estimate")
        self.declare_output("people", lambda state: state, PeopleTracks())

    def step(self, context: Context, state: Any) -> Any:
        """Returns the tracks after a look; the same where nobody is in view."""
        X_WB = pose_matrix(self._pose(context))
        seen: dict[int, tuple[int, float, float]] = {}
        for depth, label, X_BC in self._cameras:
            places = find_people(
                pixels(label(context))[:, :, 0],
                pixels(depth(context))[:, :, 0],
                self._intrinsics,
                X_WB @ pose_matrix(X_BC(context)),
                tuple(self._clothes),
            )
            for key, place in places.items():
                seen[key] = max(seen.get(key, place), place)
        if not seen:
            return state
        old = {track.label: track for track in state.tracks}
        time = context.get_time()
        new = {
            key: follow(old.get(key), key, self._clothes[key], (x, y), time)
            for key, (_, x, y) in seen.items()
        }
        tracks = old | new
        return PeopleTracks(tuple(tracks[key] for key in sorted(tracks)))


def find_people(
    label: NDArray[np.int16],
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    X_WC: NDArray[np.float64],
    labels: Sequence[int],
) -> dict[int, tuple[int, float, float]]:
    """Returns pixels, x and y (metres in the world) of the people in a view, by label.

    Args:
        label: (H, W) int16.
        depth: (H, W) float32, metres along the camera's z.
        intrinsics: of the view.
        X_WC: (4, 4) pose of the camera in the world.
        labels: of people.
    """
    found = {}
    small, near = label[::STRIDE, ::STRIDE], depth[::STRIDE, ::STRIDE]
    for wanted in labels:
        v, u = np.nonzero((small == wanted) & np.isfinite(near) & (near > 0.0))
        if len(v) * STRIDE**2 < LEAST_PIXELS:
            continue
        z = near[v, u].astype(np.float64)
        rays = np.stack(
            (
                (STRIDE * u - intrinsics.cx) / intrinsics.fx * z,
                (STRIDE * v - intrinsics.cy) / intrinsics.fy * z,
                z,
            )
        )
        offset = np.median(X_WC[:2, :3] @ rays, axis=1)
        distance = max(float(np.hypot(*offset)), 1e-6)
        x, y = (X_WC[:2, 3] + offset * (1.0 + DEPTH / distance)).tolist()
        found[wanted] = (len(v) * STRIDE**2, x, y)
    return found


def follow(
    old: PersonTrack | None, label: int, color: str, position: tuple[float, float], time: float
) -> PersonTrack:
    """Returns the track of a person who was seen at a place just now."""
    velocity = None
    if old is not None and 0.0 < time - old.time <= LONGEST_GAP:
        gap = time - old.time
        velocity = (
            (position[0] - old.position[0]) / gap,
            (position[1] - old.position[1]) / gap,
        )
        if old.velocity is not None:
            velocity = (
                SMOOTHING * velocity[0] + (1.0 - SMOOTHING) * old.velocity[0],
                SMOOTHING * velocity[1] + (1.0 - SMOOTHING) * old.velocity[1],
            )
    return PersonTrack(label, color, position, velocity, time)
