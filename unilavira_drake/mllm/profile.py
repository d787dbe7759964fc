"""What is known of a model endpoint, as data: its wire format, its habits and its prices."""

from __future__ import annotations

from typing import Any, Literal

import pydantic

Dialect = Literal["gemini", "openai"]
StructuredMode = Literal["json_schema", "json_object_schema", "json_object", "prompt"]
"""How a server is made to reply in JSON, the strictest first."""
Detail = Literal["low", "medium", "high"]


class _Data(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


class RoleSettings(_Data):
    """How one of the two roles uses an endpoint; times in wall-clock seconds."""

    temperature: float = pydantic.Field(default=0.0, ge=0.0, le=2.0)
    max_output_tokens: int = pydantic.Field(default=4096, gt=0)
    """Hidden reasoning included."""
    thinking: str = ""
    """Gemini: the thinking level; OpenAI-compatible: ``reasoning_effort``.  Empty leaves it to the
    provider."""
    attempt_deadline: float = pydantic.Field(default=180.0, gt=0.0)
    deadline: float = pydantic.Field(default=420.0, gt=0.0)
    """All attempts of one call together, waiting included."""


class ImageTokens(_Data):
    """How many input tokens a picture costs.

    Either a fixed number for each detail (Gemini), or one token for each square of ``square``
    pixels of the picture as it is sent (Qwen).
    """

    low: int | None = None
    medium: int | None = None
    high: int | None = None
    square: int | None = None


class Prices(_Data):
    """US dollars for a million tokens, as published on a day."""

    input: float
    output: float
    cached: float | None = None
    """None: cached tokens cost what others do."""
    date: str


class Profile(_Data):
    """One endpoint with one model."""

    name: str
    description: str
    dialect: Dialect
    base_url: str
    model: str
    peer: Literal["model", "rules"] = "model"
    """``rules``: the server is our own ``serve`` with a backend that reads the typed request; the
    only kind of peer that is ever sent ground truth."""
    structured: StructuredMode = "json_schema"
    box_space: str = "xyxy_1000"
    """A key of ``boxes.BOX_SPACES``."""
    image_tokens: ImageTokens | None = None
    prices: Prices | None = None
    """None: the cost is not known and is reported as null."""
    language: RoleSettings = RoleSettings()
    vision: RoleSettings = RoleSettings(
        max_output_tokens=1024, attempt_deadline=60.0, deadline=120.0
    )
    reask_temperature: float = pydantic.Field(default=0.3, ge=0.0)
    """Added to the temperature when a reply could not be used, lest the same one come again."""
    body: dict[str, Any] = {}
    """Further fields of every request, e.g. ``{enable_thinking: false}``."""
    max_attempts: int = pydantic.Field(default=4, ge=1)
    connect_timeout: float = pydantic.Field(default=10.0, gt=0.0)
    outage_patience: float = pydantic.Field(default=0.0, ge=0.0)
    """How long an episode waits for an endpoint that has gone away before it is given up."""
    max_reply_bytes: int = pydantic.Field(default=8_000_000, gt=0)
    """Largest body of an answer, unpacked."""
    requests_per_minute: float | None = pydantic.Field(default=None, gt=0.0)
    tokens_per_minute: float | None = pydantic.Field(default=None, gt=0.0)
    """Shared by all processes of this user that ask the same endpoint."""

    def settings(self, role: str) -> RoleSettings:
        """Returns how a role, ``language`` or ``vision``, uses the endpoint."""
        return self.vision if role == "vision" else self.language
