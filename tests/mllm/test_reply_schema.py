"""What a narrowed schema allows, the parser accepts; both dialects keep to their subsets."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.messages import CALLS, DIRECTIONS, DOWN, TodoItem
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.reply_schema import (
    gemini_schema,
    openai_schema,
    request_schema,
    schema_prompt,
)
from unilavira_drake.mllm.request import (
    DirectionNote,
    FreeVariables,
    ImagePart,
    LanguageVariables,
    MllmRequest,
    VisionVariables,
    WaypointNote,
)

VARIABLES = LanguageVariables(
    todo=(TodoItem("Leave the bedroom"), TodoItem("Stop at the sofa")),
    waypoints=(
        WaypointNote(id=1, offered=True),
        WaypointNote(id=2),
        WaypointNote(id=7, offered=True),
    ),
    current_waypoint=2,
    can_climb=True,
)
DECIDE = MllmRequest(n=3, call="decide", variables=VARIABLES)
KEYWORDS = {
    "gemini": {
        "$id", "$defs", "$ref", "$anchor", "type", "format", "title", "description", "enum",
        "items", "prefixItems", "minItems", "maxItems", "minimum", "maximum", "anyOf", "oneOf",
        "properties", "additionalProperties", "required",
    },
    "openai": {
        "type", "description", "enum", "const", "items", "minItems", "maxItems", "minimum",
        "maximum", "anyOf", "properties", "additionalProperties", "required",
    },
}  # fmt: skip


def changed(request: MllmRequest = DECIDE, **changes: Any) -> MllmRequest:
    return dataclasses.replace(request, variables=dataclasses.replace(request.variables, **changes))


def ground(space: str) -> MllmRequest:
    variables = VisionVariables(width=640, height=480, box_space=space)
    return MllmRequest(role="vision", call="ground", variables=variables)


REQUESTS = {
    **{call: dataclasses.replace(DECIDE, call=call) for call in CALLS},
    "failed_direction": changed(
        dataclasses.replace(DECIDE, call="recover"), failed_direction="left", can_climb=False
    ),
    "empty_list": changed(todo=()),
    "no_list": changed(todo=None),
    "no_way_back": changed(waypoints=()),
    "no_second_chance": changed(second_chance=False),
    "in_flight": changed(in_flight=True),
    "by_numbers": changed(in_flight=True, bearings=DirectionNote()),
    "down_failed": changed(
        dataclasses.replace(DECIDE, call="recover"), in_flight=True, failed_direction="down"
    ),
    **{space: ground(space) for space in BOX_SPACES},
}


def instances(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Returns values that a schema of our subset allows."""
    if "anyOf" in schema:
        return st.one_of([instances(form) for form in schema["anyOf"]])
    if "enum" in schema or "const" in schema:
        return st.sampled_from(schema.get("enum") or [schema["const"]])
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    return st.one_of([_of_kind(kind, schema) for kind in kinds])


