"""Time and memory of `coregister` from 2000² to 30 000² pixels, and how they grow.

The largest pair and its result take 15 GB of disk in the folder of temporary files.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from .accuracy import CORRECT, REFUSED, classify
from .attempt import Pair
from .large_pairs import large_pair, tile_pair
from .processes import measure
from .speed import own_command, own_error_px
from .suites import Goal, Settings, SuiteResult, Table

SIZES, QUICK_SIZES = (2000, 10_000, 30_000), (1000, 2000)

# For the largest pair: wall-clock time on an otherwise idle machine with two processors.
LARGEST_SECONDS, LARGEST_BYTES = 300.0, 1.2e9

# Largest exponent of the growth of time with the number of pixels.
LARGEST_EXPONENT = 1.05


@dataclass(frozen=True)
class Run:
    """One registration of a pair of a certain size.

    Parameters
    ----------
    size
        Width and height, in pixels.
    seconds, processor_seconds, peak_bytes
        Of the whole process, including start, imports and written output.
    verdict, error_px
        Verdict and error against the truth.
    """

    size: int
    seconds: float
    processor_seconds: float
    peak_bytes: int
    verdict: str
    error_px: float | None


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    tile = tile_pair(settings.cache)
    runs = []
    for size in QUICK_SIZES if settings.quick else SIZES:
        with tempfile.TemporaryDirectory() as folder:
            runs.append(register(large_pair(tile, size, Path(folder)), size))
        print(runs[-1], flush=True)
    return SuiteResult(
        "Large scenes",
        goals(runs, is_complete=not settings.quick),
        (table(runs),),
        [asdict(one) for one in runs],
        ("Reference: SAR amplitude; input: four bands; both 16 bit, deflated, without overviews.",),
    )


def register(pair: Pair, size: int) -> Run:
    """Register a pair, judge the result, and measure the process."""
    found = measure(own_command(pair))
    error = own_error_px(found.output, pair)
    verdict = REFUSED if error is None else classify(True, error, 0.0)
    return Run(size, found.seconds, found.processor_seconds, found.peak_bytes, verdict, error)


def exponent(runs: Sequence[Run]) -> float:
    """Return the exponent of processor time as a power of pixels: the slope of the logarithms."""
    pixels = [2 * np.log(one.size) for one in runs]
    return float(np.polyfit(pixels, np.log([one.processor_seconds for one in runs]), 1)[0])


def goals(runs: Sequence[Run], *, is_complete: bool) -> list[Goal]:
    """Return the goals, which count only if all sizes were measured."""
    largest, grown = runs[-1], exponent(runs)
    name = f"{largest.size}² px"
    correct = sum(one.verdict == CORRECT for one in runs)
    found = (
        (f"Time of {name}", f"≤ {LARGEST_SECONDS:g} s on two free processors",
         f"{largest.seconds:.0f} s, {largest.processor_seconds:.0f} s of processors",
         largest.seconds <= LARGEST_SECONDS),
        (f"Peak memory of {name}", f"≤ {LARGEST_BYTES / 1e9:g} GB",
         f"{largest.peak_bytes / 1e9:.2f} GB", largest.peak_bytes <= LARGEST_BYTES),
        ("Power of pixels that processor time grows with", f"≤ {LARGEST_EXPONENT:g}",
         f"{grown:.2f}", grown <= LARGEST_EXPONENT),
        ("Correct", "all", f"{correct} of {len(runs)}", correct == len(runs)),
    )  # fmt: skip
    return [Goal(what, *rest, reached if is_complete else None) for what, *rest, reached in found]


def table(runs: Sequence[Run]) -> Table:
    """Return the measurements."""
    head = ("pixels", "s", "s of processors", "µs of processors a pixel", "peak MB", "result")
    rows = [
        [
            f"{one.size}²",
            f"{one.seconds:.1f}",
            f"{one.processor_seconds:.1f}",
            f"{one.processor_seconds / one.size**2 * 1e6:.2f}",
            f"{one.peak_bytes / 1e6:.0f}",
            one.verdict if one.error_px is None else f"{one.verdict}, {one.error_px:.2f} px",
        ]
        for one in runs
    ]
    return Table("coregister by size", head, rows)
