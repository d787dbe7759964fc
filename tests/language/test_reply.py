from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.messages import CALLS, DIRECTIONS, LanguageAction, TodoItem, TodoUpdate
from unilavira_drake.mllm.reply_forms import reply_schema
from unilavira_drake.mllm.request import (
    ImagePart,
    LanguageVariables,
    MllmRequest,
    VisionVariables,
    WaypointNote,
)

VARIABLES = LanguageVariables(
    todo=(TodoItem("leave the room"), TodoItem("find the sofa")),
    waypoints=(WaypointNote(1, offered=True), WaypointNote(2), WaypointNote(5, offered=True)),
    can_climb=True,
)
DECISION: dict[str, Any] = {
    "progress_analysis": "Just started.",
    "reasoning_todo": "Nothing is proved.",
    "todo_updates": [],
    "reasoning_action": "A door is to the left.",
    "action": {"tool": "turn", "direction": "left"},
    "scene": "A bedroom with a blue bed.",
}


def _request(call: str = "decide", **changes: Any) -> MllmRequest:
    return MllmRequest(n=7, call=call, variables=dataclasses.replace(VARIABLES, **changes))


def _parse(value: Any, call: str = "decide", **changes: Any) -> LanguageAction:
    return parse_language_reply(json.dumps(value), _request(call, **changes))


def _decide(call: str = "decide", variables: Any = None, **changes: Any) -> LanguageAction:
    return _parse({**DECISION, **changes}, call, **(variables or {}))


@pytest.mark.parametrize("call", ["decide", "recover"])
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_turn(call: str, direction: str) -> None:
    action = _decide(call, action={"tool": "turn", "direction": direction})
    assert action == LanguageAction(
        n=7,
        call=call,
        tool="turn",
        direction=direction,
        progress_analysis="Just started.",
        reasoning_todo="Nothing is proved.",
        reasoning_action="A door is to the left.",
        scene="A bedroom with a blue bed.",
    )


def test_the_other_tools() -> None:
    assert _decide(action={"tool": "backtrack", "waypoint": 5}).waypoint == 5
    assert _decide(action={"tool": "go_stair", "stair": "down"}).argument == "down"
    assert _decide(action={"tool": "double_check"}).tool == "double_check"


def test_todo_operations() -> None:
    action = _decide(
        todo_updates=[
            {"op": "update", "index": 1, "status": "completed", "result": "saw  the\ndoor"},
            {"op": "update", "index": 1, "status": "pending", "result": ""},
            {"op": "update", "index": 2, "status": "completed"},
            {"op": "rewrite", "index": 2, "content": "find the red sofa"},
            {"op": "add", "content": "look around", "index": 3},
            {"op": "add", "content": "stop there", "index": None},
            {"op": "add", "content": "stop here"},
            {"op": "remove", "index": 2},
        ]
    )
    assert action.todo_updates == (
        TodoUpdate("update", 1, "", "completed", "saw the door"),
        TodoUpdate("update", 1, "", "pending", ""),
        TodoUpdate("update", 2, "", "completed", ""),
        TodoUpdate("rewrite", 2, "find the red sofa"),
        TodoUpdate("add", 3, "look around"),
        TodoUpdate("add", None, "stop there"),
        TodoUpdate("add", None, "stop here"),
        TodoUpdate("remove", 2),
    )


def test_explaining_words_are_clipped() -> None:
    action = _decide(scene="x" * 300, progress_analysis="y" * 5000)
    assert len(action.scene) == 160
    assert action.scene.endswith("…")
    assert len(action.progress_analysis) == 1500


def test_without_a_list_the_todo_fields_may_be_missing() -> None:
    reply = {k: v for k, v in DECISION.items() if k not in ("reasoning_todo", "todo_updates")}
    assert _parse(reply, todo=None).tool == "turn"


