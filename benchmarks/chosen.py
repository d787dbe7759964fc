"""Names on the command line of a benchmark, which has nothing to measure under any other."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable

from unilavira_drake.errors import unknown_name


def names_among(kind: str, valid: Iterable[str]) -> Callable[[str], list[str]]:
    """Returns argparse's ``type`` of comma-separated names, all of which must be valid.

    Args:
        kind: what the names are of, e.g. ``group``.
        valid: the names.
    """
    known = tuple(valid)

    def names(text: str) -> list[str]:
        found = [name.strip() for name in text.split(",") if name.strip()]
        for name in found:
            if name not in known:
                raise argparse.ArgumentTypeError(unknown_name(kind, name, known, repr(text)))
        return found

    return names
