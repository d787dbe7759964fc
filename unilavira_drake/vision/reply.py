"""What a reply of the vision model means: its translation into a vision action (paper III-B2)."""

from __future__ import annotations

import math

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.messages import VisionAction
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.reply_forms import GroundReply
from unilavira_drake.mllm.reply_model import bounded, clipped, listed_repairs
from unilavira_drake.mllm.request import MllmRequest, VisionVariables

MIN_BOX_AREA = 16.0
"""Square pixels."""
TOLERANCE = 0.02
"""How far a number may lie outside of the picture, as a share of the side: models that count to
1000 now and then write 1004."""
TARGET_LIMIT = 120
REASON_LIMIT = 400

CLAMPED = "{place} reached over the edge of the picture and was cut to it"
REORDERED = "the corners of box were in the wrong order and were swapped"

_ROUNDING = 1e-9
"""What a conversion between spaces may add, as a share of the side."""


def parse_vision_reply(text: str, request: MllmRequest) -> VisionAction:
    """Returns the vision action that a reply to this request means, in pixels of the view.

    The reply is read in the request's ``box_space``, and what is wrong with it is told in the same
    space.  A box or point that reaches over the edge by at most 2% of the side is cut to the
    picture and corners in the wrong order are swapped; both are named as repairs.

    Raises:
        ReplyFormatError: if the text has another form; if both a box and a point are given, or
            neither and no reason; if one lies farther outside of the picture; if the box covers
            less than 16 square pixels of it.  The sentence can go into a re-ask.
    """
    variables = request.variables
    if not isinstance(variables, VisionVariables):
        raise TypeError(f"request {request.n} of role {request.role!r} has no vision variables")
    reply, found = GroundReply.read(text)
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
            n=request.n,
            direction=variables.direction,
            target_desc=target,
            reason=reason,
            repairs=found,
        )
    if not target:
        raise ReplyFormatError("target_desc is empty; say in a few words what is marked.")
    repairs = list(found)
    return VisionAction(
        n=request.n,
        direction=variables.direction,
        box=None if reply.box is None else _box(reply.box, variables, repairs),
        point=None if reply.point is None else _point(reply.point, variables, repairs),
        target_desc=target,
        confidence=reply.confidence,
        repairs=listed_repairs(repairs),
    )


def _box(
    given: list[float], variables: VisionVariables, repairs: list[str]
) -> tuple[float, float, float, float]:
    space = BOX_SPACES[variables.box_space]
    width, height = variables.width, variables.height
    box = space.to_pixels_box(_inside(given, "box", variables, repairs), width, height)
    u_min, u_max = sorted((box[0], box[2]))
    v_min, v_max = sorted((box[1], box[3]))
    if (u_max - u_min) * (v_max - v_min) < MIN_BOX_AREA:
        columns, rows = space.size(width, height)
        least = math.ceil(MIN_BOX_AREA * columns * rows / (width * height))
        unit = "units" if space.is_grid else "pixels"
        raise ReplyFormatError(
            f"box {_shown(given)} is too small: it must be {space.box_order} "
            f"{space.extent(width, height)} and cover at least {least} square {unit}."
        )
    if (u_min, v_min, u_max, v_max) != box:
        repairs.append(REORDERED)
    return u_min, v_min, u_max, v_max


def _point(
    given: list[float], variables: VisionVariables, repairs: list[str]
) -> tuple[float, float]:
    space = BOX_SPACES[variables.box_space]
    width, height = variables.width, variables.height
    inside = _inside(given, "point", variables, repairs)
    u, v = space.to_pixels_point(inside, width, height)
    # The far edges belong to the space but to no pixel.
    return (u if u < width else width - 1.0), (v if v < height else height - 1.0)


def _inside(
    given: list[float], place: str, variables: VisionVariables, repairs: list[str]
) -> list[float]:
    """Returns the numbers within the picture, in the model's own space.

    Raises:
        ReplyFormatError: if one is too far outside.
    """
    space = BOX_SPACES[variables.box_space]
    width, height = variables.width, variables.height
    limits = [*space.uv(space.size(width, height))] * 2
    values = [min(max(x, 0.0), float(side)) for x, side in zip(given, limits, strict=False)]
    excess = max(abs(x - y) / side for x, y, side in zip(given, values, limits, strict=False))
    if excess > TOLERANCE + _ROUNDING:
        order = space.box_order if place == "box" else space.point_order
        raise ReplyFormatError(
            f"{place} {_shown(given)} is outside of the picture; it must be {order} "
            f"{space.extent(width, height)}."
        )
    if excess > _ROUNDING:
        repairs.append(CLAMPED.format(place=place))
    return values


def _shown(numbers: list[float]) -> str:
    return f"[{', '.join(f'{number:g}' for number in numbers)}]"
