"""The base of every value on an abstract port: frozen, shared, never copied.

Drake deep-copies Python values when it clones a Context, evaluates a state output or runs an
unrestricted update.  A message holds tuples and read-only arrays only, so sharing is safe and
a copy is the object itself.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", bound="Message")


class Message:
    """An immutable value; subclasses are frozen dataclasses."""

    def __copy__(self: T) -> T:
        return self

    def __deepcopy__(self: T, memo: dict[int, Any]) -> T:
        return self


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Returns a contiguous read-only array that shares no memory with a writable one.

    An array that already is read-only and owns its data is returned as it is.
    """
    if not array.flags.writeable and array.base is None and array.flags.c_contiguous:
        return array
    copy = np.array(array, order="C")
    copy.flags.writeable = False
    return copy
