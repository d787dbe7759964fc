"""What a reply of the vision model means: its translation into a vision action (paper III-B2)."""

from __future__ import annotations

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.messages import VisionAction
from unilavira_drake.mllm.reply_forms import GroundReply
from unilavira_drake.mllm.reply_model import bounded, clipped
from unilavira_drake.mllm.request import MllmRequest, VisionVariables

MIN_BOX_AREA = 16.0
"""Square pixels."""
TARGET_LIMIT = 120
REASON_LIMIT = 400


def parse_vision_reply(text: str, request: MllmRequest) -> VisionAction:
    """Returns the vision action that a reply to this request means.

    A box that reaches over the edge of the image is clipped to it.

    Raises:
        ReplyFormatError: if the text has another form; if both a box and a point are given, or
            neither and no reason; if the box is turned round or covers less than 16 square
            pixels of the image; if the point is outside.  The sentence can go into a re-ask.
    """
    variables = request.variables
    if not isinstance(variables, VisionVariables):
        raise TypeError(f"request {request.n} of role {request.role!r} has no vision variables")
    reply = GroundReply.read(text)
    if reply.box is not None and reply.point is not None:
        raise ReplyFormatError("both box and point are given; give one and set the other to null.")
    target = bounded(reply.target_desc, TARGET_LIMIT, "target_desc")
    if reply.box is None and reply.point is None:
        reason = clipped(reply.reason, REASON_LIMIT)
        if not reason:
            raise ReplyFormatError(
                "box and point are null and reason is empty; mark the target or say why not."
            )
        return VisionAction(
            n=request.n, direction=variables.direction, target_desc=target, reason=reason
        )
    if not target:
        raise ReplyFormatError("target_desc is empty; say in a few words what is marked.")
    return VisionAction(
        n=request.n,
        direction=variables.direction,
        box=None if reply.box is None else _clipped_box(reply.box, variables),
        point=None if reply.point is None else _point_inside(reply.point, variables),
        target_desc=target,
        confidence=reply.confidence,
    )


def _clipped_box(box: list[float], variables: VisionVariables) -> tuple[float, float, float, float]:
    u_min, v_min, u_max, v_max = box
    if not (u_min < u_max and v_min < v_max):
        raise ReplyFormatError(
            f"box {box} is turned round; it must be [u_min, v_min, u_max, v_max] with "
            "u_min < u_max and v_min < v_max."
        )
    u_min, u_max = max(u_min, 0.0), min(u_max, float(variables.width))
    v_min, v_max = max(v_min, 0.0), min(v_max, float(variables.height))
    if max(u_max - u_min, 0.0) * max(v_max - v_min, 0.0) < MIN_BOX_AREA:
        raise ReplyFormatError(
            f"box {box} covers less than {MIN_BOX_AREA:g} square pixels of the image, which is "
            f"{variables.width} wide and {variables.height} high; give pixels of this image."
        )
    return u_min, v_min, u_max, v_max


def _point_inside(point: list[float], variables: VisionVariables) -> tuple[float, float]:
    u, v = point
    if not (0.0 <= u < variables.width and 0.0 <= v < variables.height):
        raise ReplyFormatError(
            f"point {point} is outside the image, which is {variables.width} wide and "
            f"{variables.height} high; give pixels of this image."
        )
    return u, v
