"""What a call costs: CPU time of all threads, and memory by two counts."""

from __future__ import annotations

import ctypes
import gc
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


class Mallinfo2(ctypes.Structure):
    """What the C library counts."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    )


def resident_mb() -> float:
    """Returns the resident memory of this process."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def allocated_mb() -> float:
    """Returns what this process has allocated and not freed, by the C library's count."""
    counters = ctypes.CDLL(None).mallinfo2
    counters.restype = Mallinfo2
    found = counters()
    return float(found.uordblks + found.hblkhd) / 2**20


def cpu_ms(function: Callable[[], Any]) -> float:
    """Returns the CPU time of a call, all threads, milliseconds."""
    start = time.process_time()
    function()
    return 1e3 * (time.process_time() - start)


def cpu_and_memory(function: Callable[[], Any]) -> tuple[float, float]:
    """Returns the CPU milliseconds of a call and the megabytes that its result holds."""
    gc.collect()
    before, kept = allocated_mb(), []
    spent = cpu_ms(lambda: kept.append(function()))
    return spent, allocated_mb() - before
