"""From a request's typed variables to the texts and pictures that a real model reads.

The words live in ``prompts/`` as jinja2 templates without code; this module only renders them.
Everything that a model, a scene or a person has written is quoted as one JSON string of bounded
length, so it can neither end its quotation nor start a line of the prompt.

What stays the same from call to call comes first, for the caches of providers: the rules, the
task, the pictures of the past, which are only added to until some are dropped in a block.
Then comes what changes: notes, this call's question, the views, events, the TODO list.
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
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.request import (
    VIEW_LABEL,
    FreeVariables,
    ImagePart,
    MllmRequest,
    VisionVariables,
)
from unilavira_drake.resources import prompts_path


@dataclass(frozen=True)
class Place:
    """A picture as templates see it: its label, and its index in the request."""

    label: str
    index: int


@dataclass(frozen=True)
class Prompt(Message):
    """What a model reads, in its order: texts and labelled pictures."""

    system: str = ""
    """The rules; the same at every call of an episode, so providers can cache them."""
    parts: tuple[str | ImagePart, ...] = ()

    @property
    def text(self) -> str:
        """All of it as one text, each picture as a line with its number and label."""
        lines, number = [self.system + "\n"] if self.system else [], 0
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
    """Returns the prompt of a request as the texts and pictures that go to a model.

    The ground-truth evidence of a request is never part of it.  An image whose label is ``view``
    and the direction of a view stands beside that view's line; all others are pictures of the
    past, in their order.  A free text is sent as it is, after its pictures.

    Raises:
        jinja2.TemplateError: if the call or the family has no template, or a template names a
            variable that the request lacks (both are bugs, not conditions).
    """
    variables = request.variables
    if isinstance(variables, FreeVariables):
        return Prompt(parts=(*request.images, variables.text))
    values = {field.name: getattr(variables, field.name) for field in dataclasses.fields(variables)}
    if isinstance(variables, VisionVariables):
        directions = [variables.direction]
        values["places"] = BOX_SPACES[variables.box_space].rule(variables.width, variables.height)
    else:
        directions = [view.direction for view in variables.views]
    labels = {f"{VIEW_LABEL}{direction}" for direction in directions}
    places = tuple(Place(image.label, index) for index, image in enumerate(request.images))
    values |= {
        "feedback": request.feedback,
        "past": tuple(place for place in places if place.label not in labels),
        "current": tuple(place for place in places if place.label in labels),
    }
    system = _rendered(f"{request.role}/system.txt.j2", values)
    text = _rendered(f"{request.role}/{request.call}.txt.j2", values)
    return Prompt(system, _placed(text, request.images))


def template_text(template: str, **values: object) -> str:
    """Returns the text of a template that is sent word for word, outside of any episode.

    Raises:
        jinja2.TemplateError: if there is no such template, or it names a value that is not given.
    """
    return _rendered(template, values)


def _rendered(template: str, values: dict[str, object]) -> str:
    text = _environment().get_template(template).render(**values)
    # Blocks that say nothing leave their blank lines; what is quoted never spans lines.
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def _placed(text: str, images: tuple[ImagePart, ...]) -> tuple[str | ImagePart, ...]:
    """Returns the text cut at its sentinels, with the pictures between."""
    pieces = re.split(f"{_SENTINEL}(\\d+){_SENTINEL}\n", text)
    parts = [images[int(piece)] if i % 2 else piece for i, piece in enumerate(pieces)]
    return tuple(part for part in parts if part)


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
    environment.filters.update(
        quote=_quote,
        line=_line,
        picture=_picture,
        metres=_metres,
        bearing=_bearing,
        compass=_compass,
    )
    return environment


_SENTINEL = "\x1f"
"""Stands around a picture's place in the rendered text; no quoted text can hold it."""


def _quote(text: str, limit: int = 400) -> str:
    """Returns the text on one line as a JSON string; what is over the limit is cut off."""
    line = _line(text)
    return json.dumps(line if len(line) <= limit else line[: limit - 1] + "…", ensure_ascii=False)


def _line(text: str) -> str:
    """Returns the text on one line, without control characters and lone surrogates."""
    # Categories C*: controls, invisible formats, surrogates and private or unassigned ones.
    return " ".join("".join(c if c.isprintable() or c.isspace() else " " for c in text).split())


def _picture(place: Place) -> str:
    return f"{_SENTINEL}{place.index}{_SENTINEL}"


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


def _compass(degrees: float) -> str:
    """Returns an angle from north, clockwise, in words."""
    points = [
        "north",
        "north-east",
        "east",
        "south-east",
        "south",
        "south-west",
        "west",
        "north-west",
    ]
    return f"{points[round(degrees / 45.0) % 8]} ({degrees % 360.0:.0f} degrees by the compass)"
