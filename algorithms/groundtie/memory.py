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

from .errors import ParameterError

VARIABLE = "GROUNDTIE_MEMORY"
DEFAULT_MB, LEAST_MB, MOST_MB = 1000, 100, 1_000_000

# For GDAL, which keeps blocks of files. Scenes are read in strips lower than their blocks: a row of
# blocks of both images must fit in, or is decompressed again for every strip. By default that are
# 200 MB; 154 MB are those of 30 000 pixels of one and of four bands of 16 bits, 512 lines high;
# more saves nothing (suite large).
_CACHE_SHARE = 0.2

# For the dates of a series, which are matched again and again.
_DATES_SHARE = 0.4

# Of glibc: how many heaps threads share, and what means that limit in its `mallopt`. By default it
# is eight for each processor, of which each keeps what its threads have given back: 180 MB in the
# registration of 10 000² pixels by two threads, and no time is saved by it (suite large).
_HEAPS, _M_ARENA_MAX = 2, -8


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
            f"memory must be {LEAST_MB} to {MOST_MB} megabytes, not {text!r} ({VARIABLE})"
        )
    return round(megabytes * 1e6)


def cache_bytes() -> int:
    """Return how much GDAL may keep of what it has read."""
    return round(_CACHE_SHARE * budget_bytes())


def dates_bytes() -> int:
    """Return how much the dates of a series may take."""
    return round(_DATES_SHARE * budget_bytes())


def share_heaps() -> None:
    """Have the threads of this process share few heaps, where its C library is glibc.

    For processes of this package's own, before they have threads.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):  # another C library has no `mallopt`
            ctypes.CDLL(None).mallopt(_M_ARENA_MAX, _HEAPS)
