"""How much memory a process is to take: the user's budget, and what is given of it to what.

What a tool cannot do without, libraries, reduced images and the tiles that its threads work on, is
the same for scenes of any size. What it keeps so as not to read it again gets shares of the budget;
no result depends on them.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from typing import Any

from .errors import MemoryLimitError, ParameterError

VARIABLE = "GROUNDTIE_MEMORY"
DEFAULT_MB, LEAST_MB, MOST_MB = 1000, 100, 1_000_000

# For GDAL, which keeps blocks of files. Scenes are read in strips lower than their blocks: a row of
# blocks of both images must fit in, or is decompressed again for every strip. By default that are
# 200 MB; 154 MB are those of 30 000 pixels of one and of four bands of 16 bits, 512 lines high;
# more saves nothing (suite large).
_CACHE_SHARE = 0.2

# For the dates of a series, which are matched again and again.
DATES_SHARE = 0.4

# For what chips of its reference are described by, which is the same for every date: 111 MB in the
# timed series of the suite series, of 560² pixels.
DESCRIBED_SHARE = 0.15

# So many distances, or values of kernels, of all rows of one table with all of another one are made
# at a time: 32 MB, which take part in no budget.
AT_ONCE = 4_000_000

# What glibc's `mallopt` calls its options, and what they are set to. Threads share two heaps: there
# are eight for each processor else, of which each keeps what its threads have given back, 110 MB
# in the registration of 10 000² pixels by two threads, and no time is saved by it. Arrays come from
# heaps up to 32 MB, and 64 MB stay at their ends, as glibc adapts to by itself; but Dask has its
# workers give back each array at once, which doubles the time of a registration (suite batch).
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
_HEAPS = {_M_ARENA_MAX: 2, _M_MMAP_THRESHOLD: 32 << 20, _M_TRIM_THRESHOLD: 64 << 20}


def budget_bytes() -> int:
    """Return how much memory this process is to take, as the environment states it.

    Raises
    ------
    ParameterError
        It states no such amount.
    """
    text = os.environ.get(VARIABLE, str(DEFAULT_MB))
    try:
        megabytes = float(text)
    except ValueError:
        megabytes = float("nan")
    if not LEAST_MB <= megabytes <= MOST_MB:
        raise ParameterError(
            f"the memory (--memory or {VARIABLE}) must be {LEAST_MB} to {MOST_MB} megabytes, "
            f"not {text!r}"
        )
    return round(megabytes * 1e6)


def share_bytes(share: float) -> int:
    """Return how much a share of the budget is."""
    return round(share * budget_bytes())


def bounded_cache() -> Any:
    """Return the environment in which GDAL keeps a bounded amount of what it has read.

    Of itself it is a twentieth of the machine's memory. Tools that take rasters run in it.
    """
    import rasterio  # not for the command line's help

    return rasterio.Env(GDAL_CACHEMAX=share_bytes(_CACHE_SHARE))


def require_bytes(needed: float, what: str) -> None:
    """Stop before something begins that takes more than the budget.

    Raises
    ------
    MemoryLimitError
        It does.
    """
    budget = budget_bytes()
    if needed > budget:
        raise MemoryLimitError(
            f"{what} takes {needed / 1e9:.2f} GB, more than the budget of {budget / 1e9:.2f} GB "
            f"(--memory, {VARIABLE})"
        )


def set_heaps() -> None:
    """Set how memory is allocated in this process, where its C library is glibc.

    For processes that do this package's work alone: the command line, and workers.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library has no `mallopt`
            library = ctypes.CDLL(None)
            for option, value in _HEAPS.items():
                library.mallopt(option, value)