@pytest.mark.parametrize(
    ("changes", "variables", "words"),
    [
        ({"action": {"tool": "turn", "direction": "north"}}, {}, "'front', 'left', 'right' or"),
        ({"action": {"tool": "turn"}}, {}, "the key action.turn.direction is missing"),
        ({"action": {"tool": "jump"}}, {}, "'double_check'"),
        ({"action": {"tool": "stop"}}, {}, "action"),
        ({"action": {"tool": "backtrack", "waypoint": 2}}, {}, "choose among 1, 5"),
        ({"action": {"tool": "backtrack", "waypoint": 99}}, {}, "waypoint 99 may not be chosen"),
        ({"action": {"tool": "backtrack", "waypoint": "one"}}, {}, "valid integer"),
        ({"action": {"tool": "backtrack", "waypoint": "1.0"}}, {}, "valid integer"),
        ({"action": {"tool": "backtrack", "waypoint": "2"}}, {}, "choose among 1, 5"),
        ({"action": {"tool": "backtrack", "waypoint": "9" * 41}}, {}, "valid integer"),
        ({"action": {"tool": "backtrack", "waypoint": "true"}}, {}, "valid integer"),
        ({"action": {"tool": "backtrack", "waypoint": True}}, {}, "valid integer"),
        ({"action": {"tool": "backtrack", "waypoint": 1}}, {"second_chance": False}, "not offered"),
        ({"action": {"tool": "backtrack", "waypoint": 1}}, {"waypoints": ()}, "no waypoint"),
        ({"action": {"tool": "go_stair", "stair": "sideways"}}, {}, "'up' or 'down'"),
        ({"action": {"tool": "go_stair", "stair": "up"}}, {"can_climb": False}, "cannot climb"),
        ({"action": None}, {}, "action"),
        ({"scene": None}, {}, "scene: input should be a valid string (given: null)"),
        ({"todo_updates": [{"op": "remove", "index": 3}]}, {}, "allows 1 to 2"),
        ({"todo_updates": [{"op": "remove", "index": 0}]}, {}, "operation 1 of todo_updates"),
        ({"todo_updates": [{"op": "add", "content": "x", "index": 4}]}, {}, "allows 1 to 3"),
        ({"todo_updates": [{"op": "remove", "index": 1}]}, {"todo": ()}, "the list is empty"),
        ({"todo_updates": [{"op": "remove", "index": 1}]}, {"todo": None}, "no TODO list"),
        ({"todo_updates": [{"op": "done", "index": 1}]}, {}, "todo_updates.#1"),
        ({"todo_updates": [{"index": 1}]}, {}, "todo_updates.#1"),
        ({"action": {"direction": "left"}}, {}, "action"),
        (
            {"todo_updates": [{"op": "update", "index": 1, "status": "skipped", "result": ""}]},
            {},
            "'completed' or 'pending'",
        ),
        (
            {"todo_updates": [{"op": "rewrite", "index": 1, "content": "x" * 201}]},
            {},
            "at most 200 characters",
        ),
    ],
)
def test_what_cannot_be_used(changes: Any, variables: Any, words: str) -> None:
    with pytest.raises(ReplyFormatError) as error:
        _decide(variables=variables, **changes)
    assert words in str(error.value)
    assert len(str(error.value)) < 600


def test_a_missing_key_is_named() -> None:
    reply = {key: value for key, value in DECISION.items() if key != "scene"}
    with pytest.raises(ReplyFormatError, match="the key scene is missing"):
        _parse(reply)


def test_many_complaints_are_counted() -> None:
    with pytest.raises(ReplyFormatError, match=r"\(and 1 more\)"):
        _parse({"a": 1})


def test_numbers_given_as_text_are_read_and_named() -> None:
    action = _decide(
        action={"tool": "backtrack", "waypoint": " 5"},
        todo_updates=[{"op": "add", "content": "x", "index": "3"}, {"op": "remove", "index": 1}],
    )
    assert (action.waypoint, action.todo_updates[0].index) == (5, 3)
    assert action.repairs == (
        'the text "3" was read as a number',
        'the text " 5" was read as a number',
    )


