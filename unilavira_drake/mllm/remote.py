"""A model behind a network: any endpoint of a profile, in either dialect."""

from __future__ import annotations

from collections import OrderedDict

import pydantic

from unilavira_drake.errors import MllmError
from unilavira_drake.mllm.address import host_of
from unilavira_drake.mllm.breaker import Breaker, breaker_of
from unilavira_drake.mllm.cancellation import Cancellation
from unilavira_drake.mllm.gemini import GeminiDialect
from unilavira_drake.mllm.http import HttpClient, shared_client
from unilavira_drake.mllm.keys import check_key, find_key
from unilavira_drake.mllm.openai_compatible import OpenAiDialect
from unilavira_drake.mllm.profile import Dialect, Profile
from unilavira_drake.mllm.rate_limit import RateLimit
from unilavira_drake.mllm.remote_call import Line, RemoteCall
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.mllm.retrying import RetryPolicy
from unilavira_drake.mllm.wire import WireDialect

_DECISIONS_KEPT = 64

_DIALECTS: dict[Dialect, type[WireDialect]] = {"gemini": GeminiDialect, "openai": OpenAiDialect}


class RemoteModel:
    """Asks one endpoint for one role; calls may come from several threads at once.

    Constructing it has no effect: the key is looked up and a connection made at the first call.
    The circuit breaker, and the way of asking for JSON that an endpoint understands, are shared
    by all models of the process; rate limits by all processes of the user.

    Args:
        role: ``language`` or ``vision``.
        key: None for the environment's (``UNILAVIRA_LANGUAGE_API_KEY`` or
            ``UNILAVIRA_VISION_API_KEY``, else ``UNILAVIRA_API_KEY``), an empty text for none.
        http: None for the client that the process shares.
        retries: the waits between tries; None for the usual ones.
        breaker: None for the one that the process shares.
    """

    def __init__(
        self,
        profile: Profile,
        *,
        role: str,
        key: str | None = None,
        http: HttpClient | None = None,
        retries: RetryPolicy | None = None,
        breaker: Breaker | None = None,
    ) -> None:
        self._profile = profile
        self._role = role
        self._key = None if key is None else pydantic.SecretStr(key)
        self._http = http
        self._retries = retries or RetryPolicy()
        self._breaker = breaker
        self._cancellation = Cancellation()
        self._spent: OrderedDict[tuple[int, int], float] = OrderedDict()
        """Seconds that the earlier attempts at a decision took, by (seed, n)."""

    @property
    def name(self) -> str:
        """The profile's name."""
        return self._profile.name

    @property
    def perception(self) -> str:
        """``images``, or ``ground_truth`` for a server with rules behind it."""
        return "ground_truth" if self._profile.peer == "rules" else "images"

    @property
    def reasoning(self) -> str:
        """``model``, or ``rules`` for a server with rules behind it."""
        return "rules" if self._profile.peer == "rules" else "model"

    @property
    def description(self) -> str:
        """What the profile says of the model, and where it is."""
        host = host_of(self._profile.base_url)
        told = self._profile.description
        return told if host in told else f"{told} (at {host})"

    @property
    def box_space(self) -> str:
        """How it writes places in a picture."""
        return self._profile.box_space

    @property
    def deadline(self) -> float:
        """Wall-clock seconds for a decision, waiting for an absent endpoint included.

        A re-ask has what the attempt before it has left.
        """
        return self._profile.settings(self._role).deadline + self._profile.outage_patience

    def complete(self, request: MllmRequest) -> Completion:
        """Answers a request.

        Raises:
            MllmTimeout: if no reply comes before the deadline.
            MllmUnreachable: if there is no connection or no usable answer, also after retries, or
                the endpoint is left alone for now because it keeps failing.
            MllmAuthenticationError: if the key is missing, refused or not to be sent there.
            MllmQuotaError: if the quota is used up, or the next try is allowed too late.
            ContextLengthError: if the prompt is too long.
            MllmRequestError: if the server refuses this request.
            MllmError: if the model was closed before it replied.
            ReplyTruncated: if the reply was cut off twice, the second time at twice the length.
            ReplyRefused: if the model or its provider refuses to answer.
            ReplyFormatError: if the reply holds no text.
        """
        if self._cancellation.thrown:
            raise MllmError("the model is closed.")
        profile = self._profile
        line = Line(
            profile=profile,
            role=self._role,
            dialect=_DIALECTS[profile.dialect](),
            http=self._http or shared_client(),
            breaker=self._breaker or breaker_of(profile.base_url, profile.model),
            limit=RateLimit(
                f"{profile.base_url} {profile.model}",
                requests_per_minute=profile.requests_per_minute,
                tokens_per_minute=profile.tokens_per_minute,
            ),
            policy=self._retries,
            cancellation=self._cancellation,
        )
        decision = (request.seed, request.n)
        spent = self._spent.get(decision, 0.0) if request.attempt else 0.0
        call = RemoteCall(line, request, self._find_key(), spent=spent)
        try:
            return call.run()
        finally:
            self._spent[decision] = spent + call.seconds
            while len(self._spent) > _DECISIONS_KEPT:
                self._spent.popitem(last=False)

    def close(self) -> None:
        """Breaks off the calls under way; the model is not asked again."""
        self._cancellation.throw()

    def _find_key(self) -> pydantic.SecretStr | None:
        base_url = self._profile.base_url
        if self._key is None:
            return find_key(self._role, base_url)
        text = self._key.get_secret_value()
        return check_key(text, base_url, "the given key") if text else None