def _of_kind(kind: str, schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    if kind == "object":
        assert schema["required"] == list(schema["properties"])
        return st.fixed_dictionaries(
            {name: instances(form) for name, form in schema["properties"].items()}
        )
    if kind == "array":
        least, most = schema.get("minItems", 0), schema.get("maxItems", 4)
        return st.lists(instances(schema["items"]), min_size=least, max_size=most)
    if kind in ("integer", "number"):
        numbers: Any = st.integers if kind == "integer" else st.floats
        return numbers(schema.get("minimum", -9), schema.get("maximum", 9))
    return {"string": st.sampled_from(["a white door", "the sofa"]), "boolean": st.booleans(),
            "null": st.none()}[kind]  # fmt: skip


def parts(schema: Any) -> Iterator[dict[str, Any]]:
    """Yields every schema inside a schema."""
    yield schema
    inner = [*schema.get("properties", {}).values(), *schema.get("anyOf", [])]
    for form in [*inner, *([schema["items"]] if "items" in schema else [])]:
        yield from parts(form)


@pytest.mark.parametrize("to_dialect", [openai_schema, gemini_schema])
@pytest.mark.parametrize(
    "name", [name for name, request in REQUESTS.items() if request.role == "language"]
)
def test_what_the_schema_allows_the_parser_accepts(name: str, to_dialect: Any) -> None:
    request = REQUESTS[name]
    schema = request_schema(request)
    assert schema is not None

    @settings(derandomize=True, deadline=None, max_examples=40)
    @given(instances(to_dialect(schema)))
    def accepts(reply: Any) -> None:
        parse_language_reply(json.dumps(reply), request)

    accepts()


@pytest.mark.parametrize("name", REQUESTS)
def test_both_dialects_keep_to_their_subset(name: str) -> None:
    schema = request_schema(REQUESTS[name])
    assert schema is not None
    for dialect, form in (("gemini", gemini_schema(schema)), ("openai", openai_schema(schema))):
        for part in parts(form):
            assert set(part) <= KEYWORDS[dialect], part
            if "properties" in part:
                assert part["required"] == list(part["properties"])
        assert "paper" not in json.dumps(form)


def test_reasoning_comes_before_what_it_decides() -> None:
    schema = request_schema(DECIDE)
    assert schema is not None
    assert gemini_schema(schema)["required"] == [
        "progress_analysis",
        "reasoning_todo",
        "todo_updates",
        "reasoning_action",
        "action",
        "scene",
    ]


def tools(request: MllmRequest) -> dict[str, Any]:
    schema = request_schema(request)
    assert schema is not None
    forms = openai_schema(schema)["properties"]["action"]["anyOf"]
    return {form["properties"]["tool"]["const"]: form["properties"] for form in forms}


def test_only_what_is_offered_can_be_written() -> None:
    offered = tools(DECIDE)
    assert set(offered) == {"turn", "backtrack", "go_stair", "double_check"}
    assert offered["backtrack"]["waypoint"]["enum"] == [1, 7]
    assert set(tools(changed(can_climb=False))) == {"turn", "backtrack", "double_check"}
    assert "backtrack" not in tools(changed(second_chance=False))
    assert "backtrack" not in tools(changed(waypoints=()))
    failed = tools(REQUESTS["failed_direction"])
    assert failed["turn"]["direction"]["enum"] == ["front", "right", "back"]
    assert tools(DECIDE)["turn"]["direction"]["enum"] == ["front", "left", "right", "back"]


def test_without_a_list_there_are_no_words_of_it() -> None:
    schema = request_schema(changed(todo=None))
    assert schema is not None
    assert not {"reasoning_todo", "todo_updates"} & set(schema["properties"])


def test_an_answer_keeps_to_its_vocabulary_and_its_pictures() -> None:
    images = (ImagePart("H3: front view at waypoint 1"), ImagePart("view left"))
    answer = MllmRequest(
        call="answer", variables=LanguageVariables(choices=("yes", "no")), images=images
    )
    schema = request_schema(answer)
    assert schema is not None
    assert schema["properties"]["answer"]["enum"] == ["yes", "no"]
    assert schema["properties"]["evidence"]["items"]["enum"] == ["H3", "left"]
    schema = request_schema(dataclasses.replace(answer, variables=LanguageVariables()))
    assert schema is not None
    assert "enum" not in schema["properties"]["answer"]


def test_an_empty_list_can_only_grow() -> None:
    schema = request_schema(changed(todo=()))
    assert schema is not None
    forms = openai_schema(schema)["properties"]["todo_updates"]["items"]["anyOf"]
    assert [form["properties"]["op"]["const"] for form in forms] == ["add"]


@pytest.mark.parametrize(
    ("space", "kind", "most"),
    [
        ("pixels", "number", 640),
        ("xyxy_1000", "integer", 1000),
        ("yxyx_1000", "integer", 1000),
        ("xyxy_resized", "number", 644),
    ],
)
def test_places_are_bounded_by_their_space(space: str, kind: str, most: int) -> None:
    schema = request_schema(ground(space))
    assert schema is not None
    box = gemini_schema(schema)["properties"]["box"]
    assert box["type"] == ["array", "null"]
    assert (box["minItems"], box["maxItems"]) == (4, 4)
    assert box["items"] == {"type": kind, "minimum": 0, "maximum": most}


def test_a_free_text_has_no_schema() -> None:
    assert request_schema(MllmRequest(call="free", variables=FreeVariables("Hello."))) is None


def test_narrowing_one_request_leaves_the_next_alone() -> None:
    before = json.dumps(request_schema(DECIDE))
    for request in REQUESTS.values():
        request_schema(request)
    assert json.dumps(request_schema(DECIDE)) == before


def test_the_sentence_holds_the_whole_schema() -> None:
    schema = request_schema(DECIDE)
    assert schema is not None
    assert json.loads(schema_prompt(schema).strip().splitlines()[-1]) == openai_schema(schema)


def test_down_and_flights_by_numbers_are_offered_in_flight_alone() -> None:
    ground, aloft = (tools(changed(in_flight=value)) for value in (False, True))
    assert ground["turn"]["direction"]["enum"] == list(DIRECTIONS)
    assert "climb" not in ground["turn"]
    assert aloft["turn"]["direction"]["enum"] == [*DIRECTIONS, DOWN]
    assert "fly" not in aloft
    by_numbers = tools(REQUESTS["by_numbers"])
    assert set(by_numbers["fly"]) == {"tool", "bearing", "distance", "climb"}
    down_failed = tools(REQUESTS["down_failed"])
    assert down_failed["turn"]["direction"]["enum"] == list(DIRECTIONS)