def test_keys_that_are_not_asked_for_are_ignored_and_named() -> None:
    action = _decide(
        thought="hm",
        todo_updates=[{"op": "remove", "index": 1, "why": "done"}],
        action={"tool": "turn", "direction": "left", "\x1b[2J\ud83d\ude00" + "k" * 60: 2},
    )
    assert (action.tool, len(action.todo_updates)) == ("turn", 1)
    assert action.repairs == (
        'keys that are not asked for were ignored: "thought"',
        'keys that are not asked for were ignored: "why"',
        'keys that are not asked for were ignored: "\\u001b[2J\\ud83d\\ude00' + "k" * 35 + '"',
    )
    many = _decide(**{f"key{i}": i for i in range(50)}).repairs
    assert many == (
        'keys that are not asked for were ignored: "key0", "key1", "key2", "key3", "key4" and 45 '
        "more",
    )


def test_repairs_are_named_once_and_counted_when_there_are_many() -> None:
    remove = {"op": "remove", "index": "1"}
    twice = _decide(todo_updates=[remove, remove])
    assert twice.repairs == ('the text "1" was read as a number',)
    others = [{"op": "remove", "index": 1, f"k{i}": 0} for i in range(20)]
    assert len(_decide(todo_updates=others).repairs) == 9
    assert _decide(todo_updates=others).repairs[-1] == "and 12 further repairs"


@pytest.mark.parametrize(
    ("call", "reply"),
    [
        ("plan_todo", {"reasoning": "", "todo": ["go"]}),
        ("decide", DECISION),
        ("recover", DECISION),
        ("double_check", {"reasoning": "", "confirmed": True, "reason": ""}),
        ("answer", {"reasoning": "", "answer": "red"}),
    ],
)
def test_every_call_tells_of_the_text_around_the_object(call: str, reply: Any) -> None:
    clean = _parse(reply, call)
    assert clean.repairs == ()
    around = parse_language_reply(f"Here: {json.dumps(reply)} Bye.", _request(call))
    assert around == dataclasses.replace(
        clean, repairs=("text around the JSON object was ignored",)
    )


def test_recover_chooses_from_the_remaining_set() -> None:
    with pytest.raises(ReplyFormatError, match="choose among front, right, back"):
        _decide("recover", {"failed_direction": "left"})
    other = {"tool": "turn", "direction": "back"}
    assert _decide("recover", {"failed_direction": "left"}, action=other).direction == "back"
    assert _decide("decide", {"failed_direction": "left"}).direction == "left"


def test_plan() -> None:
    action = _parse(
        {"reasoning": "two steps", "todo": ["leave the room", " find\nit "]}, "plan_todo"
    )
    assert action == LanguageAction(
        n=7,
        call="plan_todo",
        tool="stay",
        todo_updates=(
            TodoUpdate("add", None, "leave the room"),
            TodoUpdate("add", None, "find it"),
        ),
        reasoning_todo="two steps",
    )


@pytest.mark.parametrize("todo", [[], ["item"] * 33, ["fine", "  "], ["x" * 201], ["a", 2], "go"])
def test_unusable_plan(todo: Any) -> None:
    with pytest.raises(ReplyFormatError):
        _parse({"reasoning": "", "todo": todo}, "plan_todo")


@pytest.mark.parametrize(
    ("family", "confirmed", "tool"),
    [
        ("vln", True, "stop"),
        ("objectnav", True, "stop"),
        ("aerial_vln", True, "stop"),
        ("eqa", True, "stay"),
        ("vln", False, "stay"),
        ("eqa", False, "stay"),
    ],
)
def test_verdict(family: str, confirmed: bool, tool: str) -> None:
    reply = {"reasoning": "compared", "confirmed": confirmed, "reason": "no sofa in view"}
    action = _parse(reply, "double_check", family=family)
    assert (action.tool, action.confirmed, action.reason) == (tool, confirmed, "no sofa in view")
    assert (action.n, action.call, action.progress_analysis) == (7, "double_check", "compared")


