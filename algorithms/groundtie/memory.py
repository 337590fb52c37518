"""The memory budget of a process, and its shares.

The indispensable memory of a tool, for libraries, reduced images and the tiles that its threads
work on, is the same for scenes of any size. Data that are kept to avoid reading them again get
shares of the budget; no result depends on them.
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

# Share of GDAL's cache of blocks. Scenes are read in strips lower than their blocks: a row of
# blocks of both images must fit in, or it is decompressed again for every strip. The default is
# 200 MB. Rows of blocks of 30 000 pixels, 512 lines high, with one and with four bands of 16 bits,
# take 154 MB; more saves nothing (suite large).
_CACHE_SHARE = 0.2

# Share of the dates of a series, which are matched repeatedly.
DATES_SHARE = 0.4

# Share of the descriptors of the reference's chips, which are the same for every date: 111 MB in
# the timed series of the suite series, of 560² pixels.
DESCRIBED_SHARE = 0.15

# Most distances, or kernel values, between all rows of two tables that are computed at a time:
# 32 MB, which are outside of the budget.
AT_ONCE = 4_000_000

# Options of glibc's `mallopt`, and their values. Threads share two heaps. The default is eight for
# each processor; each keeps memory that its threads have freed, 110 MB in the registration of
# 10 000² pixels by two threads, and saves no time. Arrays of up to 32 MB come from heaps, and 64 MB
# stay at the heaps' ends. glibc adapts to these values by itself, but Dask has its workers return
# each array at once, which doubles the time of a registration (suite batch).
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
_HEAPS = {_M_ARENA_MAX: 2, _M_MMAP_THRESHOLD: 32 << 20, _M_TRIM_THRESHOLD: 64 << 20}


def budget_bytes() -> int:
    """Return the memory budget of this process, from the environment.

    Raises
    ------
    ParameterError
        The environment states no valid budget.
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
    """Return a share of the budget in bytes."""
    return round(share * budget_bytes())


def bounded_cache() -> Any:
    """Return the environment that bounds GDAL's cache of blocks.

    GDAL's default is a twentieth of the machine's memory. Tools that take rasters run in it.
    """
    import rasterio  # not for the command line's help

    return rasterio.Env(GDAL_CACHEMAX=share_bytes(_CACHE_SHARE))


def require_bytes(needed: float, what: str) -> None:
    """Raise an error before a step that needs more memory than the budget.

    Raises
    ------
    MemoryLimitError
        The step needs more.
    """
    budget = budget_bytes()
    if needed > budget:
        raise MemoryLimitError(
            f"{what} takes {needed / 1e9:.2f} GB, more than the budget of {budget / 1e9:.2f} GB "
            f"(--memory, {VARIABLE})"
        )


def set_heaps() -> None:
    """Set the allocation of memory in this process, if its C library is glibc.

    For processes that do this package's work alone: the command line, and workers.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library has no `mallopt`
            library = ctypes.CDLL(None)
            for option, value in _HEAPS.items():
                library.mallopt(option, value)
