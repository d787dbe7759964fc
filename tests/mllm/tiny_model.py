"""A model for tests behind a server on loopback, and two questions for it."""

from __future__ import annotations

from typing import Any

from unilavira_drake.messages import TodoItem
from unilavira_drake.mllm.breaker import Breaker
from unilavira_drake.mllm.http import HttpClient
from unilavira_drake.mllm.profile import Prices, Profile, RoleSettings
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.request import (
    ImagePart,
    LanguageVariables,
    MllmRequest,
    ViewNote,
    VisionVariables,
)
from unilavira_drake.mllm.retrying import RetryPolicy

GROUND = MllmRequest(
    role="vision",
    n=1,
    call="ground",
    variables=VisionVariables(task="go to the door", box_space="xyxy_1000"),
    images=(ImagePart("front", b"\xff\xd8\xff\xd9"),),
)
DECIDE = MllmRequest(
    role="language",
    n=1,
    call="decide",
    variables=LanguageVariables(
        task="leave the hall",
        views=tuple(ViewNote(word, 2.0) for word in ("front", "left", "right", "back")),
        todo=(TodoItem(content="leave the hall"),),
    ),
)


def profile_of(
    dialect: str, base_url: str, *, deadline: float = 5.0, attempt: float = 5.0, **changes: Any
) -> Profile:
    settings = RoleSettings(deadline=deadline, attempt_deadline=attempt, max_output_tokens=500)
    known: dict[str, Any] = {
        "name": "tiny",
        "description": "A model for tests.",
        "dialect": dialect,
        "base_url": base_url,
        "model": "tiny",
        "language": settings,
        "vision": settings,
        "max_attempts": 3,
        "max_reply_bytes": 1_000_000,
        "prices": Prices(input=1.0, output=10.0, date="2026-11-22"),
    }
    return Profile(**{**known, **changes})


def model_of(
    profile: Profile,
    http: HttpClient,
    role: str = "vision",
    *,
    key: str = "",
    breaker: Breaker | None = None,
) -> RemoteModel:
    return RemoteModel(
        profile,
        role=role,
        key=key,
        http=http,
        retries=RetryPolicy(base=0.01, cap=0.02),
        breaker=breaker or Breaker(failures=99),
    )
