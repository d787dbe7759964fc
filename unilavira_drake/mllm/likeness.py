"""Whether a request is the one that was recorded, though another machine computed it.

Another CPU rounds otherwise, so the last shown digit of a number may differ; another rasteriser
draws an edge otherwise, so a picture may differ in its bytes and not in what it shows.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import re

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.mllm.prompt import Prompt

LOOK_TOLERANCE = 3
"""Grey levels by which a field of a picture's look may differ."""
BEARING_STEP = 5
"""Degrees to which bearings in a prompt are rounded."""
_LOOK_SIZE = (4, 3)
_SHOWN = 160

_NUMBER = re.compile(r"(\d+(?:\.\d+)?)")
_BEARING = re.compile(r"straight to the (front|back)|(\d+) degrees to the (left|right)")


def content_digest(prompt: Prompt) -> str:
    """Returns the SHA-256 of a prompt's words and pictures."""
    whole = hashlib.sha256(prompt.text.encode("utf-8", "surrogatepass"))
    for image in prompt.images:
        whole.update(hashlib.sha256(image.jpeg).digest())
    return whole.hexdigest()


@functools.lru_cache(maxsize=64)
def look(jpeg: bytes) -> str:
    """Returns a coarse signature of a picture: mean colours of 4 x 3 fields in hex.

    Empty when it cannot be read.
    """
    data: NDArray[np.uint8] = np.frombuffer(jpeg, dtype=np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if image is None:
        return ""
    fields = cv2.resize(image, _LOOK_SIZE, interpolation=cv2.INTER_AREA)
    return bytes(fields).hex()


def same_look(one: str, other: str) -> bool:
    """Whether two looks are of pictures that show the same."""
    if not one or len(one) != len(other):
        return False
    pairs = zip(bytes.fromhex(one), bytes.fromhex(other), strict=True)
    return all(abs(a - b) <= LOOK_TOLERANCE for a, b in pairs)


def prompt_difference(recorded: str, asked: str) -> str:
    """Returns the first line in which two prompts differ, both shown; empty when they agree.

    Prompts agree when their words are equal and each number is equal up to one unit of its last
    shown digit: 0.1 m, or 5 degrees of a bearing.  Whole numbers count things and must be equal.
    """
    lines = itertools.zip_longest(recorded.splitlines(), asked.splitlines())
    for number, (before, now) in enumerate(lines, start=1):
        if before is None or now is None or not _alike(before, now):
            return f"line {number} was {_quoted(before)} and is now {_quoted(now)}"
    return ""


def _alike(before: str, now: str) -> bool:
    if before == now:
        return True
    one, other = (_NUMBER.split(_BEARING.sub(_plain_bearing, text)) for text in (before, now))
    if one[::2] != other[::2]:
        return False
    pairs = zip(one[1::2], other[1::2], one[2::2], strict=True)
    return all(_near(a, b, after) for a, b, after in pairs)


def _plain_bearing(match: re.Match[str]) -> str:
    """The same bearing in one form, so that both sides of the front are close to each other."""
    ahead, degrees, side = match.groups()
    if ahead:
        angle = 0 if ahead == "front" else 180
    else:
        angle = int(degrees) if side == "left" else -int(degrees) % 360
    return f"{angle} degrees to the left"


def _near(a: str, b: str, after: str) -> bool:
    if after.startswith(" degrees"):
        turned = abs(float(a) - float(b)) % 360
        return min(turned, 360 - turned) <= BEARING_STEP
    if "." in a and "." in b:
        decimals = min(len(text.partition(".")[2]) for text in (a, b))
        return abs(float(a) - float(b)) <= 1.01 * 0.1**decimals
    return a == b


def _quoted(line: str | None) -> str:
    if line is None:
        return "missing"
    return repr(line if len(line) <= _SHOWN else line[: _SHOWN - 1] + "…")
