"""From the text ``SPEC`` of a flag or a scenario to a model backend."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from unilavira_drake.errors import InputError, ScenarioError, unknown_name
from unilavira_drake.mllm.baselines import FixedModel, FrontierModel, RandomModel
from unilavira_drake.mllm.mailbox import MailboxModel
from unilavira_drake.mllm.profile import Profile
from unilavira_drake.mllm.profiles import AD_HOC, load_profile, profile_names
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.replay import CassetteModel
from unilavira_drake.mllm.reply import Mllm
from unilavira_drake.mllm.rules import RulesModel, read_dials
from unilavira_drake.resources import cassettes_path

SPECS = (
    "rules[:PRESET|:DIAL=VALUE,...] | random | frontier | fixed | cassette:FILE | mailbox:DIR | "
    "PROFILE | PROFILE.yaml | openai:MODEL@BASE_URL"
)
"""What a spec may be, for help texts; FILE may be the bare name of a cassette that comes with the
package."""

_PROGRAMS: dict[str, Callable[[], Mllm]] = {
    "rules": RulesModel,
    "random": RandomModel,
    "frontier": FrontierModel,
    "fixed": FixedModel,
}
_FOLDERS = {"cassette": "cassette:FILE", "mailbox": "mailbox:DIR"}
_FILES = (".yaml", ".yml")


def make_backend(spec: str, *, role: str, place: str) -> Mllm:
    """Returns the model that a spec names, see ``SPECS``.

    Nothing is written, connected or started before its first call.

    Args:
        role: ``language`` | ``vision`` | ``judge``: for which of them it answers.
        place: where the spec stands, e.g. ``language_model``; opens an error's message.

    Raises:
        ScenarioError: if the spec names nothing that can be used; names the nearest valid one.
    """
    profile = profile_of(spec, place=place)
    if profile is not None:
        # A judge reads: it has the key and the settings of a language model.
        return RemoteModel(profile, role="language" if role == "judge" else role)
    name, _, rest = spec.partition(":")
    if name in _FOLDERS:
        if not rest:
            raise ScenarioError(f"{place}: {spec!r} must be {_FOLDERS[name]}.")
        path = Path(rest).expanduser()
        if name == "cassette" and not path.exists():
            path = _shipped(rest, place)
        try:
            return MailboxModel(path) if name == "mailbox" else CassetteModel(path, role=role)
        except InputError as error:
            raise ScenarioError(f"{place}: {error}") from None
    if name not in _PROGRAMS:
        names = (*_PROGRAMS, *_FOLDERS.values(), f"{AD_HOC}MODEL@BASE_URL", *profile_names())
        raise ScenarioError(unknown_name("model", spec, names, place))
    if spec == name:
        return _PROGRAMS[name]()
    if name != "rules":
        raise ScenarioError(f"{place}: {name!r} takes no preset and no dials: {spec!r}.")
    try:
        return RulesModel(read_dials(rest))
    except InputError as error:
        raise ScenarioError(f"{place}: {error}") from None


def _shipped(name: str, place: str) -> Path:
    """Returns the cassette of this name that comes with the package.

    Raises:
        ScenarioError: if there is none, and no such file either.
    """
    shipped = {path.stem: path for path in sorted(cassettes_path().glob("*.jsonl"))}
    if name not in shipped:
        raise ScenarioError(unknown_name("cassette (and no such file)", name, shipped, place))
    return shipped[name]


def profile_of(spec: str, *, place: str) -> Profile | None:
    """Returns the profile that a spec names; None for a model without one.

    Raises:
        ScenarioError: if the profile cannot be used.
    """
    if spec.partition(":")[0] in (*_PROGRAMS, *_FOLDERS):
        return None
    if spec.startswith(AD_HOC) or spec.endswith(_FILES) or spec in profile_names():
        return load_profile(spec, place=place)
    return None
