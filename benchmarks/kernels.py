"""What counting joint histograms costs by each of its ways: the constants of `joint_histogram`."""

from __future__ import annotations

import time
from collections.abc import Callable

import cv2
import numpy as np

from groundtie.similarity import joint_histogram as counting

from .suites import Settings, SuiteResult, Table

_CHIPS_PX, _RADII_PX, _BINS = (40, 64, 80, 112), (9, 13, 25), (8, 12)
_TIMES = 7


def run(settings: Settings) -> SuiteResult:
    """Run the suite, in one thread."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        records = [
            _costs(chip, radius, bins)
            for chip in _CHIPS_PX
            for radius in _RADII_PX
            for bins in _BINS
        ]
    finally:
        cv2.setNumThreads(threads)
    head = list(records[0])
    rows = [[f"{value:.2f}" for value in record.values()] for record in records]
    return SuiteResult(
        "Kernels",
        (),
        (
            Table(
                "Joint histograms: nanoseconds a pixel and shift, or element and halving",
                head,
                rows,
            ),
        ),
        records,
    )


def _costs(chip_px: int, radius_px: int, bins: int) -> dict[str, float]:
    random = np.random.default_rng(0)
    side, span = chip_px + 2 * radius_px, 2 * radius_px + 1
    template, search = (random.integers(0, bins, (n, n)).astype(np.uint8) for n in (chip_px, side))
    sizes = (bins, bins)
    pixels, elements = span**2 * chip_px**2, bins**2 * side**2 * np.log2(side**2)
    direct = _seconds(lambda: counting._count_directly(template, search, sizes, None))
    spectral = _seconds(lambda: counting._count_spectrally(template, search, sizes, 1))
    return {
        "chip, px": chip_px,
        "shifts a side": span,
        "bins": bins,
        "directly": float(direct / pixels * 1e9),
        "spectrally": float(spectral / elements * 1e9),
    }


def _seconds(work: Callable[[], object]) -> float:
    """Return the processor's time for work in this thread, the least of several runs."""
    seconds = []
    for _ in range(_TIMES):
        started = time.thread_time()
        work()
        seconds.append(time.thread_time() - started)
    return min(seconds)
