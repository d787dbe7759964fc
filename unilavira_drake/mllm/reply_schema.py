"""The JSON schema of a reply, narrowed to what a request offers and in each provider's dialect.

A schema that a server enforces makes many a re-ask needless: what is not offered cannot be
written.  It replaces no check, for servers differ in what they enforce.
"""

from __future__ import annotations

import copy
import functools
import json
from collections.abc import Callable
from typing import Any

from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.reply_forms import reply_schema
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, VisionVariables

Schema = dict[str, Any]


def request_schema(request: MllmRequest) -> Schema | None:
    """Returns the schema of a reply to this request, or None where any text will do.

    It holds no references.  Against the form of the call it leaves out what the request does
    not offer: ``go_stair`` for a robot that cannot climb, ``backtrack`` to other waypoints than
    the offered ones, the direction that has just failed, ``fly`` without the direction block,
    positions outside of the TODO list, all TODO fields without a list, and answers outside a
    closed vocabulary.
    """
    variables = request.variables
    in_flight = isinstance(variables, LanguageVariables) and variables.in_flight
    schema = copy.deepcopy(_form(request.call, in_flight))
    if schema is None:
        return None
    properties = schema["properties"]
    if isinstance(variables, LanguageVariables):
        if request.call == "plan_todo":
            properties["todo"]["minItems"] = 1
        if request.call == "answer":
            properties["evidence"]["maxItems"] = len(request.picture_names)
            if request.picture_names:
                properties["evidence"]["items"]["enum"] = list(request.picture_names)
            if variables.choices:
                properties["answer"]["enum"] = list(variables.choices)
        if "action" in properties:
            _narrow_tools(properties["action"], request.call, variables)
            _narrow_todo(schema, variables)
    elif isinstance(variables, VisionVariables):
        for name in ("box", "point"):
            _narrow_place(properties[name], variables)
    return schema


def gemini_schema(schema: Schema) -> Schema:
    """Returns a schema in the subset that Gemini's ``responseJsonSchema`` takes.

    Constants become enumerations of one, ``anyOf`` stands for ``oneOf``, and every property is
    required: Gemini writes required ones first and in their order, so reasoning comes before
    what it decides.
    """
    return _rewritten(schema, _for_gemini)


def openai_schema(schema: Schema) -> Schema:
    """Returns a schema as OpenAI's strict mode demands it: all required, nothing further."""
    return _rewritten(schema, _for_openai)


def schema_prompt(schema: Schema) -> str:
    """Returns the sentence that asks for a reply of this schema where no server enforces it."""
    text = json.dumps(openai_schema(schema), ensure_ascii=False, separators=(",", ":"))
    return (
        f"\nReply with one JSON object and nothing else, valid against this JSON schema:\n{text}\n"
    )


@functools.cache
def _form(call: str, in_flight: bool) -> Schema | None:
    schema = reply_schema(call, in_flight=in_flight)
    return None if schema is None else _without_references(schema, schema.get("$defs", {}))


def _without_references(value: Any, definitions: Schema) -> Any:
    if isinstance(value, list):
        return [_without_references(item, definitions) for item in value]
    if not isinstance(value, dict):
        return value
    reference = value.get("$ref")
    if isinstance(reference, str):
        beside = {key: item for key, item in value.items() if key != "$ref"}
        target = definitions[reference.rpartition("/")[2]]
        return _without_references({**copy.deepcopy(target), **beside}, definitions)
    return {
        key: _without_references(item, definitions) for key, item in value.items() if key != "$defs"
    }


def _choices(union: Schema) -> list[Schema]:
    """The forms among which a value may choose."""
    return union.get("oneOf") or union.get("anyOf") or [union]


def _constant(form: Schema, name: str) -> Any:
    """The value that a property of a form is bound to."""
    return form["properties"].get(name, {}).get("const")


