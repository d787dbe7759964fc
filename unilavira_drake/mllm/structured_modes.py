"""How each endpoint of this process is made to reply in JSON, as learnt from its refusals."""

from __future__ import annotations

import threading

from unilavira_drake.mllm.profile import Profile, StructuredMode

ORDER: tuple[StructuredMode, ...] = ("json_schema", "json_object_schema", "json_object", "prompt")
"""The strictest first; each is understood by more servers than the one before."""

_lock = threading.Lock()
_learnt: dict[tuple[str, str], StructuredMode] = {}


def structured_mode(profile: Profile) -> StructuredMode:
    """Returns the mode in which an endpoint is asked now."""
    with _lock:
        learnt = _learnt.get((profile.base_url, profile.model), profile.structured)
    return max(learnt, profile.structured, key=ORDER.index)


def step_down(profile: Profile, refused: StructuredMode) -> bool:
    """Notes that an endpoint does not know a mode; False if there is no lesser one."""
    after = ORDER.index(refused) + 1
    if after == len(ORDER):
        return False
    with _lock:
        endpoint = (profile.base_url, profile.model)
        # Another thread may have learnt more meanwhile.
        _learnt[endpoint] = max(_learnt.get(endpoint, refused), ORDER[after], key=ORDER.index)
    return True
