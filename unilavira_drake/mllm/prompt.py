"""From a request's typed variables to the text that a real model reads.

The words live in ``prompts/`` as jinja2 templates without code; this module only renders them.
Everything that a model, a scene or a person has written is quoted as one JSON string, so it can
neither end its quotation nor start a line of the prompt.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import re
from dataclasses import dataclass

import jinja2

from unilavira_drake.messages import Message
from unilavira_drake.mllm.request import FreeVariables, ImagePart, MllmRequest
from unilavira_drake.resources import prompts_path


@dataclass(frozen=True)
class Prompt(Message):
    """What a model reads, in its order: texts and labelled pictures."""

    system: str = ""
    """The rules; the same at every call of an episode, so providers can cache them."""
    parts: tuple[str | ImagePart, ...] = ()

    @property
    def text(self) -> str:
        """All of it as one text, each picture as a line with its number and label."""
        lines, number = [self.system], 0
        for part in self.parts:
            if isinstance(part, ImagePart):
                number += 1
                lines.append(f"[picture {number}: {part.label}]\n")
            else:
                lines.append(part)
        return "".join(lines)

    @property
    def images(self) -> tuple[ImagePart, ...]:
        """The pictures in their order."""
        return tuple(part for part in self.parts if isinstance(part, ImagePart))


def compose_prompt(request: MllmRequest) -> Prompt:
    """Returns the prompt of a request as the texts and pictures that go to a model."""
    if isinstance(request.variables, FreeVariables):
        return Prompt(parts=(*request.images, request.variables.text))
    return Prompt(parts=(*request.images, render_prompt(request)))


def render_prompt(request: MllmRequest) -> str:
    """Returns the prompt of a request: stable rules first, the situation and the TODO list last.

    The ground-truth evidence of a request is never part of it; its images are named in their
    order and travel beside the text.

    Raises:
        jinja2.TemplateError: if the call or the family has no template, or a template names a
            variable that the request lacks (both are bugs, not conditions).
    """
    template = _environment().get_template(f"{request.role}/{request.call}.txt.j2")
    variables = request.variables
    values = {field.name: getattr(variables, field.name) for field in dataclasses.fields(variables)}
    text = template.render(
        **values,
        call=request.call,
        feedback=request.feedback,
        pictures=tuple(image.label for image in request.images),
    )
    # Blocks that say nothing leave their blank lines; what is quoted never spans lines.
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


@functools.lru_cache(maxsize=1)
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(prompts_path()),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        auto_reload=False,
        # Plain text for a model: HTML escapes would only garble it.
        autoescape=False,
    )
    environment.filters.update(quote=_quote, metres=_metres, bearing=_bearing)
    return environment


def _quote(text: str) -> str:
    """Returns the text on one line as a JSON string."""
    return json.dumps(" ".join(text.split()), ensure_ascii=False)


def _metres(distance: float) -> str:
    if not math.isfinite(distance):
        return "beyond what the camera measures"
    return f"{distance:.1f} m"


def _bearing(degrees: float) -> str:
    """Returns an angle to the left of the present front in words."""
    angle = round(math.remainder(degrees, 360.0) / 5.0) * 5
    if angle == 0:
        return "straight to the front"
    if abs(angle) == 180:
        return "straight to the back"
    return f"{abs(angle)} degrees to the {'left' if angle > 0 else 'right'}"
