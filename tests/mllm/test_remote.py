"""A remote model beside its faults: what it asks, remembers, counts and keeps to itself."""

from __future__ import annotations

import dataclasses
import json
import logging
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

import pytest
from fault_server import FaultServer, answer
from tiny_model import DECIDE, GROUND, model_of, profile_of
from wire_faults import FAULTS

from unilavira_drake.errors import (
    ContextLengthError,
    MllmAuthenticationError,
    MllmError,
    MllmQuotaError,
    MllmRequestError,
    MllmTimeout,
    MllmUnreachable,
    ReplyTruncated,
)
from unilavira_drake.mllm import remote
from unilavira_drake.mllm.breaker import Breaker
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.http import HttpClient
from unilavira_drake.mllm.openai_compatible import OpenAiDialect
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.request import ImagePart, MllmRequest

KEY = "sk-secret/0123456789"
DIALECTS = pytest.mark.parametrize("dialect", ["gemini", "openai"])


@pytest.fixture(scope="module")
def server() -> Iterator[FaultServer]:
    with FaultServer(FAULTS) as running:
        yield running


@pytest.fixture(scope="module")
def http() -> Iterator[HttpClient]:
    client = HttpClient()
    yield client
    client.close()


def generation(dialect: str, post: dict[str, object]) -> dict[str, object]:
    settings = post if dialect == "openai" else post["generationConfig"]
    assert isinstance(settings, dict)
    return settings


def test_constructing_has_no_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("UNILAVIRA_API_KEY", raising=False)
    threads = threading.active_count()
    profile = profile_of("openai", "https://api.example.org/v1", deadline=7.0, outage_patience=5.0)
    model = RemoteModel(profile, role="language")
    assert threading.active_count() == threads
    assert (model.name, model.perception, model.reasoning) == ("tiny", "images", "model")
    assert model.description == "A model for tests. (at api.example.org)"
    assert (model.deadline, model.box_space) == (12.0, "xyxy_1000")
    served = RemoteModel(profile.model_copy(update={"peer": "rules"}), role="vision")
    assert (served.perception, served.reasoning) == ("ground_truth", "rules")
    with pytest.raises(MllmAuthenticationError, match="UNILAVIRA_LANGUAGE_API_KEY"):
        model.complete(DECIDE)


@DIALECTS
def test_what_a_reply_has_cost(dialect: str, server: FaultServer, http: HttpClient) -> None:
    profile = profile_of(dialect, server.base_url("error_500_once"))
    completion = model_of(profile, http).complete(GROUND)
    failed, good = completion.attempts
    assert (failed.usage.cost_usd, failed.usage.images) == (0.0, 0)
    assert (good.usage.input_tokens, good.usage.output_tokens, good.usage.images) == (1000, 50, 1)
    assert completion.usage.cost_usd == pytest.approx(0.0015)
    assert completion.latency is not None
    assert completion.latency >= failed.latency + good.latency

    unknown = profile_of(dialect, server.base_url("error_500_once"), prices=None)
    assert model_of(unknown, http).complete(GROUND).usage.cost_usd is None
    uncounted = profile_of(dialect, server.base_url("no_usage"))
    assert model_of(uncounted, http).complete(GROUND).usage.cost_usd is None
    # A server that broke off may have worked, and written it on the bill.
    broken = profile_of(dialect, server.base_url("reset_once"))
    rows = model_of(broken, http).complete(GROUND).attempts
    assert [row.usage.cost_usd for row in rows] == [None, pytest.approx(0.0015)]


