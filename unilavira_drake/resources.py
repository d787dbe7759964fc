"""Finds the package's data: a checkout's folders first, then the installed package's."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from unilavira_drake.errors import InfrastructureError

_PACKAGE = Path(__file__).resolve().parent


@cache
def _folder(name: str) -> Path:
    checkout = _PACKAGE.parent
    if (checkout / "pyproject.toml").is_file() and (checkout / name).is_dir():
        return checkout / name
    if (_PACKAGE / name).is_dir():
        return _PACKAGE / name
    raise InfrastructureError(
        f"{name}/: neither in the checkout {checkout} nor in the package {_PACKAGE}; "
        "reinstall with 'pip install --force-reinstall unilavira-drake'."
    )


def models_path() -> Path:
    """Returns the folder of robots, worlds and scenarios.

    Raises:
        InfrastructureError: if the installation lacks it.
    """
    return _folder("models")


def prompts_path() -> Path:
    """Returns the folder of prompt templates.

    Raises:
        InfrastructureError: if the installation lacks it.
    """
    return _folder("prompts")


def cassettes_path() -> Path:
    """Returns the folder of the cassettes that come with the package.

    Raises:
        InfrastructureError: if the installation lacks it.
    """
    return _folder("examples/cassettes")


def package_xml() -> Path:
    """Returns the file that makes ``package://unilavira_drake/`` known to Drake's parser.

    Raises:
        InfrastructureError: if the installation lacks it.
    """
    return models_path() / "package.xml"
