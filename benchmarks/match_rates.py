"""Correct-match rates of features of optical images ([Patel2017] 4.7, 5.5)."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundtie.features.descriptors import SiftDescriptor
from groundtie.features.detectors import SiftDetector
from groundtie.features.hog import HogDescriptor
from groundtie.features.keypoints import Keypoints
from groundtie.features.tiles import Describing, Detecting
from groundtie.rasters.patch import Patch
from groundtie.studies.haar import HaarDescriptor
from groundtie.studies.matching import match
from groundtie.studies.surf import SurfDetector

from .accuracy import FloatArray
from .cases import RealCase
from .offsets import OffsetPair, Scene, open_offset

# Matches within these distances of the truth count as right ([Patel2017]: 5 px).
LIMITS_PX = (5.0, 1.5)
BEST = 20

# Number of features that are matched: the strongest ones.
MOST_FEATURES = 2000

METHODS: dict[str, tuple[Detecting, Describing]] = {
    "SURF-64": (SurfDetector(), HaarDescriptor()),
    "HOG-81": (SurfDetector(), HogDescriptor(9)),
    "HOG-63": (SurfDetector(), HogDescriptor(7)),
    "SIFT-128": (SiftDetector(), SiftDescriptor()),
    "SIFT + HOG-81": (SiftDetector(), HogDescriptor(9)),
}

# Shift between the images in pixels, unknown to the matching.
_OFFSET_PX = np.array([3.0, -2.0])


@dataclass(frozen=True)
class MatchRate:
    """The match rates of one pair and method.

    Parameters
    ----------
    name, group
        The pair.
    method, refinement
        The method, and the refinement that leaves features out ("" for none).
    matches
        Number of matches: features that are mutual nearest neighbours.
    rates
        Share of the matches within each of `LIMITS_PX`.
    correct_at_20
        Number of the 20 matches with the smallest ratio that are within the first limit.
    seconds
        Processor time for detection, description and matching.
    """

    name: str
    group: str
    method: str
    refinement: str
    matches: int
    rates: tuple[float, ...]
    correct_at_20: float
    seconds: float


@dataclass(frozen=True)
class MatchRates:
    """All rates of one pair."""

    found: tuple[MatchRate, ...]

    def line(self) -> str:
        """Return the rates as a line of text."""
        rates = (
            f"{r.method}{r.refinement and ' ' + r.refinement} {r.rates[0]:.0%}" for r in self.found
        )
        return f"{self.found[0].name}: {', '.join(rates)}"

    def records(self) -> list[dict[str, Any]]:
        """Return the rates as values that JSON can carry."""
        return [asdict(each) for each in self.found]


@dataclass(frozen=True)
class ClearCase:
    """All methods on an unchanged pair."""

    case: RealCase

    def run(self, workers: int | None) -> MatchRates:
        """Match by every method, in one thread."""
        with aligned(self.case) as pair:
            both = patches(pair)
        return MatchRates(tuple(self._rate(both, name) for name in METHODS))

    def _rate(self, both: list[Patch], method: str) -> MatchRate:
        started = time.process_time()
        there, here = (described(patch, method) for patch in both)
        found = matched(there.strongest(), here.strongest())
        seconds = time.process_time() - started
        return rate_of(self.case, method, "", [found], seconds)


@dataclass(frozen=True)
class Features:
    """Features of an image and their descriptors, row by row."""

    points: Keypoints
    descriptors: NDArray[np.float32]

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Features:
        return Features(self.points.take(which), self.descriptors[which])

    def strongest(self) -> Features:
        order = np.argsort(-self.points.response, kind="stable")[:MOST_FEATURES]
        return self.take(np.sort(order))


@dataclass(frozen=True)
class Matched:
    """Errors of matches in pixels, and their ratios, shape (n,)."""

    errors_px: FloatArray
    ratio: FloatArray


def described(patch: Patch, method: str) -> Features:
    detector, descriptor = METHODS[method]
    return Features(*descriptor.describe(patch, detector.detect(patch)))


def matched(there: Features, here: Features) -> Matched:
    matches = match(there.descriptors, here.descriptors, mutual=True, method="exact")
    at, expected = here.points.position_px, there.points.position_px + _OFFSET_PX
    return Matched(np.hypot(*(at[matches.second] - expected[matches.first]).T), matches.ratio)


@contextmanager
def aligned(case: RealCase) -> Iterator[OffsetPair]:
    """Open a pair on the reference's grid, the input resampled by the truth except for a shift."""
    with (
        tempfile.TemporaryDirectory() as folder,
        open_offset(Scene(case, Path(folder)).pair(Path(folder)), _OFFSET_PX) as pair,
    ):
        yield pair


def patches(pair: OffsetPair) -> list[Patch]:
    """Return the grey values of both images."""
    images = pair.images
    return [
        images.reference_patch(images.grid),
        images.input_patch(images.grid, pair.to_input_px),
    ]


def rate_of(
    case: RealCase, method: str, refinement: str, parts: list[Matched], seconds: float
) -> MatchRate:
    """Return the rates of all parts together; correct@20 is averaged over them."""
    errors = np.concatenate([part.errors_px for part in parts] or [np.zeros(0)])
    best = [part.errors_px[np.argsort(part.ratio, kind="stable")[:BEST]] for part in parts]
    right = [(each <= LIMITS_PX[0]).sum() for each in best]
    return MatchRate(
        case.name,
        case.kind,
        method,
        refinement,
        len(errors),
        tuple(float(np.mean(errors <= limit)) if len(errors) else 0.0 for limit in LIMITS_PX),
        float(np.mean(right)) if right else 0.0,
        seconds,
    )
