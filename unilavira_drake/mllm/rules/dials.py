"""The dials of ``rules``: how badly it sees, remembers, decides and writes."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from unilavira_drake.errors import InputError, unknown_name

PROBABILITY = (0.0, 1.0)
LIMITS: dict[str, tuple[float, float]] = {
    "label_dropout": PROBABILITY,
    "box_jitter": (0.0, 0.5),
    "confusion": PROBABILITY,
    "wrong_direction": PROBABILITY,
    "forgets_after": (0, 1000),
    "malformed": PROBABILITY,
    "refused": PROBABILITY,
    "latency": (0.0, 600.0),
    "seed": (0, 2**31 - 1),
}
"""Dial -> least and greatest value."""


@dataclass(frozen=True)
class RulesDials:
    """Errors that are laid around the rules; all zero is ``rules`` itself.

    Every draw is a function of ``seed``, of the request's own seed, role, number, attempt and
    task, and of the thing concerned: equal requests get equal replies.  It does not depend on its
    dial's value, so what goes wrong at a low value goes wrong at a higher one, too.

    Raises:
        InputError: if a value is out of its ``LIMITS``.
    """

    label_dropout: float = 0.0
    """Probability that a detection is missing, each one in each view of each request alone."""
    box_jitter: float = 0.0
    """Standard deviation of each edge of a box, and of its point, as a share of the box's width
    or height.  Edges on the picture's border stay there."""
    confusion: float = 0.0
    """Probability that a thing is taken for one of a similar class, or a floor for that of a
    similar kind of room, see ``confusion.SIMILAR``."""
    wrong_direction: float = 0.0
    """Probability that a ``turn`` names another direction than the rules chose."""
    forgets_after: int = 0
    """How many of the last decisions it still knows, with the waypoints at which they were made;
    0 never forgets.  The TODO list always stays in sight."""
    malformed: float = 0.0
    """Probability that the text of a reply cannot be used, at each attempt anew."""
    refused: float = 0.0
    """Probability that an attempt is refused instead of answered."""
    latency: float = 0.0
    """Seconds that it claims to have taken for each reply; 0 claims nothing."""
    seed: int = 0
    """Chooses which of equally likely errors are made."""

    def __post_init__(self) -> None:
        """Checks every dial."""
        for name, (least, most) in LIMITS.items():
            value, kind = getattr(self, name), type(getattr(RulesDials, name))
            whole = "a whole number" if kind is int else "a number"
            right = type(value) is int or (kind is float and type(value) is float)
            if not (right and least <= value <= most):
                must = f"must be {whole} from {least:g} to {most:.15g}"
                raise InputError(f"the dial {name}={value} {must}.")

    def __str__(self) -> str:
        """Returns the dials that are not zero as a spec has them: ``confusion=0.05, seed=3``."""
        values = dataclasses.asdict(self)
        return ", ".join(f"{name}={value!r}" for name, value in values.items() if value)


RULES_PRESETS: dict[str, RulesDials] = {
    "default": RulesDials(),
    "realistic": RulesDials(
        label_dropout=0.1,
        box_jitter=0.05,
        confusion=0.05,
        wrong_direction=0.05,
        forgets_after=8,
        malformed=0.02,
        refused=0.005,
    ),
}
"""Name -> dials.  ``realistic`` is a choice of plausible magnitudes, no measurement of any model;
docs/rules.md tells what each was chosen by."""


def read_dials(text: str) -> RulesDials:
    """Returns the dials that ``PRESET``, ``DIAL=VALUE,...`` or ``PRESET,DIAL=VALUE,...`` name.

    Raises:
        InputError: if a name is unknown, one is given twice, or a value is out of range; says
            what is nearest.
    """
    first, *rest = (part.strip() for part in text.split(","))
    dials = RULES_PRESETS["default"]
    if "=" in first:
        rest.insert(0, first)
    elif first in RULES_PRESETS:
        dials = RULES_PRESETS[first]
    else:
        names = (*RULES_PRESETS, *(f"{name}=VALUE" for name in LIMITS))
        raise InputError(unknown_name("preset or dial", first, names, "'rules'"))
    given: dict[str, Any] = {}
    for part in rest:
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if name not in LIMITS:
            raise InputError(unknown_name("dial", name, LIMITS, "'rules'"))
        if name in given:
            raise InputError(f"'rules': the dial {name!r} is given twice.")
        if not equals:
            raise InputError(f"'rules': the dial {name!r} needs a value: {name}=VALUE.")
        given[name] = _number(value)
    return dataclasses.replace(dials, **given)


def _number(text: str) -> int | float | str:
    """Returns the number that a text is, or the text for the check to name."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
