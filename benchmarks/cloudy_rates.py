"""Correct-match rates under simulated clouds, by feature mask ([Patel2017] 5.5)."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundtie.errors import TooFewPointsError
from groundtie.features.classifier import KERNELS, FeatureClassifier
from groundtie.features.classifier_training import Training, train_classifier
from groundtie.features.labels import KEPT, LEFT_OUT, patch_labels
from groundtie.features.patch_statistics import BAND_RATIOS, NO_BANDS, patch_statistics
from groundtie.rasters.patch import Patch

from .cases import RealCase
from .clouds import clouds_over
from .match_rates import (
    Features,
    Matched,
    MatchRates,
    aligned,
    described,
    matched,
    patches,
    rate_of,
)

# Cloud cover of both images, the number of draws of clouds, and the method that is refined.
CLOUD_SHARE = 0.3
CLOUD_DRAWS = 3
REFINED = "HOG-81"

# Refinements that leave features out: support vector machines with these statistics and kernels,
# trained on the image's other half; one trained on other pairs; and the mask of the clouds.
KERNEL, STATISTICS = "polynomial", "mean-variance"
BANDS, TEXTURE = "polynomial, band ratios", "polynomial, texture"
OTHERS, MASK = "polynomial, other pairs", "the mask itself"
MACHINES = {kernel: (STATISTICS, kernel) for kernel in KERNELS} | {
    BANDS: (BAND_RATIOS, KERNEL),
    TEXTURE: ("texture", KERNEL),
}
REFINEMENTS = (*MACHINES, OTHERS, MASK)

# Number of points of each image and class that are used to train for other pairs.
_POINTS = 100


@dataclass(frozen=True)
class Clear:
    """An image without clouds: its grey values, and all bands, shape (bands, h, w)."""

    grey: Patch
    bands: NDArray[np.float32]


@dataclass(frozen=True)
class Clouded:
    """An image under clouds: its features, and which of them the clouds leave."""

    image: Patch
    bands: NDArray[np.float32]
    features: Features
    kept: NDArray[np.bool_]

    @property
    def px(self) -> NDArray[np.float64]:
        return self.features.points.position_px

    def training(self, statistics: str) -> Training:
        bands = self.bands if statistics == BAND_RATIOS else NO_BANDS
        found = patch_statistics(statistics, self.image, self.px, bands)
        return Training(found, self.kept, self.px, len(bands))


@dataclass(frozen=True)
class CloudLabels:
    """Labelled points of a pair under its first clouds, for training on behalf of other pairs."""

    name: str
    labelled: Training

    def line(self) -> str:
        """Return the number of points as a line of text."""
        return f"{self.name}: {len(self.labelled.kept)} labelled points"


@dataclass(frozen=True)
class LabelCase:
    """Gives the `CloudLabels` of a pair."""

    case: RealCase

    def run(self, workers: int | None) -> CloudLabels:
        """Label features of both images."""
        both = _clouded(_clear(self.case), self.case, 0)
        return CloudLabels(self.case.name, _joined([_some(each) for each in both]))


@dataclass(frozen=True)
class CloudyCase:
    """Refinement on a pair under simulated clouds, which differ between the images.

    Classifiers are trained on the features of one half, or on `others`, points of other pairs.
    Matches are counted in the other half.
    """

    case: RealCase
    others: Training | None = None

    def run(self, workers: int | None) -> MatchRates:
        """Match without refinement and with each refinement."""
        found: dict[str, list[Matched]] = {name: [] for name in ("", *REFINEMENTS)}
        foreign = None
        if self.others is not None:
            foreign = train_classifier(self.others, STATISTICS, KERNEL, 1.0, 0)
        clear = _clear(self.case)
        for draw in range(CLOUD_DRAWS):
            both = _clouded(clear, self.case, draw)
            for name, parts in _matches(both, clear[0].grey.values.shape[1] / 2, foreign):
                found[name].append(parts)
        return MatchRates(
            tuple(
                rate_of(self.case, REFINED, name, parts, 0.0)
                for name, parts in found.items()
                if parts or not name
            )
        )


def for_others(labels: Sequence[CloudLabels], name: str) -> Training:
    """Return the training points of all pairs but one."""
    return _joined([each.labelled for each in labels if each.name != name])


def _clear(case: RealCase) -> list[Clear]:
    """Return both images."""
    with aligned(case) as pair:
        images = pair.images
        bands = (
            images.reference.bands_onto(images.grid, images.reference.source.grid.map_to_pixel),
            images.input.bands_onto(images.grid, pair.to_input_px),
        )
        return [Clear(*both) for both in zip(patches(pair), bands, strict=True)]


def _clouded(clear: Sequence[Clear], case: RealCase, draw: int) -> list[Clouded]:
    """Return both images under clouds."""
    seed = zlib.crc32(case.name.encode()) + 2 * draw
    both = []
    for number, each in enumerate(clear):
        clouds = clouds_over(each.grey.values, CLOUD_SHARE, seed + number)
        image = Patch(clouds.over(each.grey.values), each.grey.valid)
        features = described(image, REFINED)
        labels = np.where(clouds.hidden, LEFT_OUT, KEPT).astype(np.int8)
        kept = patch_labels(labels, features.points.position_px) == KEPT
        both.append(Clouded(image, clouds.over(each.bands), features, kept))
    return both


def _matches(
    both: list[Clouded], middle: float, foreign: FeatureClassifier | None
) -> Iterator[tuple[str, Matched]]:
    """Return the matches in each half without refinement and with each refinement."""
    labelled = {
        statistics: [each.training(statistics) for each in both]
        for statistics in {statistics for statistics, _ in MACHINES.values()}
    }
    for side in (False, True):
        tested = [(each.px[:, 0] < middle) == side for each in both]
        try:
            told = {
                name: [
                    train_classifier(each.take(~own), statistics, kernel, 1.0, 0).decide(
                        each.statistics
                    )
                    > 0
                    for each, own in zip(labelled[statistics], tested, strict=True)
                ]
                for name, (statistics, kernel) in MACHINES.items()
            }
        except TooFewPointsError:
            continue
        told[""] = [np.ones(len(own), bool) for own in tested]
        told[MASK] = [each.kept for each in both]
        if foreign is not None:
            told[OTHERS] = [foreign.decide(each.statistics) > 0 for each in labelled[STATISTICS]]
        for name, kept in told.items():
            those = [
                each.features.take(own & may).strongest()
                for each, own, may in zip(both, tested, kept, strict=True)
            ]
            yield name, matched(*those)


def _some(each: Clouded) -> Training:
    random = np.random.default_rng(0)
    classes = [random.permutation(np.nonzero(each.kept == kept)[0]) for kept in (True, False)]
    return each.training(STATISTICS).take(np.concatenate([own[:_POINTS] for own in classes]))


def _joined(parts: Sequence[Training]) -> Training:
    columns: list[Any] = [
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("statistics", "kept", "px")
    ]
    return Training(*columns)