def _keep(union: Schema, forms: list[Schema]) -> None:
    key = "oneOf" if "oneOf" in union else "anyOf"
    union[key] = forms


def _narrow_tools(union: Schema, call: str, variables: LanguageVariables) -> None:
    offered = [note.id for note in variables.waypoints if note.offered]
    forms = []
    for form in _choices(union):
        tool = _constant(form, "tool")
        if tool == "turn" and call == "recover":
            direction = form["properties"]["direction"]
            direction["enum"] = [
                word for word in direction["enum"] if word != variables.failed_direction
            ]
        if tool == "backtrack":
            if not (variables.second_chance and offered):
                continue
            form["properties"]["waypoint"]["enum"] = offered
        if tool == "go_stair" and not variables.can_climb:
            continue
        if tool == "fly" and variables.bearings is None:
            continue
        forms.append(form)
    _keep(union, forms)


def _narrow_todo(schema: Schema, variables: LanguageVariables) -> None:
    properties = schema["properties"]
    if variables.todo is None:
        for name in ("reasoning_todo", "todo_updates"):
            properties.pop(name, None)
        required = schema.get("required", [])
        schema["required"] = [name for name in required if name in properties]
        return
    last = len(variables.todo)
    union = properties["todo_updates"]["items"]
    forms = []
    for form in _choices(union):
        adds = _constant(form, "op") == "add"
        if not adds and not last:
            continue
        for index in _choices(form["properties"]["index"]):
            if index.get("type") == "integer":
                index.update(minimum=1, maximum=last + 1 if adds else last)
        forms.append(form)
    _keep(union, forms)


def _narrow_place(place: Schema, variables: VisionVariables) -> None:
    """Bounds the coordinates of a box or a point; they belong to the space, not to the form."""
    space = BOX_SPACES.get(variables.box_space)
    number: Schema = {"type": "number", "minimum": 0}
    if space is not None:
        number["maximum"] = max(space.size(variables.width, variables.height))
    if space is not None and space.is_grid:
        number["type"] = "integer"
    for form in _choices(place):
        if form.get("type") == "array":
            form["items"] = number


def _rewritten(schema: Schema, rewrite: Callable[[Schema], Schema]) -> Schema:
    """Rewrites every schema inside a schema, the innermost first."""
    result: Schema = {}
    for key, item in schema.items():
        if key == "properties":
            result[key] = {name: _rewritten(form, rewrite) for name, form in item.items()}
        elif key in ("anyOf", "oneOf", "prefixItems"):
            result[key] = [_rewritten(form, rewrite) for form in item]
        elif key == "items":
            result[key] = _rewritten(item, rewrite)
        else:
            result[key] = item
    return rewrite(result)


def _plain(schema: Schema) -> Schema:
    """What both dialects want: no titles, defaults or discriminators, and ``anyOf``."""
    dropped = ("title", "default", "discriminator", "examples")
    plain = {key: item for key, item in schema.items() if key not in dropped}
    if "oneOf" in plain:
        plain["anyOf"] = plain.pop("oneOf")
    if "properties" in plain:
        plain["required"] = list(plain["properties"])
        plain.pop("description", None)  # A class's docstring speaks to programmers.
    return plain


def _for_openai(schema: Schema) -> Schema:
    plain = _plain(schema)
    if "properties" in plain:
        plain["additionalProperties"] = False
    return plain


def _for_gemini(schema: Schema) -> Schema:
    plain = _plain(schema)
    plain.pop("additionalProperties", None)
    if "const" in plain:
        plain["enum"] = [plain.pop("const")]
    forms = plain.get("anyOf", [])
    if len(forms) == 2 and {"type": "null"} in forms:
        other = next(form for form in forms if form != {"type": "null"})
        if isinstance(other.get("type"), str):
            beside = {key: item for key, item in plain.items() if key != "anyOf"}
            return {**other, **beside, "type": [other["type"], "null"]}
    return plain
