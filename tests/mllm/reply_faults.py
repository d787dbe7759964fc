"""What can be wrong with what a model or its provider answers, in both dialects.

The answers are constructed from the providers' documentation, not recorded.
"""

from __future__ import annotations

import asyncio
import json
from typing import Any

from fault_server import COUNTS, USAGE, Exchange, Fault, answer

GROUND = {
    "target_desc": "white door",
    "box": [100, 200, 300, 400],
    "point": None,
    "confidence": 0.9,
    "reason": "it leads on",
}
DECIDE = {
    "progress_analysis": "In the hall.",
    "reasoning_todo": "The first item is done.",
    "todo_updates": [{"op": "update", "index": 1, "status": "completed", "result": "left it"}],
    "reasoning_action": "The door is on the left.",
    "action": {"tool": "turn", "direction": "left"},
    "scene": "a hall with two doors",
}
GOOD = json.dumps(GROUND)


def ground(**changes: Any) -> str:
    return json.dumps({**GROUND, **changes})


def decide(**changes: Any) -> str:
    return json.dumps({**DECIDE, **changes})


TEXTS = {
    # Name -> what the model writes.  Replies to `decide`, those about boxes to `ground`.
    "markdown_fence": f"```json\n{decide()}\n```",
    "prose_around": f"Sure, here it is:\n{decide()}\nI hope this helps.",
    "think_prefix": f"<think>left {{or}} right?</think>\n{decide()}",
    "malformed": decide()[:-20] + "}",
    "python_literal": decide().replace('"reasoning_todo": "', '"flag": True, "reasoning_todo": "'),
    "not_a_number": decide().replace('"index": 1', '"index": NaN'),
    "infinite_number": decide().replace('"index": 1', '"index": 1e999'),
    "wrong_types": decide(action="left", scene=["hall"]),
    "number_as_text": decide().replace('"index": 1', '"index": "1"'),
    "duplicate_keys": decide()[:-1] + ', "scene": "another"}',
    "unknown_index": decide().replace('"index": 1', '"index": 7'),
    "unknown_waypoint": decide(action={"tool": "backtrack", "waypoint": 99}),
    "deep_nesting": decide()[:-1] + f', "more": {"[" * 5000}{"]" * 5000}}}',
    "huge_integer": decide().replace('"index": 1', f'"index": {"9" * 10_000}'),
    "lone_surrogate": decide().replace("a hall", "a \\ud800 hall"),
    "box_far_outside": ground(box=[100, 200, 3000, 400]),
    "box_just_outside": ground(box=[100, 200, 1010, 400]),
    "swapped_corners": ground(box=[300, 400, 100, 200]),
    "three_numbers": ground(box=[100, 200, 300]),
}


def fault(function: Fault) -> Fault:
    REPLY_FAULTS[function.__name__] = function
    return function


REPLY_FAULTS: dict[str, Fault] = {}


@fault
async def good(exchange: Exchange) -> None:
    await exchange.text(GOOD)


@fault
async def empty_text(exchange: Exchange) -> None:
    await exchange.text("")


@fault
async def null_text(exchange: Exchange) -> None:
    await exchange.text(None)


@fault
async def reasoning_only(exchange: Exchange) -> None:
    if exchange.dialect == "openai":
        await exchange.text("", reasoning_content="I think it is the door.")
    else:
        parts = [{"text": "I think it is the door.", "thought": True}]
        await exchange.text(None, parts=parts)


@fault
async def truncated(exchange: Exchange) -> None:
    finish = {"openai": "length", "gemini": "MAX_TOKENS"}[exchange.dialect]
    await exchange.text(GOOD[:30], finish=finish)


@fault
async def truncated_once(exchange: Exchange) -> None:
    await (truncated if exchange.n == 1 else good)(exchange)


@fault
async def refusal(exchange: Exchange) -> None:
    if exchange.dialect == "openai":
        await exchange.text(None, refusal="I cannot help with that.")
    else:
        await exchange.text(None, finish="PROHIBITED_CONTENT")


@fault
async def content_filter(exchange: Exchange) -> None:
    finish = {"openai": "content_filter", "gemini": "SAFETY"}[exchange.dialect]
    await exchange.text("", finish=finish)


@fault
async def blocked_prompt(exchange: Exchange) -> None:
    if exchange.dialect == "openai":  # Qwen's way.
        words = "Input data may contain inappropriate content."
        await exchange.refuse(400, words, kind="data_inspection_failed")
    else:
        usage = {"promptTokenCount": 1000}
        blocked = {"promptFeedback": {"blockReason": "SAFETY"}, "usageMetadata": usage}
        await exchange.json(blocked)


@fault
async def tool_call(exchange: Exchange) -> None:
    if exchange.dialect == "openai":
        call = {"id": "1", "type": "function", "function": {"name": "ground", "arguments": GOOD}}
        await exchange.text(None, tool_calls=[call], finish="tool_calls")
    else:
        await exchange.text(None, parts=[{"functionCall": {"name": "ground", "args": GROUND}}])


@fault
async def no_choices(exchange: Exchange) -> None:
    empty: dict[str, Any] = {"choices": [], "candidates": []}
    await exchange.json({**empty, USAGE[exchange.dialect]: COUNTS[exchange.dialect]})


@fault
async def unknown_finish(exchange: Exchange) -> None:
    await exchange.text(GOOD, finish="REACHED_NIRVANA")


@fault
async def negative_usage(exchange: Exchange) -> None:
    counts = {name: -count for name, count in COUNTS[exchange.dialect].items()}
    await exchange.json({**answer(exchange.dialect, GOOD), USAGE[exchange.dialect]: counts})


@fault
async def no_usage(exchange: Exchange) -> None:
    data = answer(exchange.dialect, GOOD)
    del data[USAGE[exchange.dialect]]
    await exchange.json(data)


@fault
async def other_model(exchange: Exchange) -> None:
    name = {"openai": "model", "gemini": "modelVersion"}[exchange.dialect]
    await exchange.json({**answer(exchange.dialect, GOOD), name: "tiny-2026-11"})


@fault
async def no_json_schema(exchange: Exchange) -> None:
    knows = "json_schema" not in str(exchange.body.get("response_format"))
    if knows and "responseJsonSchema" not in exchange.body.get("generationConfig", {}):
        await good(exchange)
    else:
        words = "response_format json_schema (response_schema) is not supported by this model."
        await exchange.refuse(400, words, kind="INVALID_ARGUMENT")


@fault
async def no_structure(exchange: Exchange) -> None:
    await exchange.refuse(400, "response_format (response_schema) is not supported.")


@fault
async def slow_seed(exchange: Exchange) -> None:
    await asyncio.sleep(0.3)
    seed = exchange.body.get("seed") or exchange.body.get("generationConfig", {}).get("seed")
    await exchange.text(ground(target_desc=f"door {seed}"))


def saying(text: str) -> Fault:
    async def say(exchange: Exchange) -> None:
        await exchange.text(text)

    return say


REPLY_FAULTS.update((name, saying(text)) for name, text in TEXTS.items())
