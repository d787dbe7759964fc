"""From the text ``SPEC`` of a flag or a scenario to a model backend."""

from __future__ import annotations

from collections.abc import Callable

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.mllm.baselines import FrontierModel, RandomModel
from unilavira_drake.mllm.reply import Mllm
from unilavira_drake.mllm.rules import RulesModel

_BACKENDS: dict[str, Callable[[], Mllm]] = {
    "rules": RulesModel,
    "random": RandomModel,
    "frontier": FrontierModel,
}
PRESETS: dict[str, tuple[str, ...]] = {"rules": ("default",)}
"""Backend -> what may follow its name after a colon."""


def make_backend(spec: str, *, place: str) -> Mllm:
    """Returns the model that a spec names: ``rules[:PRESET]``, ``random`` or ``frontier``.

    Args:
        place: where the spec stands, e.g. ``language_model``; opens an error's message.

    Raises:
        ScenarioError: if the backend or its preset is unknown; names the nearest valid one.
    """
    name, colon, preset = spec.partition(":")
    if name not in _BACKENDS:
        raise ScenarioError(unknown_name("model", spec, _BACKENDS, place))
    if colon and preset not in PRESETS.get(name, ()):
        raise ScenarioError(
            unknown_name(f"preset of {name!r}", preset, PRESETS.get(name, ()), place)
        )
    return _BACKENDS[name]()
