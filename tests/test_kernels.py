import numpy as np
import pytest

from unilavira_drake import kernels


def test_a_frozen_view_shares_memory_and_cannot_be_written():
    array = np.zeros((3, 4), np.float32)
    view = kernels.frozen_view(array, np.float32)
    assert np.shares_memory(view, array)
    assert not view.flags.writeable
    assert array.flags.writeable
    assert kernels.frozen_view(array.T, np.float32).flags.c_contiguous
    assert kernels.frozen_view(array, np.float64).dtype == np.float64


def test_kernels_compile_where_nothing_can_be_cached(monkeypatch):
    def njit(cache=False, **options):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: function

    monkeypatch.setattr(kernels, "_njit", njit)
    assert kernels.kernel(abs)(-2) == 2
    assert kernels.inlined_kernel(abs)(-2) == 2


def test_a_kernel_gives_what_the_function_gives():
    @kernels.inlined_kernel
    def square(x: float) -> float:
        return x * x

    @kernels.kernel
    def norm(values: np.ndarray) -> float:
        total = 0.0
        for value in values:
            total += square(value)
        return total

    assert norm(np.array([3.0, 4.0])) == pytest.approx(25.0)
