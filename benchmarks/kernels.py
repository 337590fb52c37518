"""Cost of chips: joint histograms by each way of counting, and similarity by stack size.

It determines the constants of `joint_histogram`, and the stack size of `chip_windows`.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor

import cv2
import numpy as np
from numpy.typing import NDArray

from groundtie.rasters.patch import Patch
from groundtie.similarity import joint_histogram as counting
from groundtie.similarity.description import BORDER_PX
from groundtie.similarity.surface import SimilaritySettings, describe, similarity_surface

from .processes import shortest_s
from .suites import Settings, SuiteResult, Table

_CHIPS_PX, _RADII_PX, _BINS = (40, 64, 80, 112), (9, 13, 25), (8, 12)
_TIMES = 7

# Number of stacks that each thread matches.
_STACKS = 4

# Chip side and search radius of the fit, of a pyramid level and of the survey; stack sizes.
_SEARCHES_PX, _STACKED_PIXELS = ((58, 8), (80, 12), (64, 24)), (1, 2**15, 2**16, 2**17, 2**18)


def run(settings: Settings) -> SuiteResult:
    """Run the suite; all but stacks of chips in one thread."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        records = [
            _costs(chip, radius, bins)
            for chip in _CHIPS_PX
            for radius in _RADII_PX
            for bins in _BINS
        ]
        stacks = [
            _stack_costs(chip, radius, count) for chip, radius in _SEARCHES_PX for count in (1, 2)
        ]
    finally:
        cv2.setNumThreads(threads)
    return SuiteResult(
        "Kernels",
        (),
        (
            _table(
                "Joint histograms: nanoseconds a pixel and shift, or element and halving", records
            ),
            _table(
                "Chips: milliseconds a chip, by threads and pixels of a stack",
                stacks,
            ),
        ),
        [*records, *stacks],
    )


def _table(title: str, records: list[dict[str, float]]) -> Table:
    rows = [[f"{value:.2f}" for value in record.values()] for record in records]
    return Table(title, list(records[0]), rows)


def _stack_costs(chip_px: int, radius_px: int, threads: int) -> dict[str, float]:
    side, settings = chip_px + 2 * (radius_px + BORDER_PX), SimilaritySettings()
    random = np.random.default_rng(0)
    costs = {"chip, px": float(chip_px), "radius, px": float(radius_px), "threads": float(threads)}
    for pixels in _STACKED_PIXELS:
        count = max(pixels // side**2, 1)
        shape = count, side, side
        images = [random.rayleigh(100, shape).astype(np.float32) for _ in range(2)]

        def match(_: int, images: list[NDArray[np.float32]] = images) -> None:
            windows = (Patch(image, np.ones(image.shape, bool)) for image in images)
            own, other = (describe(window, chip_px**2, settings) for window in windows)
            similarity_surface(own.inner(radius_px), other, radius_px, settings)

        with ThreadPoolExecutor(threads) as executor:
            todo = range(threads * _STACKS)
            work = functools.partial(_map, executor, match, todo)
            seconds = shortest_s(work, _TIMES, time.perf_counter)
        costs[f"{pixels} pixels"] = seconds / (len(todo) * count) * 1e3
    return costs


def _map(executor: Executor, work: Callable[[int], object], todo: Sequence[int]) -> None:
    for _ in executor.map(work, todo):
        pass


def _costs(chip_px: int, radius_px: int, bins: int) -> dict[str, float]:
    random = np.random.default_rng(0)
    side, span = chip_px + 2 * radius_px, 2 * radius_px + 1
    template, search = (random.integers(0, bins, (n, n)).astype(np.uint8) for n in (chip_px, side))
    sizes = (bins, bins)
    pixels, elements = span**2 * chip_px**2, bins**2 * side**2 * np.log2(side**2)
    direct = shortest_s(lambda: counting._count_directly(template, search, sizes, None), _TIMES)
    spectral = shortest_s(lambda: counting._count_spectrally(template, search, sizes, 1), _TIMES)
    return {
        "chip, px": chip_px,
        "shifts a side": span,
        "bins": bins,
        "directly": float(direct / pixels * 1e9),
        "spectrally": float(spectral / elements * 1e9),
    }
