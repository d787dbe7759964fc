"""The server by real connections; each answer is read back by our own dialects."""

from __future__ import annotations

import dataclasses
from typing import Any

import httpx
import pytest
from scripted_backend import Scripted, failing, jpeg, serving

from unilavira_drake import errors
from unilavira_drake.messages import DIRECTIONS, TodoItem
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.gemini import GeminiDialect
from unilavira_drake.mllm.openai_compatible import OpenAiDialect
from unilavira_drake.mllm.profile import Profile
from unilavira_drake.mllm.profiles import load_profile
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.request import (
    FreeVariables,
    ImagePart,
    LanguageVariables,
    MllmRequest,
    ViewNote,
    VisionVariables,
)
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.mllm.wire import WireDialect, WireFailure, WireReply
from unilavira_drake.serving import ModelServer

DIALECTS: dict[str, WireDialect] = {"gemini": GeminiDialect(), "openai": OpenAiDialect()}
both = pytest.mark.parametrize("dialect", DIALECTS)


def profile(dialect: str, server: ModelServer, **changes: Any) -> Profile:
    base_url = server.address if dialect == "gemini" else server.chat_address
    values = {"dialect": dialect, "base_url": base_url, **changes}
    return load_profile("served-rules").model_copy(update=values)


def ask(client: httpx.Client, dialect: str, server: ModelServer, request: MllmRequest) -> Any:
    """Posts a request as our client does, and reads the answer as it does."""
    chosen = profile(dialect, server, peer="model" if request.evidence is None else "rules")
    speaker = DIALECTS[dialect]
    body = speaker.body(
        compose_prompt(request),
        request,
        chosen,
        structured="json_schema",
        temperature=0.0,
        max_output_tokens=100,
    )
    answer = client.post(speaker.url(chosen), headers=speaker.headers("a-key"), content=body)
    return speaker.read(answer.status_code, answer.headers, answer.json(), answer.content)


FREE = MllmRequest(
    call="free",
    variables=FreeVariables("What colour is it?"),
    images=(ImagePart("picture", jpeg(), "low"),),
    seed=5,
)
EVIDENCE = tuple(
    ViewEvidence(
        direction,
        detections=(
            Detection(f"{direction}#1", "floor", room="kitchen", pixels=90_000, distance=2.0,
                      box=(0.0, 300.0, 640.0, 480.0), point=(320.0, 400.0), point_distance=2.0),
            Detection(f"{direction}#2", "sofa", "red", pixels=9_000, distance=3.0,
                      box=(100.0, 200.0, 300.0, 320.0), point=(200.0, 300.0), point_distance=3.0),
        ),
    )
    for direction in DIRECTIONS
)  # fmt: skip
DECIDE = MllmRequest(
    n=2,
    call="decide",
    variables=LanguageVariables(
        task="Go to the red sofa.",
        views=tuple(ViewNote(direction, 4.0) for direction in DIRECTIONS),
        todo=(TodoItem("Go to the red sofa"),),
        current_waypoint=1,
    ),
    images=tuple(ImagePart(f"view {direction}", jpeg()) for direction in DIRECTIONS),
    evidence=EVIDENCE,
)
GROUND = MllmRequest(
    role="vision",
    n=2,
    call="ground",
    variables=VisionVariables(task="Go to the red sofa.", direction="left"),
    images=(ImagePart("view left", jpeg()),),
    evidence=(EVIDENCE[1],),
)


@both
@pytest.mark.parametrize("request_", [DECIDE, GROUND], ids=["decide", "ground"])
def test_typed_requests_reach_the_rules(
    client: httpx.Client, dialect: str, request_: MllmRequest
) -> None:
    with serving(RulesModel()) as server:
        reply = ask(client, dialect, server, request_)
    assert isinstance(reply, WireReply)
    assert reply.text == RulesModel().complete(request_).text
    assert reply.usage.input_tokens > 100
    assert reply.usage.output_tokens > 10


@both
def test_our_own_client_gets_the_same_reply_over_the_wire(dialect: str) -> None:
    with serving(RulesModel()) as server:
        model = RemoteModel(profile(dialect, server), role="language")
        completion = model.complete(DECIDE)
        model.close()
    assert model.perception == "ground_truth"
    assert completion.text == RulesModel().complete(DECIDE).text
    assert [row.status for row in completion.attempts] == ["ok"]


@both
def test_a_conversation_becomes_a_free_text(
    client: httpx.Client, echo: tuple[Scripted, ModelServer], dialect: str
) -> None:
    backend, server = echo
    reply = ask(client, dialect, server, FREE)
    assert isinstance(reply, WireReply)
    assert reply.text == '{"said": 1}'
    (asked,) = backend.asked
    assert (asked.role, asked.call, asked.seed, asked.evidence) == ("language", "free", 5, None)
    assert asked.variables == FreeVariables("[picture 1]\nWhat colour is it?")
    assert [(image.jpeg, image.detail) for image in asked.images] == [(jpeg(), "low")]
    # Four characters a token, and a picture of 64 x 48 pixels.
    assert reply.usage == Usage(8 + 4, 3)


@both
def test_a_schema_is_added_to_the_text(
    client: httpx.Client, echo: tuple[Scripted, ModelServer], dialect: str
) -> None:
    backend, server = echo
    ask(client, dialect, server, dataclasses.replace(DECIDE, evidence=None))
    variables = backend.asked[0].variables
    assert isinstance(variables, FreeVariables)
    assert "Go to the red sofa." in variables.text
    assert '"progress_analysis"' in variables.text.rpartition("JSON schema:\n")[2]


def test_ground_truth_is_not_passed_on_to_a_model(
    client: httpx.Client, echo: tuple[Scripted, ModelServer]
) -> None:
    backend, server = echo
    ask(client, "openai", server, DECIDE)
    assert backend.asked == [dataclasses.replace(DECIDE, evidence=None)]


@both
def test_rules_answer_no_plain_conversation(client: httpx.Client, dialect: str) -> None:
    with serving(RulesModel()) as server:
        failure = ask(client, dialect, server, FREE)
    assert failure.error is errors.MllmRequestError
    assert "typed requests only" in failure.message


@both
@pytest.mark.parametrize(
    ("error", "read", "retryable"),
    [
        (errors.ContextLengthError("long."), errors.ContextLengthError, False),
        (errors.MllmRequestError("no."), errors.MllmRequestError, False),
        (errors.CassetteError("miss."), errors.MllmRequestError, False),
        (errors.MllmError("closed."), errors.MllmRequestError, False),
        (errors.InputError("no."), errors.MllmRequestError, False),
        (errors.MllmAuthenticationError("key."), errors.MllmAuthenticationError, False),
        (errors.MllmQuotaError("spent."), errors.MllmQuotaError, False),
        (errors.MllmTimeout("late."), errors.MllmUnreachable, True),
        (errors.MllmUnreachable("gone."), errors.MllmUnreachable, True),
        (errors.ReplyTruncated("cut."), errors.ReplyTruncated, False),
        (errors.ReplyRefused("never."), errors.ReplyRefused, False),
        (errors.ReplyFormatError("empty."), errors.ReplyFormatError, False),
        (ZeroDivisionError("secret"), errors.MllmUnreachable, True),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else None,
)
def test_errors_of_the_backend_keep_their_meaning(
    client: httpx.Client, dialect: str, error: Exception, read: type, retryable: bool
) -> None:
    with serving(Scripted(failing(error))) as server:
        failure = ask(client, dialect, server, FREE)
    assert isinstance(failure, WireFailure)
    assert (failure.error, failure.retryable) == (read, retryable)
    assert "secret" not in failure.message
