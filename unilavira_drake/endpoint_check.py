"""Preflight of a model's endpoint: two small calls that show whether an episode could use it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from unilavira_drake.asking import ask
from unilavira_drake.errors import (
    MllmAuthenticationError,
    MllmError,
    MllmQuotaError,
    MllmRequestError,
    MllmTimeout,
    MllmUnreachable,
    ReplyFormatError,
    ReplyTruncated,
)
from unilavira_drake.messages import LanguageAction, Message
from unilavira_drake.mllm.box_probe import box_fits, box_request
from unilavira_drake.mllm.http import HttpLimits, shared_client
from unilavira_drake.mllm.keys import find_key
from unilavira_drake.mllm.profile import Profile
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.reply import Attempt, Completion
from unilavira_drake.mllm.reply_forms import GroundReply
from unilavira_drake.mllm.reply_schema import request_schema, schema_prompt
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.mllm.structured_modes import structured_mode
from unilavira_drake.mllm.tokens import picture_tokens, text_tokens
from unilavira_drake.mllm.usage import paid

OK, FAILED, UNKNOWN = "ok", "FAILED", "unknown"

GOOD_FIT = 0.5
"""Least intersection over union of a box that marks the rectangle."""
_SAME_FIT = 0.05
"""Fits that differ by less are equal."""
_PLAUSIBLE = (0.5, 2.0)
"""Counted tokens over estimated ones; on English no tokenizer is farther from the estimate."""
_SLOW = 0.5
"""Share of its deadline that so short a call may take."""
_TASK = "Leave the room by the white door and stop beside the sofa."


_WHAT_FOLLOWS = (
    *("key", "model", "structured output", "text tokens", "pictures", "box convention"),
    *("latency", "cost"),
)


@dataclass(frozen=True)
class Check(Message):
    """One thing that was looked at."""

    state: str = UNKNOWN
    """``ok`` | ``FAILED`` | ``unknown``."""
    what: str = ""
    detail: str = "not tried"
    remedy: str = ""

    @property
    def line(self) -> str:
        """All of it as one line."""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{self.state:<7}  {self.what}: {self.detail.removesuffix('.')}{remedy}"


@dataclass(frozen=True)
class _Call(Message):
    """One call to the endpoint and what came of it."""

    request: MllmRequest
    error: MllmError | ReplyFormatError | None
    """Why there is no usable reply."""
    attempts: tuple[Attempt, ...]
    replies: tuple[Completion, ...]
    """To the request and to its re-ask."""
    action: object = None

    @property
    def answered(self) -> bool:
        """Whether the model itself has spoken."""
        return not isinstance(self.error, MllmError)


def check_endpoint(profile: Profile) -> Iterator[Check]:
    """Yields one check after the other; what could not be tried is ``unknown``.

    The model is asked for the plan of a short task, as the language role, and to mark a red
    rectangle in a picture, as the vision role.  No call is tried twice; a plan that cannot be
    used is re-asked once, as in an episode.
    """
    profile = profile.model_copy(update={"max_attempts": 1, "outage_patience": 0.0})
    silence = _silence(profile)
    if silence:
        yield Check(FAILED, "reachable", silence, _server_remedy(profile))
        yield from (Check(what=what) for what in _WHAT_FOLLOWS)
        return
    plan = _plan(profile)
    yield _reachable(plan, profile)
    yield _key(plan)
    yield _model(plan, profile)
    yield _structured(plan, profile)
    yield _text_tokens(plan, profile)
    if not plan.answered:
        yield from (Check(what=what) for what in _WHAT_FOLLOWS[4:])
        return
    calls = [plan]
    if profile.peer == "rules":
        blind = "rules look at no pictures"
        yield Check(UNKNOWN, "pictures", blind)
        yield Check(UNKNOWN, "box convention", blind)
    else:
        calls.append(_mark(profile))
        yield _pictures(calls[1], plan, profile)
        yield _box(calls[1], profile)
    yield _latency(calls, profile)
    yield _cost(calls, profile)


def _silence(profile: Profile) -> str:
    """Why the server answers nothing at all; empty where it answers, whatever it says."""
    limits = HttpLimits(profile.connect_timeout, profile.connect_timeout, profile.max_reply_bytes)
    try:
        # The key is looked for and not sent: it belongs to no other path than that of the calls.
        find_key("language", profile.base_url)
        shared_client().get(profile.base_url, headers={}, limits=limits)
    except MllmAuthenticationError:
        return ""  # The call will tell.
    except MllmError as error:
        return str(error)
    return ""


def _plan(profile: Profile) -> _Call:
    request = MllmRequest(
        n=1,
        call="plan_todo",
        variables=LanguageVariables(task=_TASK, todo=()),
        # Rules answer nothing without their labels; here they have none to see.
        evidence=() if profile.peer == "rules" else None,
    )
    backend = RemoteModel(profile, role="language")
    replies: list[Completion] = []
    try:
        action = ask(backend, request, on_reply=lambda _, completion: replies.append(completion))
    except (MllmError, ReplyFormatError) as error:
        return _Call(request, error, tuple(error.attempts), tuple(replies))
    finally:
        backend.close()
    attempts = tuple(attempt for reply in replies for attempt in reply.attempts)
    return _Call(request, None, attempts, tuple(replies), action)


def _mark(profile: Profile) -> _Call:
    # Not re-asked: a box outside of the picture tells the convention as well as any other.
    request = box_request(profile.box_space)
    backend = RemoteModel(profile, role="vision")
    try:
        reply = backend.complete(request)
    except (MllmError, ReplyFormatError) as error:
        return _Call(request, error, tuple(error.attempts), ())
    finally:
        backend.close()
    try:
        form, _ = GroundReply.read(reply.text)
    except ReplyFormatError as error:
        return _Call(request, error, reply.attempts, (reply,))
    return _Call(request, None, reply.attempts, (reply,), form)


def _reachable(plan: _Call, profile: Profile) -> Check:
    if isinstance(plan.error, MllmUnreachable):
        return Check(FAILED, "reachable", str(plan.error), _server_remedy(profile))
    if not plan.attempts:
        return Check(what="reachable")
    return Check(OK, "reachable", f"{profile.base_url} answers")


def _server_remedy(profile: Profile) -> str:
    return f"check that the server runs, and base_url ({profile.base_url}) and dialect"


def _key(plan: _Call) -> Check:
    if isinstance(plan.error, MllmAuthenticationError):
        return Check(FAILED, "key", str(plan.error))
    return Check(OK, "key", "accepted, or not asked for") if plan.answered else Check(what="key")


def _model(plan: _Call, profile: Profile) -> Check:
    if plan.answered:
        told = next((attempt.detail for attempt in plan.attempts if attempt.status == "ok"), "")
        return Check(OK, "model", told or profile.model)
    if isinstance(plan.error, MllmTimeout):
        remedy = "it is slow, or writes without end: raise attempt_deadline, or lower "
        return Check(FAILED, "model", str(plan.error), f"{remedy}max_output_tokens")
    if isinstance(plan.error, MllmQuotaError):
        return Check(FAILED, "model", str(plan.error), "wait, or raise the quota at the provider")
    if isinstance(plan.error, MllmRequestError):
        remedy = f"check model ({profile.model}), base_url and body of the profile"
        return Check(FAILED, "model", str(plan.error), remedy)
    return Check(what="model")


def _structured(plan: _Call, profile: Profile) -> Check:
    what, mode = "structured output", structured_mode(profile)
    if not plan.answered:
        return Check(what=what)
    if plan.error is not None:
        remedy = "set another way in structured, or ask a model that keeps to a form"
        if isinstance(plan.error, ReplyTruncated):
            remedy = "raise max_output_tokens, or let the model think less"
        return Check(FAILED, what, f"{mode}: {plan.error}", remedy)
    assert isinstance(plan.action, LanguageAction)
    steps = len(plan.action.todo_updates)
    detail = f"{mode}, a plan of {steps} step{'' if steps == 1 else 's'}"
    if len(plan.replies) > 1:
        detail += " at the second try"
    if plan.action.repairs:
        detail += f" ({'; '.join(plan.action.repairs)})"
    stepped = f"set structured: {mode}, {profile.structured} is not known there"
    return Check(OK, what, detail, stepped if mode != profile.structured else "")


def _text_tokens(plan: _Call, profile: Profile) -> Check:
    what = "text tokens"
    if not plan.answered:
        return Check(what=what)
    counted, expected = _counted(plan), _expected_text(plan.request, profile)
    detail = f"{counted} counted, about {expected} expected"
    if not counted:
        remedy = "budgets in tokens and dollars cannot be kept"
        return Check(UNKNOWN, what, "the server counts none", remedy)
    if not _plausible(counted, expected):
        remedy = "does the server see the whole prompt? Check its chat template and context size"
        return Check(FAILED, what, detail, remedy)
    return Check(OK, what, detail)


def _pictures(mark: _Call, plan: _Call, profile: Profile) -> Check:
    if not mark.answered:
        remedy = "a multimodal model is needed; does the server have its vision part?"
        own = isinstance(mark.error, MllmRequestError)
        return Check(FAILED, "pictures", str(mark.error), remedy if own else "")
    counted, before = _counted(mark), _counted(plan)
    if not (counted and before):
        return Check(OK, "pictures", "accepted")
    text = _expected_text(mark.request, profile) * before / _expected_text(plan.request, profile)
    tokens = max(round(counted - text), 0)
    expected = picture_tokens(mark.request.images[0], profile.image_tokens)
    detail = f"accepted, about {tokens} tokens for one of 1280 x 960"
    if _plausible(tokens, expected):
        return Check(OK, "pictures", detail)
    remedy = "set image_tokens, by which rate limits plan; near 0, the server leaves pictures out"
    return Check(UNKNOWN, "pictures", f"{detail}, about {expected} expected", remedy)


def _box(mark: _Call, profile: Profile) -> Check:
    what, own = "box convention", profile.box_space
    if not mark.answered:
        return Check(what=what)
    if mark.error is not None:
        return Check(FAILED, what, str(mark.error), "ask a model that keeps to a form")
    assert isinstance(mark.action, GroundReply)
    fits = box_fits(mark.action)
    if not fits:
        remedy = "a model that sees no red rectangle cannot guide a robot"
        return Check(FAILED, what, f"nothing marked: {mark.action.reason!r}", remedy)
    shown = ", ".join(f"{name} {fit:.2f}" for name, fit in sorted(fits.items(), key=_by_fit))
    best = max(fits, key=lambda name: fits[name])
    detail = f"the profile says {own}; overlap with the rectangle: {shown}"
    if fits[best] < GOOD_FIT:
        return Check(FAILED, what, detail, "the model does not find a red rectangle")
    if fits[own] < fits[best] - _SAME_FIT:
        return Check(FAILED, what, detail, f"set box_space: {best}")
    return Check(OK, what, detail)


def _latency(calls: list[_Call], profile: Profile) -> Check:
    shown, slow = [], []
    for call in calls:
        role, limit = call.request.role, profile.settings(call.request.role).attempt_deadline
        seconds = max((attempt.latency for attempt in call.attempts), default=0.0)
        shown.append(f"{role} {seconds:.1f} s of {limit:g} s")
        if seconds > _SLOW * limit:
            slow.append(role)
    remedy = f"raise attempt_deadline and deadline of {' and '.join(slow)}" if slow else ""
    if slow:
        remedy += ": an episode's prompts are several times as long"
    return Check(FAILED if slow else OK, "latency", ", ".join(shown), remedy)


def _cost(calls: list[_Call], profile: Profile) -> Check:
    spent = paid(attempt for call in calls for attempt in call.attempts).cost_usd
    if spent is not None:
        return Check(OK, "cost", f"${spent:.6f} for this check")
    if profile.prices is None:
        remedy = "set prices to have costs, and budgets in dollars"
        return Check(UNKNOWN, "cost", "the profile has no prices", remedy)
    return Check(UNKNOWN, "cost", "the server does not count its tokens")


def _counted(call: _Call) -> int:
    """Input tokens of the first request that was counted; later ones also hold a complaint."""
    counts = (attempt.usage.input_tokens for attempt in call.attempts)
    return next((count for count in counts if count), 0)


def _expected_text(request: MllmRequest, profile: Profile) -> int:
    prompt = compose_prompt(request)
    texts = [prompt.system, *(part for part in prompt.parts if isinstance(part, str))]
    schema = request_schema(request)
    if schema is not None and structured_mode(profile) != "json_schema":
        texts.append(schema_prompt(schema))
    return text_tokens("".join(texts))


def _plausible(counted: int, expected: int) -> bool:
    return _PLAUSIBLE[0] * expected <= counted <= _PLAUSIBLE[1] * expected


def _by_fit(item: tuple[str, float]) -> float:
    return -item[1]
