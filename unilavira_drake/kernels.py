"""Compiling numerical loops: the one place that knows numba.

A kernel is compiled at its first call and kept in numba's cache on disk; modules with kernels
offer a ``warm_up`` that makes that first call, and Systems call it when they are constructed,
so that no control loop waits for the compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

# Some releases of numba carry types and some do not; the functions keep their own here.
_njit: Any = numba.njit

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compiles a function of numbers and arrays, without bounds checks.

    Where neither the package's folder nor the user's cache folder can be written, it is compiled
    anew in each process.
    """
    return _compiled(function, forceinline=False)


def inlined_kernel(function: F) -> F:
    """As :func:`kernel`, for a step of an inner loop: made part of every kernel that calls it."""
    return _compiled(function, forceinline=True)


def _compiled(function: F, **options: bool) -> F:
    try:
        return cast(F, _njit(cache=True, nogil=True, error_model="numpy", **options)(function))
    except RuntimeError:
        return cast(F, _njit(nogil=True, error_model="numpy", **options)(function))


def frozen_view(array: NDArray[Any], dtype: type[np.generic]) -> NDArray[Any]:
    """Returns a contiguous read-only view (a copy only where layout or dtype differ).

    Kernels see one kind of array, whatever its owner, so each is compiled once.
    """
    view: NDArray[Any] = np.ascontiguousarray(array, dtype=dtype).view()
    view.flags.writeable = False
    return view
