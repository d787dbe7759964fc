"""The client against a real llama-server with a real, tiny model; opt in with

    UNILAVIRA_REAL_PEER=http://127.0.0.1:8080/v1 python -m pytest -n 0 -m real_peer -s

``docs/real_peer.md`` tells how to build the server.  Its model is real but far too small to mean
anything, so what is asserted is the form of its replies, what the server counts, and its errors.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Iterator

import pytest

from unilavira_drake.asking import ask
from unilavira_drake.endpoint_check import check_endpoint
from unilavira_drake.errors import (
    ContextLengthError,
    MllmRequestError,
    ReplyFormatError,
    ReplyTruncated,
)
from unilavira_drake.messages import LanguageAction, VisionAction
from unilavira_drake.mllm.box_probe import box_request
from unilavira_drake.mllm.profile import Profile, RoleSettings
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.reply import Attempt, Completion
from unilavira_drake.mllm.reply_forms import GroundReply
from unilavira_drake.mllm.request import FreeVariables, ImagePart, LanguageVariables, MllmRequest
from unilavira_drake.mllm.structured_modes import structured_mode
from unilavira_drake.mllm.tokens import text_tokens

VARIABLE = "UNILAVIRA_REAL_PEER"
PATIENCE = 280.0
GROUND = box_request("xyxy_1000")
ANSWER = MllmRequest(
    n=2, call="answer", variables=LanguageVariables(family="eqa", task="What colour is the sofa?")
)

pytestmark = pytest.mark.real_peer


def profile(tokens: int = 400) -> Profile:
    settings = RoleSettings(max_output_tokens=tokens, attempt_deadline=PATIENCE, deadline=PATIENCE)
    return Profile(
        name="real-peer",
        description="a tiny real model",
        dialect="openai",
        base_url=os.environ[VARIABLE],
        model="any",
        max_attempts=1,
        language=settings,
        vision=settings,
    )


@pytest.fixture(autouse=True)
def _address() -> None:
    if VARIABLE not in os.environ:
        pytest.skip(f"set {VARIABLE} to the base address of a llama-server, see docs/real_peer.md")


@pytest.fixture
def model() -> Iterator[RemoteModel]:
    model = RemoteModel(profile(), role="language")
    yield model
    model.close()


def counted(attempts: tuple[Attempt, ...]) -> int:
    return attempts[0].usage.input_tokens


def tell(what: str, completion: Completion, began: float) -> None:
    usage = completion.usage
    print(
        f"\n{what}: {time.monotonic() - began:.1f} s, {usage.input_tokens} tokens in "
        f"({usage.cached_tokens} cached), {usage.output_tokens} out, {usage.images} pictures"
    )


def test_a_json_schema_makes_even_a_tiny_model_keep_to_the_form(model: RemoteModel) -> None:
    began, heard = time.monotonic(), []
    action = ask(model, ANSWER, on_reply=lambda _, completion: heard.append(completion))
    tell("answer", heard[-1], began)
    assert isinstance(action, LanguageAction)
    assert action.answer
    assert structured_mode(profile()) == "json_schema"


def test_a_picture_goes_over_the_wire_and_is_counted(model: RemoteModel) -> None:
    began = time.monotonic()
    seen = model.complete(GROUND)
    tell("ground", seen, began)
    form, _ = GroundReply.read(seen.text)
    # The grammar has no tokens for numbers outside of the grid.
    assert all(0 <= number <= 1000 for number in [*(form.box or ()), *(form.point or ())])
    assert seen.usage.images == 1
    blind = model.complete(dataclasses.replace(GROUND, images=()))
    picture = counted(seen.attempts) - counted(blind.attempts)
    print(f"the picture counts {picture} tokens")
    assert 8 <= picture <= 4096
    expected = text_tokens(compose_prompt(dataclasses.replace(GROUND, images=())).text)
    assert 0.5 <= counted(blind.attempts) / expected <= 2.0


def test_a_prompt_that_was_seen_before_comes_out_of_the_cache(model: RemoteModel) -> None:
    model.complete(GROUND)
    began = time.monotonic()
    again = model.complete(GROUND)
    tell("again", again, began)
    assert again.usage.cached_tokens >= 0.9 * again.usage.input_tokens


def test_an_unusable_reply_is_asked_for_once_more(model: RemoteModel) -> None:
    heard: list[tuple[MllmRequest, Completion]] = []
    try:
        outcome: object = ask(model, GROUND, on_reply=lambda *pair: heard.append(pair))
    except ReplyFormatError as error:
        outcome = error
    print(f"\n{len(heard)} replies, then {outcome!r}")
    assert isinstance(outcome, VisionAction | ReplyFormatError)
    assert len(heard) == 2, "this model has marked the rectangle at once"
    (first, reply), (second, other) = heard
    assert (first.attempt, second.attempt) == (0, 1)
    assert second.feedback
    assert counted(other.attempts) > counted(reply.attempts)


def test_a_reply_that_is_cut_off_is_named_and_counted() -> None:
    model = RemoteModel(profile(tokens=8), role="language")
    request = MllmRequest(n=1, call="free", variables=FreeVariables("Count to a hundred."))
    with pytest.raises(ReplyTruncated) as caught:
        model.complete(request)
    model.close()
    assert [attempt.usage.output_tokens for attempt in caught.value.attempts] == [8, 16]


def test_what_the_server_refuses_is_named(model: RemoteModel) -> None:
    broken = dataclasses.replace(GROUND, images=(ImagePart("view front", b"\xff\xd8 no picture"),))
    with pytest.raises(MllmRequestError) as caught:
        model.complete(broken)
    assert caught.value.attempts[0].http_status == 400
    long = FreeVariables("sofa table " * 40_000)
    with pytest.raises(ContextLengthError) as too_long:
        model.complete(MllmRequest(n=1, call="free", variables=long))
    print(f"\n{caught.value}\n{too_long.value}")


def test_the_preflight_tells_what_this_server_can_do() -> None:
    checks = {check.what: check for check in check_endpoint(profile(tokens=48))}
    print("", *(check.line for check in checks.values()), sep="\n")
    for what in ("reachable", "key", "model", "text tokens"):
        assert checks[what].state == "ok", checks[what].line
    assert checks["pictures"].state != "FAILED"
    # Random weights see nothing.
    assert checks["box convention"].state == "FAILED"
