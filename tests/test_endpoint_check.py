"""The endpoint preflight against real servers on loopback, each with its own defect."""

from __future__ import annotations

import json
import socket
import time
from typing import Any

import cv2
import numpy as np
import pytest

from unilavira_drake.endpoint_check import Check, check_endpoint
from unilavira_drake.errors import (
    InputError,
    MllmAuthenticationError,
    MllmQuotaError,
    MllmRequestError,
    ReplyTruncated,
)
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.keys import ROLE_KEYS, SHARED_KEY
from unilavira_drake.mllm.profile import ImageTokens, Prices, Profile, RoleSettings
from unilavira_drake.mllm.reply import Completion, Usage
from unilavira_drake.mllm.request import FreeVariables, MllmRequest
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.serving import ModelServer

NAMES = [
    "reachable",
    "key",
    "model",
    "structured output",
    "text tokens",
    "pictures",
    "box convention",
    "latency",
    "cost",
]


class Peer:
    """A model that sees the red rectangle, plans two steps, and has the defect that it is told."""

    name = "peer"
    perception = "images"
    reasoning = "model"
    description = "a test peer"
    box_space = "pixels"
    deadline = 30.0

    def __init__(
        self,
        writes: str = "xyxy_1000",
        *,
        usage: Usage | None = None,
        prose: bool = False,
        blind: bool = False,
        error: Exception | None = None,
        no_pictures: bool = False,
        takes_schema: bool = True,
    ) -> None:
        self.writes = writes
        self.usage = usage or Usage()
        self.prose = prose
        self.blind = blind
        self.error = error
        self.no_pictures = no_pictures
        self.takes_schema = takes_schema

    def complete(self, request: MllmRequest) -> Completion:
        """Answers the two calls of the check, or raises what it was given."""
        if self.error is not None:
            raise self.error
        assert isinstance(request.variables, FreeVariables)
        # The server's own words for a schema in response_format.
        if not self.takes_schema and "of this JSON schema:" in request.variables.text:
            raise InputError("response_format: a schema is not known here.")
        if request.images and self.no_pictures:
            raise MllmRequestError("pictures are not supported")
        if self.prose:
            return Completion("Of course! First, leave the room.", self.usage)
        reply = self._mark(request) if request.images else PLAN
        return Completion(json.dumps(reply), self.usage)

    def close(self) -> None:
        """Does nothing."""

    def _mark(self, request: MllmRequest) -> dict[str, Any]:
        mark = {"target_desc": "rectangle", "point": None, "confidence": 0.9, "reason": ""}
        if self.blind:
            return {**mark, "box": None, "target_desc": "", "reason": "nothing red is there"}
        image = cv2.imdecode(np.frombuffer(request.images[0].jpeg, np.uint8), cv2.IMREAD_COLOR)
        red = np.argwhere((image[..., 2] > 150) & (image[..., 1] < 100))
        (v_min, u_min), (v_max, u_max) = red.min(axis=0), red.max(axis=0) + 1
        space = BOX_SPACES[self.writes]
        box = (float(u_min), float(v_min), float(u_max), float(v_max))
        height, width = image.shape[:2]
        return {**mark, "box": [round(x) for x in space.from_pixels_box(box, width, height)]}


PLAN = {"reasoning": "two steps", "todo": ["Leave the room.", "Stop beside the sofa."]}


