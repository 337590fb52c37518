"""Processing time for the features of large optical images."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from affine import Affine
from numpy.typing import NDArray

from groundtie.context import threads
from groundtie.rasters.patch import Patch
from groundtie.studies.haar import HaarDescriptor
from groundtie.studies.surf import SurfDetector

from .cases import REFERENCE_TRANSFORM, RealCase, read_image, write_image
from .processes import OUTPUT, measure
from .suites import Goal, Table

SIDE_PX = 2000
THREADS = 2
SURF, REGISTRATION = "SURF-64, one image", "match_optical, two images"
LONGEST_S = {SURF: 2.0, REGISTRATION: 15.0}

# An unrotated pair, whose images are mirrored at their borders until they are large enough.
SOURCE = "oo-nanjing"
_SHIFT_PX = (7.3, -4.6)
_TIMES = 3


@dataclass(frozen=True)
class Timing:
    """One measurement: wall-clock time, and the time of all processors together."""

    what: str
    seconds: float
    processor_seconds: float

    @property
    def least_seconds(self) -> float:
        """The time on two idle processors that share the work well."""
        return self.processor_seconds / THREADS


def time_features(case: RealCase) -> list[Timing]:
    """Time SURF, and a whole registration as a process of its own."""
    images = [_large(read_image(path)) for path in (case.reference, case.input)]
    grey = images[0].mean(axis=0, dtype=np.float32)
    window = Patch(grey, np.ones(grey.shape, bool))
    cv2.setNumThreads(THREADS)
    with threads(THREADS) as context:

        def surf() -> None:
            found = SurfDetector().detect(window, context)
            HaarDescriptor().describe(window, found, context)

        timings = [_shortest(SURF, surf)]
    with tempfile.TemporaryDirectory() as folder:
        reference = write_image(images[0], REFERENCE_TRANSFORM, Path(folder) / "reference.tif")
        claimed = REFERENCE_TRANSFORM * Affine.translation(*_SHIFT_PX)
        moved = write_image(images[1], claimed, Path(folder) / "input.tif")
        files = [str(reference), str(moved), OUTPUT]
        words = ["-m", "groundtie", "match-optical", *files, "--quiet", "--search-radius", "20"]
        measured = measure([sys.executable, *words, "--workers", str(THREADS)])
    if measured.exit_code != 0:
        raise RuntimeError("the registration that was timed was refused")
    return [*timings, Timing(REGISTRATION, measured.seconds, measured.processor_seconds)]


def timing_goals(timings: Sequence[Timing]) -> list[Goal]:
    """Return the timing goals, which other work on the machine must not decide, and findings."""
    return [
        Goal(
            f"{one.what} of {SIDE_PX}×{SIDE_PX} px",
            f"at most {LONGEST_S[one.what]:g} s on {THREADS} processors",
            f"{one.processor_seconds:.1f} processor seconds, {one.seconds:.1f} s by the clock",
            one.least_seconds <= LONGEST_S[one.what],
        )
        for one in timings
    ]


def timing_table(timings: Sequence[Timing]) -> Table:
    """Return all timings."""
    rows = [[one.what, f"{one.seconds:.2f}", f"{one.processor_seconds:.2f}"] for one in timings]
    head = ("", f"s by the clock, {os.cpu_count()} processors", "s of all processors")
    return Table(f"Time for {SIDE_PX}×{SIDE_PX} px", head, rows)


def _large(image: NDArray[Any]) -> NDArray[Any]:
    beyond = [max(SIDE_PX - size, 0) for size in image.shape[1:]]
    padded = np.pad(image, ((0, 0), *((0, more) for more in beyond)), mode="symmetric")
    return np.ascontiguousarray(padded[:, :SIDE_PX, :SIDE_PX])


def _shortest(what: str, work: Callable[[], None]) -> Timing:
    timings = []
    for _ in range(_TIMES):
        started = time.perf_counter(), time.process_time()
        work()
        timings.append(
            Timing(what, time.perf_counter() - started[0], time.process_time() - started[1])
        )
    return min(timings, key=lambda one: one.processor_seconds)