@DIALECTS
def test_a_reply_that_is_cut_off_gets_twice_the_room_once(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    base_url = server.base_url("truncated")
    with pytest.raises(ReplyTruncated) as caught:
        model_of(profile_of(dialect, base_url), http).complete(GROUND)
    name = "max_tokens" if dialect == "openai" else "maxOutputTokens"
    asked = [generation(dialect, post)[name] for post in server.visit(base_url).posts]
    assert asked == [500, 1000]
    assert [row.usage.output_tokens for row in caught.value.attempts] == [50, 50]


@DIALECTS
def test_a_reask_is_warmer_and_tells_what_was_wrong(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    base_url = server.base_url("good")
    model = model_of(profile_of(dialect, base_url), http, "language")
    model.complete(DECIDE)
    model.complete(dataclasses.replace(DECIDE, attempt=1, feedback="index 7 is not there"))
    first, second = server.visit(base_url).posts
    assert generation(dialect, first)["temperature"] == 0.0
    assert generation(dialect, second)["temperature"] == pytest.approx(0.3)
    assert "index 7 is not there" in str(second)
    assert "index 7 is not there" not in str(first)


@DIALECTS
def test_a_prompt_that_is_too_long_is_sent_once_without_the_past(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    base_url = server.base_url("context_400")
    jpeg = GROUND.images[0].jpeg
    labels = ("H1: front view at waypoint 1", "H2: leaving waypoint 1 by its left view")
    views = tuple(f"view {word}" for word in ("front", "left", "right", "back"))
    images = tuple(ImagePart(label, jpeg) for label in (*labels, *views))
    request = dataclasses.replace(DECIDE, images=images)
    with pytest.raises(ContextLengthError) as caught:
        model_of(profile_of(dialect, base_url), http, "language").complete(request)
    first, second = (str(post) for post in server.visit(base_url).posts)
    assert all(label in first for label in labels)
    assert not any(label in second for label in labels)
    assert len(caught.value.attempts) == 2


@DIALECTS
def test_a_reask_has_the_time_that_is_left_of_its_decision(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    model = model_of(profile_of(dialect, server.base_url("hang"), deadline=1.0, attempt=0.7), http)
    with pytest.raises(MllmTimeout):
        model.complete(GROUND)
    began = time.monotonic()
    with pytest.raises(MllmTimeout):
        model.complete(dataclasses.replace(GROUND, attempt=1, feedback="again"))
    assert time.monotonic() - began < 0.6


@DIALECTS
def test_a_lesser_way_of_asking_for_json_is_remembered(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    profile = profile_of(dialect, server.base_url("no_json_schema"))
    assert len(model_of(profile, http).complete(GROUND).attempts) == 2
    assert len(model_of(profile, http).complete(GROUND).attempts) == 1
    posts = server.visit(profile.base_url).posts
    assert ["valid against this JSON schema" in str(post) for post in posts] == [False, True, True]

    hopeless = profile_of(dialect, server.base_url("no_structure"))
    with pytest.raises(MllmRequestError) as caught:
        model_of(hopeless, http).complete(GROUND)
    assert len(caught.value.attempts) == 4


@DIALECTS
def test_ground_truth_goes_to_a_peer_that_is_rules_and_to_no_other(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    door = Detection(category="flamingo-coloured door")
    request = dataclasses.replace(GROUND, evidence=(ViewEvidence(detections=(door,)),))
    for peer in ("model", "rules"):
        base_url = server.base_url("good")
        model_of(profile_of(dialect, base_url, peer=peer), http).complete(request)
        (post,) = server.visit(base_url).posts
        assert ("flamingo" in str(post)) == (peer == "rules")
        assert ("unilavira_request" in post) == (peer == "rules")


def test_no_dialect_ever_gets_hold_of_ground_truth_for_a_model(
    server: FaultServer, http: HttpClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[object] = []

    class Careless(OpenAiDialect):
        def body(self, prompt: Prompt, request: MllmRequest, *rest: Any, **options: Any) -> bytes:
            seen.append(request.evidence)
            return super().body(prompt, request, *rest, **options)

    monkeypatch.setitem(remote._DIALECTS, "openai", Careless)
    request = dataclasses.replace(GROUND, evidence=(ViewEvidence(),))
    for peer in ("model", "rules"):
        profile = profile_of("openai", server.base_url("good"), peer=peer)
        model_of(profile, http).complete(request)
    assert seen == [None, (ViewEvidence(),)]


@DIALECTS
def test_a_text_can_always_be_written_to_a_file(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    profile = profile_of(dialect, server.base_url("body_with_lone_surrogate"))
    text = model_of(profile, http).complete(GROUND).text
    assert "wh\\ud800ite" in text.encode("utf-8").decode()


@DIALECTS
@pytest.mark.parametrize("fault", ["echo_key", "error_401"])
def test_the_key_stands_nowhere_but_in_its_header(
    fault: str,
    dialect: str,
    server: FaultServer,
    http: HttpClient,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:
    caplog.set_level(logging.DEBUG)
    base_url = server.base_url(fault)
    model = model_of(profile_of(dialect, base_url), http, key=KEY)
    seen: list[object] = [model, vars(model)]
    try:
        completion = model.complete(GROUND)
        seen += [completion]
        assert "***" in completion.text
    except MllmAuthenticationError as error:
        seen += [error, error.args, error.attempts, error.__cause__, error.__context__]
    assert any(KEY in text for text in server.visit(base_url).headers[0].values())
    assert KEY[:5] not in "".join(f"{item!r} {item}" for item in seen)
    assert KEY not in str(server.visit(base_url).posts)
    assert KEY not in caplog.text
    assert KEY not in "".join(capfd.readouterr())


def test_a_key_with_a_line_break_is_named_but_not_shown(
    server: FaultServer, http: HttpClient
) -> None:
    model = model_of(profile_of("openai", server.base_url("good")), http, key=f"{KEY}\nx")
    with pytest.raises(MllmAuthenticationError) as caught:
        model.complete(GROUND)
    assert KEY not in str(caught.value)


@DIALECTS
def test_an_outage_is_waited_for_as_long_as_patience_goes(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    breaker = Breaker(failures=3, cooling=0.05)
    profile = profile_of(dialect, server.base_url("away_7_times"), outage_patience=20.0)
    completion = model_of(profile, http, breaker=breaker).complete(GROUND)
    assert [row.status for row in completion.attempts] == ["MllmUnreachable"] * 7 + ["ok"]
    assert completion.latency is not None
    assert completion.latency >= 0.2

    # The time of the tries themselves is given back, too: two of these are longer than all of it.
    silent = profile_of(
        dialect, server.base_url("hang_twice"), deadline=0.5, attempt=0.3, outage_patience=9.0
    )
    assert len(model_of(silent, http).complete(GROUND).attempts) >= 3

    short = profile_of(dialect, server.base_url("reset"), outage_patience=0.3)
    begin = time.monotonic()
    with pytest.raises(MllmUnreachable) as caught:
        model_of(short, http).complete(GROUND)
    assert time.monotonic() - begin < 2.0
    assert len(caught.value.attempts) > 3


@DIALECTS
def test_a_server_that_is_started_again_is_waited_for(dialect: str, http: HttpClient) -> None:
    with HTTPServer(("127.0.0.1", 0), _Answering, bind_and_activate=False) as restarted:
        restarted.server_bind()  # Bound, it refuses connections until it is activated.

        class Watching(Breaker):
            tries = 0

            def failed(self, reason: str) -> None:
                self.tries += 1
                assert "refuses the connection" in reason
                if self.tries == 5:
                    restarted.server_activate()
                    threading.Thread(target=restarted.handle_request, daemon=True).start()

        url = f"http://127.0.0.1:{restarted.server_port}/{dialect}"
        model = model_of(profile_of(dialect, url, outage_patience=20.0), http, breaker=Watching())
        completion = model.complete(GROUND)
    assert [row.status for row in completion.attempts] == ["MllmUnreachable"] * 5 + ["ok"]


class _Answering(BaseHTTPRequestHandler):
    def do_POST(self) -> None:
        body = json.dumps(answer(self.path.split("/")[1], "{}")).encode()
        self.rfile.read(int(self.headers["content-length"]))
        self.send_response(200)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


def test_an_open_breaker_fails_at_once(server: FaultServer, http: HttpClient) -> None:
    breaker = Breaker(failures=2)
    down = profile_of("openai", server.base_url("reset"))
    with pytest.raises(
        MllmUnreachable, match="not asked for now after 2 failures in a row"
    ) as caught:
        model_of(down, http, breaker=breaker).complete(GROUND)
    assert len(caught.value.attempts) == 2
    with pytest.raises(MllmUnreachable, match="not asked for now") as caught:
        model_of(down, http, breaker=breaker).complete(GROUND)
    assert caught.value.attempts == ()
    assert len(server.visit(down.base_url).posts) == 2


def test_the_breaker_is_shared_by_the_models_of_a_process(
    server: FaultServer, http: HttpClient
) -> None:
    down = profile_of("openai", server.base_url("reset"))
    for _ in range(3):
        with pytest.raises(MllmUnreachable):
            RemoteModel(
                down.model_copy(update={"max_attempts": 2}), role="vision", key=""
            ).complete(GROUND)
    assert len(server.visit(down.base_url).posts) == 5


@DIALECTS
def test_an_overloaded_server_does_not_open_the_breaker(
    dialect: str, server: FaultServer, http: HttpClient
) -> None:
    breaker = Breaker(failures=1)
    with pytest.raises(MllmUnreachable):
        model_of(profile_of(dialect, server.base_url("html_503")), http, breaker=breaker).complete(
            GROUND
        )
    assert breaker.admit() == 0.0


def test_our_own_rate_limit_is_kept(
    server: FaultServer,
    http: HttpClient,
    tmp_path: object,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    profile = profile_of("openai", server.base_url("good"), requests_per_minute=2.0)
    for _ in range(2):
        model_of(profile, http).complete(GROUND)
    with pytest.raises(MllmQuotaError, match="our own limit of 2 requests a minute") as caught:
        model_of(profile, http).complete(GROUND)
    assert caught.value.attempts == ()
    assert len(server.visit(profile.base_url).posts) == 2


def test_a_closed_model_also_ends_its_waits(server: FaultServer, http: HttpClient) -> None:
    profile = profile_of("openai", server.base_url("retry_after_1"), deadline=60.0)
    model = model_of(profile, http)
    threading.Timer(0.2, model.close).start()
    begin = time.monotonic()
    with pytest.raises(MllmError, match="closed before it replied") as caught:
        model.complete(GROUND)
    assert time.monotonic() - begin < 0.9
    assert [row.status for row in caught.value.attempts] == ["MllmQuotaError"]


@DIALECTS
def test_calls_from_many_threads(dialect: str, server: FaultServer, http: HttpClient) -> None:
    profile = profile_of(dialect, server.base_url("slow_seed"), deadline=10.0, attempt=10.0)
    model = model_of(profile, http)
    requests = [dataclasses.replace(GROUND, seed=seed) for seed in range(1, 31)]
    begin = time.monotonic()
    with ThreadPoolExecutor(len(requests)) as pool:
        texts = [completion.text for completion in pool.map(model.complete, requests)]
    assert time.monotonic() - begin < 5.0, "one after the other they take 9 s"
    assert all(f"door {n}" in text for n, text in enumerate(texts, start=1))
