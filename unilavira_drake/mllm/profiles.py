"""From a name, a file or ``openai:MODEL@BASE_URL`` to the profile of an endpoint."""

from __future__ import annotations

import datetime
import json
import re
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pydantic
import yaml

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.mllm.address import is_loopback
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.profile import ImageTokens, Prices, Profile, RoleSettings
from unilavira_drake.resources import models_path

TEMPLATE = "template"
"""The file for one's own endpoint; no profile that could be asked."""
AD_HOC = "openai:"
RESERVED = ("contents", "messages", "model", "stream", "unilavira_request")
"""Members of a request that a profile's ``body`` may not set."""

_MODEL_AT_URL = re.compile(r"(.+?)@(https?://.+)", re.IGNORECASE)
_FAMILY_SPACES = (
    (re.compile(r"gemini", re.IGNORECASE), "yxyx_1000"),
    (re.compile(r"qwen-?2\.?5-?vl", re.IGNORECASE), "xyxy_resized"),
)
"""Families that do not write boxes as most do."""
_MOST_COMPLAINTS = 3
_PARTS: dict[str, type[pydantic.BaseModel]] = {
    "language": RoleSettings,
    "vision": RoleSettings,
    "image_tokens": ImageTokens,
    "prices": Prices,
}


def profile_names() -> tuple[str, ...]:
    """Returns the names of the profiles that come with the library."""
    files = (models_path() / "mllm").glob("*.yaml")
    return tuple(sorted(file.stem for file in files if file.stem != TEMPLATE))


def load_profile(spec: str, *, place: str = "model") -> Profile:
    """Returns the profile that a spec names.

    Args:
        spec: a name that comes with the library, the path of a ``.yaml`` file, or
            ``openai:MODEL@BASE_URL`` for an endpoint that needs no file.
        place: where the spec stands, e.g. ``language_model``; opens an error's message.

    Raises:
        ScenarioError: if there is no such profile, or it cannot be used; names the place, the
            value and the remedy.
    """
    if spec.startswith(AD_HOC):
        return _ad_hoc(spec, place)
    if spec.endswith((".yaml", ".yml")):
        return _from_file(Path(spec).expanduser(), place)
    if spec not in profile_names():
        raise ScenarioError(unknown_name("profile", spec, profile_names(), place))
    return _from_file(models_path() / "mllm" / f"{spec}.yaml", place)


def _ad_hoc(spec: str, place: str) -> Profile:
    match = _MODEL_AT_URL.fullmatch(spec[len(AD_HOC) :].strip())
    if match is None:
        shown = re.sub(r"//[^/]*@", "//...@", spec)
        raise ScenarioError(
            f"{place}: {shown!r} must be openai:MODEL@BASE_URL with a BASE_URL that begins with "
            "http:// or https://, e.g. openai:qwen3.5-9b@http://127.0.0.1:8080/v1."
        )
    model, url = match[1], match[2]
    spaces = [space for family, space in _FAMILY_SPACES if family.search(model)]
    _check_url(url, f"{place}: {AD_HOC}{model}@BASE_URL")
    return Profile(
        name=f"{AD_HOC}{model}",
        description=f"{model}, an OpenAI-compatible server at {urlsplit(url).netloc}",
        dialect="openai",
        base_url=url,
        model=model,
        box_space=spaces[0] if spaces else "xyxy_1000",
        # It may be a small machine, and it may think.
        language=RoleSettings(max_output_tokens=8192),
        vision=RoleSettings(max_output_tokens=4096, attempt_deadline=120.0, deadline=240.0),
    )


def _from_file(path: Path, place: str) -> Profile:
    where = f"{place}: {path}"
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        said = getattr(error, "strerror", None) or "not UTF-8"
        raise ScenarioError(f"{where}: the profile cannot be read ({said}).") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = "" if mark is None else f", line {mark.line + 1}"
        problem = getattr(error, "problem", None) or "it cannot be parsed"
        raise ScenarioError(f"{where}{line}: no YAML: {problem}.") from None
    if not isinstance(data, dict):
        raise ScenarioError(f"{where}: a profile is a list of 'field: value'.")
    prices = data.get("prices")
    if isinstance(prices, dict) and isinstance(prices.get("date"), datetime.date):
        data["prices"] = {**prices, "date": str(prices["date"])}  # YAML knows whole dates.
    try:
        profile = Profile.model_validate({"name": path.stem, **data})
    except pydantic.ValidationError as error:
        complaints = [_complaint(dict(item), where) for item in error.errors(include_url=False)]
        raise ScenarioError("; ".join(complaints[:_MOST_COMPLAINTS])) from None
    _check(profile, where)
    return profile


def _complaint(error: dict[str, Any], where: str) -> str:
    steps = [str(step) for step in error["loc"]]
    if error["type"] == "extra_forbidden":
        form = _PARTS[steps[0]] if len(steps) > 1 else Profile
        return unknown_name("field", steps[-1], form.model_fields, where)
    name = ".".join(steps)
    if error["type"] == "missing":
        return f"{where}: {name} is missing; models/mllm/{TEMPLATE}.yaml explains every field."
    message, given = str(error["msg"]), repr(error["input"])
    shown = given if len(given) <= 60 else given[:59] + "…"
    return f"{where}: {name}: {message[:1].lower()}{message[1:]} (given: {shown})."


def _check(profile: Profile, where: str) -> None:
    """Checks what the types alone cannot say."""
    _check_url(profile.base_url, f"{where}: base_url")
    if not profile.model.strip():
        raise ScenarioError(f"{where}: model is empty; give the name that the provider uses.")
    if profile.peer == "rules" and not is_loopback(profile.base_url):
        raise ScenarioError(
            f"{where}: peer: rules is sent the simulator's labels, which stay on this machine; "
            "base_url must be a loopback address."
        )
    if profile.box_space not in BOX_SPACES:
        raise ScenarioError(unknown_name("box_space", profile.box_space, BOX_SPACES, where))
    rule = profile.image_tokens
    if rule is not None:
        details = (rule.low, rule.medium, rule.high)
        fixed = all(count is not None for count in details)
        if fixed == (rule.square is not None) or (not fixed and any(details)):
            raise ScenarioError(
                f"{where}: image_tokens is either low, medium and high, or square alone."
            )
    reserved = [name for name in RESERVED if name in profile.body]
    if reserved:
        raise ScenarioError(f"{where}: body may not set {', '.join(reserved)}; leave it out.")
    try:
        json.dumps(profile.body, allow_nan=False)
    except (TypeError, ValueError):
        raise ScenarioError(f"{where}: body holds a value that JSON cannot write.") from None


def _check_url(url: str, where: str) -> None:
    """Refuses what is no address of a server, and what would carry a secret in the open."""
    try:
        parts = urlsplit(url)
        known = parts.scheme.lower() in ("http", "https") and bool(parts.hostname)
        _ = parts.port
    except ValueError:
        known = False
    if not known:
        shown = re.sub(r"//[^/]*@", "//...@", url)
        raise ScenarioError(
            f"{where}: {shown!r} is no address; it must look like https://host[:port][/path]."
        )
    if "@" in parts.netloc:
        raise ScenarioError(
            f"{where}: an address may not hold a name or password; keys come from the "
            "environment (UNILAVIRA_API_KEY)."
        )
    if parts.query or parts.fragment:
        raise ScenarioError(
            f"{where}: an address may not hold '?' or '#'; keys come from the environment "
            "(UNILAVIRA_API_KEY), further fields from 'body' of a profile."
        )
