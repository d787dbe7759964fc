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

import jinja2

from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.resources import prompts_path


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
