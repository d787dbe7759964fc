"""Everything that can go wrong with a model behind a network, from a real server on loopback.

Each case ends in the right value or in a named error, within its deadline and with one row in the
ledger for each request on the wire.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest
from fault_server import FaultServer, a_free_port
from reply_faults import TEXTS
from tiny_model import DECIDE, GROUND, model_of, profile_of
from wire_faults import FAULTS

from unilavira_drake.asking import ask
from unilavira_drake.errors import (
    ContextLengthError,
    MllmAuthenticationError,
    MllmError,
    MllmQuotaError,
    MllmRequestError,
    MllmTimeout,
    MllmUnreachable,
    ReplyFormatError,
    ReplyRefused,
    ReplyTruncated,
    UniLaviraError,
)
from unilavira_drake.messages import LanguageAction, VisionAction
from unilavira_drake.mllm.http import HttpClient
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.reply import Attempt
from unilavira_drake.mllm.request import MllmRequest

SLACK = 1.0
"""Seconds for a busy machine; the faults themselves last for tens of seconds."""


@dataclass(frozen=True)
class Case:
    fault: str
    error: type[UniLaviraError] | None = None
    """None: the reply is usable."""
    posts: int = 1
    language: bool = False
    http: tuple[int | None, ...] = ()
    """The HTTP status of each row; by default 200 everywhere."""
    said: str = ""
    """What the error says, or the repair of a value."""
    deadline: float = 5.0


def reply(fault: str, error: type[UniLaviraError] | None = None, said: str = "") -> Case:
    """What the model itself writes: asked again once if it cannot be used."""
    boxes = "box" in fault or fault in ("swapped_corners", "three_numbers")
    return Case(fault, error, 1 if error is None else 2, not boxes, said=said)


CASES = (
    # What the model writes.
    reply("markdown_fence"),
    reply("prose_around", said="around"),
    reply("think_prefix"),
    reply("malformed", ReplyFormatError, "not JSON"),
    reply("python_literal", ReplyFormatError, "not JSON"),
    reply("not_a_number", ReplyFormatError, "NaN"),
    reply("infinite_number", ReplyFormatError, "finite"),
    reply("wrong_types", ReplyFormatError, "action"),
    reply("number_as_text"),
    reply("duplicate_keys", ReplyFormatError, "twice"),
    reply("unknown_index", ReplyFormatError, "index 7"),
    reply("unknown_waypoint", ReplyFormatError, "waypoint"),
    reply("deep_nesting", ReplyFormatError, "nests deeper"),
    reply("huge_integer", ReplyFormatError, "number"),
    reply("lone_surrogate", ReplyFormatError, "surrogate"),
    reply("box_far_outside", ReplyFormatError, "box"),
    reply("box_just_outside", said="cut"),
    reply("swapped_corners", said="swapped"),
    reply("three_numbers", ReplyFormatError, "box"),
    # What the provider makes of it.
    Case("empty_text", ReplyFormatError, 2, said="no text"),
    Case("null_text", ReplyFormatError, 2, said="no text"),
    Case("reasoning_only", ReplyFormatError, 2, said="no text"),
    Case("unknown_finish", ReplyFormatError, 2, said="REACHED_NIRVANA"),
    Case("truncated", ReplyTruncated, 2, said="cut off"),
    Case("truncated_once", posts=2),
    Case("refusal", ReplyRefused),
    Case("content_filter", ReplyRefused),
    Case("blocked_prompt", ReplyRefused),
    Case("tool_call"),
    Case("no_choices", MllmUnreachable, 3),
    Case("error_in_200", MllmUnreachable, 3),
    Case("no_json_schema", posts=2, http=(400, 200)),
    Case("negative_usage"),
    Case("no_usage"),
    Case("other_model"),
    # Statuses.
    Case("retry_after_1", posts=2, http=(429, 200)),
    Case("retry_after_600", MllmQuotaError, http=(429,), said="next try in 600 s, at 20"),
    Case("quota", MllmQuotaError, http=(429,)),
    Case("error_500_once", posts=2, http=(500, 200)),
    Case("html_503", MllmUnreachable, 3, http=(503,) * 3, said="Service Unavailable"),
    Case("loading_503", posts=6, http=(503,) * 5 + (200,)),
    Case("context_400", ContextLengthError, http=(400,)),
    Case("error_401", MllmAuthenticationError, http=(401,), said="UNILAVIRA_API_KEY"),
    Case("error_404", MllmRequestError, http=(404,)),
    Case("error_413", MllmRequestError, http=(413,)),
    Case("redirect", MllmRequestError, http=(307,), said="not followed"),
    # Bodies.
    Case("body_of_64_mib", MllmUnreachable, http=(None,), said="more than 1000000 bytes"),
    Case("gzip_bomb", MllmUnreachable, http=(None,), said="more than 1000000 bytes"),
    Case("gzip_body"),
    Case("unknown_encoding", MllmUnreachable, http=(None,), said="'br'"),
    Case("invalid_utf8", MllmUnreachable, 3),
    Case("no_json", MllmUnreachable, 3),
    Case("empty_body", MllmUnreachable, 3),
    Case("wrong_content_type"),
    Case("byte_order_mark"),
    Case("body_nested_deeply", MllmUnreachable, 3),
    Case("body_with_huge_integer", MllmUnreachable, 3),
    Case("body_with_lone_surrogate", ReplyFormatError, 2, said="surrogate"),
    # Connections.
    Case("reset", MllmUnreachable, 3, http=(None,) * 3),
    Case("reset_once", posts=2, http=(None, 200)),
    Case("cut_stream", MllmUnreachable, 3, http=(None,) * 3),
    Case("no_http", MllmUnreachable, 3, http=(None,) * 3),
    Case("huge_headers", MllmUnreachable, 3, http=(None,) * 3),
    Case("slow_drip", MllmTimeout, 3, http=(None,) * 3, deadline=1.0),
    Case("slow_headers", MllmTimeout, 3, http=(None,) * 3, deadline=1.0),
    Case("hang", MllmTimeout, 3, http=(None,) * 3, deadline=1.0),
)


@pytest.fixture(scope="module")
def server() -> Iterator[FaultServer]:
    with FaultServer(FAULTS) as running:
        yield running


@pytest.fixture(scope="module")
def http() -> Iterator[HttpClient]:
    client = HttpClient()
    yield client
    client.close()


def ask_listing(
    model: RemoteModel, request: MllmRequest, rows: list[Attempt]
) -> LanguageAction | VisionAction:
    """Asks as the agent does, and fills the list with what stands in the ledger afterwards."""
    try:
        return ask(model, request, on_reply=lambda _, completion: rows.extend(completion.attempts))
    except (MllmError, ReplyFormatError) as error:
        rows[:] = error.attempts
        raise


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.fault)
@pytest.mark.parametrize("dialect", ["gemini", "openai"])
def test_a_fault(case: Case, dialect: str, server: FaultServer, http: HttpClient) -> None:
    if case.fault == "blocked_prompt":
        case = replace(case, http=(400,) if dialect == "openai" else (200,))
    base_url = server.base_url(case.fault)
    request = DECIDE if case.language else GROUND
    attempt = 0.3 if case.error is MllmTimeout else case.deadline
    profile = profile_of(dialect, base_url, deadline=case.deadline, attempt=attempt)
    model = model_of(profile, http, request.role)
    rows: list[Attempt] = []
    begin = time.monotonic()
    if case.error is None:
        action = ask_listing(model, request, rows)
        assert case.said in " ".join(action.repairs)
        if isinstance(action, VisionAction):
            assert action.box is not None
            if case.fault != "box_just_outside":
                assert action.box == pytest.approx((64.0, 96.0, 192.0, 192.0))
        else:
            assert (action.tool, action.direction) == ("turn", "left")
            assert [update.index for update in action.todo_updates] == [1]
    else:
        with pytest.raises(UniLaviraError) as caught:
            ask_listing(model, request, rows)
        assert type(caught.value) is case.error
        assert case.said in str(caught.value)
    assert time.monotonic() - begin < case.deadline + SLACK
    # One row for each request on the wire.
    assert len(server.visit(base_url).posts) == len(rows) == case.posts
    assert tuple(row.http_status for row in rows) == (case.http or (200,) * case.posts)
    assert all(row.model == "tiny" and row.latency >= 0.0 for row in rows)
    assert all(row.detail for row in rows if row.status != "ok")
    if case.error is None:
        assert rows[-1].status == "ok"
    elif case.fault not in TEXTS and case.fault != "body_with_lone_surrogate":
        assert {row.status for row in rows} == {case.error.__name__}
    else:  # To the wire these are replies like any other.
        assert {row.status for row in rows} == {"ok"}


@pytest.mark.parametrize("fault", ["connection_refused", "dns_failure", "tls_failure"])
@pytest.mark.parametrize("dialect", ["gemini", "openai"])
def test_no_connection(
    fault: str,
    dialect: str,
    server: FaultServer,
    http: HttpClient,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def no_such_name(*_: object, **__: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    rows: list[Attempt] = []
    begin = time.monotonic()
    with a_free_port() as port:
        base_url, said = {
            "connection_refused": (f"http://127.0.0.1:{port}", "refuses the connection"),
            "dns_failure": ("http://model.invalid:8080", "cannot be resolved"),
            "tls_failure": (f"https://127.0.0.1:{server.port}", "TLS"),
        }[fault]
        if fault == "dns_failure":
            monkeypatch.setattr(socket, "getaddrinfo", no_such_name)
        model = model_of(profile_of(dialect, base_url), http)
        with pytest.raises(MllmUnreachable, match=said) as caught:
            ask_listing(model, GROUND, rows)
    assert time.monotonic() - begin < 5.0 + SLACK
    assert str(caught.value).endswith("(3 tries)")
    assert [(row.status, row.http_status) for row in rows] == [("MllmUnreachable", None)] * 3
    assert [row.usage.cost_usd for row in rows] == [0.0] * 3


@pytest.mark.parametrize("fault", ["cancel_mid_call"])
@pytest.mark.parametrize("dialect", ["gemini", "openai"])
def test_a_call_that_is_given_up(
    fault: str, dialect: str, server: FaultServer, http: HttpClient
) -> None:
    base_url = server.base_url("hang")
    model = model_of(profile_of(dialect, base_url, deadline=60.0, attempt=60.0), http)
    rows: list[Attempt] = []
    errors: list[BaseException] = []

    def call() -> None:
        try:
            ask_listing(model, GROUND, rows)
        except MllmError as error:
            errors.append(error)

    caller = threading.Thread(target=call)
    caller.start()
    visit = server.visit(base_url)
    while not visit.posts:
        time.sleep(0.01)
    begin = time.monotonic()
    model.close()
    caller.join(5.0)
    assert time.monotonic() - begin < SLACK
    assert "was closed before it replied" in str(errors[0])
    assert [row.status for row in rows] == ["cancelled"]
    assert visit.left.wait(5.0), "the connection is left open"
    with pytest.raises(MllmError, match="closed"):
        model.complete(GROUND)