def test_a_rejection_needs_its_reason() -> None:
    _parse({"reasoning": "", "confirmed": True, "reason": ""}, "double_check")
    with pytest.raises(ReplyFormatError, match="say what is missing"):
        _parse({"reasoning": "", "confirmed": False, "reason": " "}, "double_check")
    with pytest.raises(ReplyFormatError, match="boolean"):
        _parse({"reasoning": "", "confirmed": "yes", "reason": "x"}, "double_check")


def test_answer() -> None:
    action = _parse({"reasoning": "seen", "answer": " dark\nred "}, "answer", family="eqa")
    assert (action.tool, action.answer, action.call) == ("stop", "dark red", "answer")
    with pytest.raises(ReplyFormatError, match="answer is empty"):
        _parse({"reasoning": "seen", "answer": ""}, "answer", family="eqa")


COLORS = ("red", "light blue", "blue")


@pytest.mark.parametrize(
    ("answer", "named"), [("It is Red.", "red"), ("light blue", "light blue"), ("BLUE", "blue")]
)
def test_an_answer_is_one_of_the_closed_vocabulary(answer: str, named: str) -> None:
    reply = {"reasoning": "seen", "evidence": [], "answer": answer}
    assert _parse(reply, "answer", family="eqa", choices=COLORS).answer == named


@pytest.mark.parametrize("answer", ["green", "red or blue", "unknown"])
def test_an_answer_outside_the_closed_vocabulary_is_asked_again(answer: str) -> None:
    reply = {"reasoning": "seen", "evidence": [], "answer": answer}
    with pytest.raises(ReplyFormatError, match="exactly one of: red, light blue, blue"):
        _parse(reply, "answer", family="eqa", choices=COLORS)


@pytest.mark.parametrize(
    ("evidence", "named"),
    [
        (["left"], ("left",)),
        (["View left", "H3: front view at waypoint 1"], ("left", "H3")),
        (["the left view", "picture h3", "H3."], ("left", "H3")),
        ([], ()),
    ],
)
def test_an_answer_names_the_pictures_that_settle_it(
    evidence: list[str], named: tuple[str, ...]
) -> None:
    images = (ImagePart("H3: front view at waypoint 1"), ImagePart("view left"))
    request = dataclasses.replace(_request("answer", family="eqa"), images=images)
    reply = {"reasoning": "seen", "evidence": evidence, "answer": "red"}
    action = parse_language_reply(json.dumps(reply), request)
    assert (action.evidence, action.repairs) == (named, ())
    # An answer is not lost over the name of a picture.
    reply["evidence"] = [*evidence, "H9", "left or H3"]
    action = parse_language_reply(json.dumps(reply), request)
    assert (action.answer, action.evidence) == ("red", named)
    assert len(action.repairs) == 2
    assert "H9" in action.repairs[0]


def test_bad_json_is_the_same_error() -> None:
    with pytest.raises(ReplyFormatError, match="is not JSON"):
        parse_language_reply("{oops", _request())


def test_a_vision_request_is_a_bug() -> None:
    with pytest.raises(TypeError):
        parse_language_reply("{}", MllmRequest(call="decide", variables=VisionVariables()))


@pytest.mark.parametrize("call", CALLS)
def test_schema_forbids_other_keys_and_keeps_the_order(call: str) -> None:
    schema = reply_schema(call)
    assert schema["additionalProperties"] is False
    first = {"decide": "progress_analysis", "recover": "progress_analysis"}.get(call, "reasoning")
    assert next(iter(schema["properties"])) == first
    json.dumps(schema)


def test_schema_reasons_before_it_acts() -> None:
    assert list(reply_schema("decide")["properties"]) == list(DECISION)
