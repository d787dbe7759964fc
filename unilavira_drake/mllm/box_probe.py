"""A picture with one known rectangle, and in which convention a model marks it.

Swapped axes or another scale cannot be seen in one reply about an unknown picture; here they can.
"""

from __future__ import annotations

import cv2
import numpy as np

from unilavira_drake.mllm.boxes import BOX_SPACES, Box
from unilavira_drake.mllm.reply_forms import GroundReply
from unilavira_drake.mllm.request import ImagePart, MllmRequest, VisionVariables

SIZE = (1280, 960)
"""Width and height; so large that Qwen2.5-VL shrinks it, which sets its pixels apart from ours."""
RECTANGLE: Box = (800.0, 110.0, 1150.0, 340.0)
"""(u_min, v_min, u_max, v_max) in pixels: off the diagonal, so that swapped axes miss it."""
_GROUND, _RED = (205, 205, 205), (40, 30, 215)
"""Blue, green, red."""
_JPEG_QUALITY = 92


def box_request(box_space: str) -> MllmRequest:
    """Returns the request to mark the red rectangle, for a model of a convention."""
    return MllmRequest(
        role="vision",
        n=1,
        call="ground",
        variables=VisionVariables(
            task="Go to the red rectangle.",
            direction="front",
            progress_analysis="The picture is a test: one red rectangle on a plain grey ground.",
            reasoning_action="Put a tight box around the whole red rectangle.",
            width=SIZE[0],
            height=SIZE[1],
            box_space=box_space,
        ),
        images=(ImagePart("view front", _picture(), "high"),),
    )


def box_fits(reply: GroundReply) -> dict[str, float]:
    """Returns how well a mark fits the rectangle in each convention, from 0 to 1.

    A box counts by its intersection over union, a point by whether it is inside; corners in the
    wrong order are swapped.  Empty when the reply marks nothing.
    """
    fits = {}
    for name, space in BOX_SPACES.items():
        if reply.box is not None:
            fits[name] = _overlap(space.to_pixels_box(reply.box, *SIZE))
        elif reply.point is not None:
            u, v = space.to_pixels_point(reply.point, *SIZE)
            inside = RECTANGLE[0] <= u <= RECTANGLE[2] and RECTANGLE[1] <= v <= RECTANGLE[3]
            fits[name] = float(inside)
    return fits


def _picture() -> bytes:
    image = np.full((SIZE[1], SIZE[0], 3), _GROUND, np.uint8)
    u_min, v_min, u_max, v_max = (round(side) for side in RECTANGLE)
    image[v_min:v_max, u_min:u_max] = _RED
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return data.tobytes()


def _overlap(box: Box) -> float:
    """Intersection over union with the rectangle."""
    u_min, u_max = sorted((box[0], box[2]))
    v_min, v_max = sorted((box[1], box[3]))
    width = min(u_max, RECTANGLE[2]) - max(u_min, RECTANGLE[0])
    height = min(v_max, RECTANGLE[3]) - max(v_min, RECTANGLE[1])
    shared = max(width, 0.0) * max(height, 0.0)
    own = (RECTANGLE[2] - RECTANGLE[0]) * (RECTANGLE[3] - RECTANGLE[1])
    return shared / (own + (u_max - u_min) * (v_max - v_min) - shared)
