"""How many input tokens a prompt will be counted as, before anybody has counted them.

An estimate for rate limits and plans: pictures by the profile's rule, texts at four characters a
token, which is what English prose comes to with the usual tokenizers (JSON takes a quarter more).
What a call has really cost is told by its server and stands in the ledger.
"""

from __future__ import annotations

import functools
import math
import struct

from unilavira_drake.mllm.profile import ImageTokens, Profile
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.request import ImagePart

CHARACTERS_PER_TOKEN = 4
UNKNOWN_RULE = ImageTokens(square=28)
"""For a profile without a rule: what Qwen2.5-VL takes, more than most others."""
_UNKNOWN_SIZE = (640, 480)


def estimated_tokens(prompt: Prompt, profile: Profile) -> int:
    """Returns about how many input tokens a prompt has for a model."""
    texts = [prompt.system, *(part for part in prompt.parts if isinstance(part, str))]
    pictures = sum(picture_tokens(image, profile.image_tokens) for image in prompt.images)
    return text_tokens("".join(texts)) + pictures


def text_tokens(text: str) -> int:
    """Returns about how many tokens a text has."""
    return math.ceil(len(text) / CHARACTERS_PER_TOKEN)


def picture_tokens(image: ImagePart, rule: ImageTokens | None) -> int:
    """Returns how many tokens a picture takes by a provider's rule, or about so without one."""
    rule = rule or UNKNOWN_RULE
    if rule.square is None:
        fixed = {"low": rule.low, "medium": rule.medium, "high": rule.high}.get(image.detail)
        known = [count for count in (rule.low, rule.medium, rule.high) if count is not None]
        return fixed if fixed is not None else max(known, default=0)
    width, height = jpeg_size(image.jpeg) or _UNKNOWN_SIZE
    return max(1, round(width / rule.square)) * max(1, round(height / rule.square))


@functools.lru_cache(maxsize=256)
def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Returns the width and height of a JPEG image in pixels, or None if it is none."""
    position = 2
    while data[:2] == b"\xff\xd8" and position + 9 <= len(data) and data[position] == 0xFF:
        marker = data[position + 1]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, position + 5)
            return width, height
        if marker == 0xFF:  # A fill byte.
            position += 1
            continue
        position += 2 + struct.unpack_from(">H", data, position + 2)[0]
    return None