@pytest.fixture(autouse=True)
def _no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (*ROLE_KEYS.values(), SHARED_KEY):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(params=["openai", "gemini"])
def dialect(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def profile_at(server: ModelServer, dialect: str = "openai", **more: Any) -> Profile:
    fields: dict[str, Any] = {
        "name": "tested",
        "description": "under test",
        "dialect": dialect,
        "base_url": server.chat_address if dialect == "openai" else server.address,
        "model": "peer",
        "image_tokens": ImageTokens(square=28),
        "prices": Prices(input=1.0, output=2.0, date="2026-11"),
        "language": RoleSettings(attempt_deadline=10.0, deadline=20.0),
        "vision": RoleSettings(attempt_deadline=10.0, deadline=20.0),
    }
    return Profile(**{**fields, **more})


def checked(model: Any, dialect: str = "openai", **more: Any) -> dict[str, Check]:
    """Returns the checks of a server with this model behind it, by what they are about."""
    backends = {"language": model, "vision": model}
    with ModelServer(backends, name="peer", port=0).running() as server:
        checks = list(check_endpoint(profile_at(server, dialect, **more)))
    assert [check.what for check in checks] == NAMES
    return {check.what: check for check in checks}


def failures(checks: dict[str, Check]) -> list[str]:
    return [what for what, check in checks.items() if check.state == "FAILED"]


def test_a_good_endpoint_passes_every_check(dialect: str) -> None:
    checks = checked(Peer(), dialect)
    assert {check.state for check in checks.values()} == {"ok"}, [c.line for c in checks.values()]
    assert "json_schema, a plan of 2 steps" in checks["structured output"].detail
    assert "xyxy_1000 1.00" in checks["box convention"].detail
    assert checks["cost"].detail.startswith("$0.00")
    assert checks["reachable"].line == f"ok       reachable: {checks['reachable'].detail}"


@pytest.mark.parametrize("own", BOX_SPACES)
@pytest.mark.parametrize("writes", BOX_SPACES)
def test_each_box_convention_is_told_from_each_other(own: str, writes: str) -> None:
    checks = checked(Peer(writes), box_space=own)
    box = checks["box convention"]
    if own == writes:
        assert box.state == "ok", box.line
    else:
        assert failures(checks) == ["box convention"]
        assert box.remedy == f"set box_space: {writes}"


def test_a_server_that_turns_every_prompt_into_three_tokens_is_caught(dialect: str) -> None:
    checks = checked(Peer(usage=Usage(3, 20)), dialect)
    assert failures(checks) == ["text tokens"]
    assert checks["text tokens"].detail.startswith("3 counted, about ")
    assert "chat template" in checks["text tokens"].remedy


def test_prose_in_the_place_of_json_is_caught() -> None:
    checks = checked(Peer(prose=True))
    assert failures(checks) == ["structured output", "box convention"]
    assert "json_schema: " in checks["structured output"].detail


def test_a_lesser_way_of_asking_for_json_is_named() -> None:
    structured = checked(Peer(takes_schema=False))["structured output"]
    assert structured.state == "ok"
    assert structured.remedy == "set structured: json_object, json_schema is not known there"


def test_a_reply_that_was_cut_off_has_its_own_remedy() -> None:
    checks = checked(Peer(error=ReplyTruncated("too long")))
    assert "structured output" in failures(checks)
    assert "max_output_tokens" in checks["structured output"].remedy


@pytest.mark.parametrize(
    ("error", "what", "words"),
    [
        (MllmAuthenticationError("invalid key"), "key", "UNILAVIRA_LANGUAGE_API_KEY"),
        (MllmQuotaError("all spent"), "model", "quota"),
        (MllmRequestError("no model of that name"), "model", "base_url"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else "",
)
def test_a_refusal_is_laid_to_its_cause(
    error: Exception, what: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SHARED_KEY, "sk-0123456789abcdef")
    checks = checked(Peer(error=error))
    assert failures(checks) == [what]
    assert checks["reachable"].state == "ok"
    assert words in checks[what].line
    assert all("sk-0123456789abcdef" not in check.line for check in checks.values())
    assert checks["box convention"].line == "unknown  box convention: not tried"


def test_a_server_that_is_not_there_is_told_from_all_else() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{taken.getsockname()[1]}/v1"
        profile = Profile(
            name="gone", description="", dialect="openai", base_url=url, model="m", max_attempts=9
        )
        checks = {check.what: check for check in check_endpoint(profile)}
    assert list(checks) == NAMES
    assert failures(checks) == ["reachable"]
    assert url in checks["reachable"].remedy
    assert {check.state for check in checks.values()} == {"FAILED", "unknown"}


def test_a_missing_key_is_found_before_anything_is_sent() -> None:
    url = "https://models.invalid/v1"
    profile = Profile(name="far", description="", dialect="openai", base_url=url, model="m")
    checks = {check.what: check for check in check_endpoint(profile)}
    assert failures(checks) == ["key"]
    assert SHARED_KEY in checks["key"].detail
    assert checks["reachable"].state == "unknown"


def test_a_model_without_eyes_is_caught() -> None:
    checks = checked(Peer(no_pictures=True))
    assert failures(checks) == ["pictures"]
    assert "vision part" in checks["pictures"].remedy
    checks = checked(Peer(blind=True))
    assert failures(checks) == ["box convention"]
    assert "nothing red is there" in checks["box convention"].detail


def test_unknown_prices_and_counts_are_no_failures() -> None:
    checks = checked(Peer(), prices=None, image_tokens=ImageTokens(low=5, medium=5, high=5))
    assert failures(checks) == []
    assert checks["cost"].state == "unknown"
    assert "image_tokens" in checks["pictures"].remedy


def test_a_slow_model_is_told_to_get_more_time() -> None:
    tight = RoleSettings(attempt_deadline=0.5, deadline=20.0)

    class Slow(Peer):
        def complete(self, request: MllmRequest) -> Completion:
            if request.images:
                time.sleep(0.3)
            return super().complete(request)

    checks = checked(Slow(), vision=tight)
    assert failures(checks) == ["latency"]
    assert "of vision" in checks["latency"].remedy


def test_rules_behind_a_server_are_checked_without_pictures() -> None:
    checks = checked(RulesModel(), peer="rules", box_space="pixels", prices=None)
    assert failures(checks) == []
    assert "look at no pictures" in checks["pictures"].detail


def test_a_server_that_writes_without_end_is_told_from_one_that_is_away() -> None:
    class Endless(Peer):
        def complete(self, request: MllmRequest) -> Completion:
            time.sleep(1.0)
            return super().complete(request)

    checks = checked(Endless(), language=RoleSettings(attempt_deadline=0.2, deadline=0.2))
    assert checks["reachable"].state == "ok"
    assert failures(checks) == ["model"]
    assert "without end" in checks["model"].remedy
