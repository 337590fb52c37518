"""Repeatability and matching of the features of two registered images ([Suri2010] 6.6.2)."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..features.keypoints import Keypoints
from ..features.tiles import Describing, Detecting
from ..geometry.fitting import fit_model
from ..geometry.models import PARAMETERS
from ..matching.keypoints import lying_in
from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..rasters.reading import Mask
from .gradients import GRADIENTS
from .matching import filter_matches, match
from .repeatability import CLASS_NAMES, classes, overlap_error, repeatability
from .sift_variants import DETECTORS, SiftVariantDescriptor, sift_detector

_TURNING = "oriented"

# The model that is fitted to matches.
_MODEL = "affine"


@dataclass(frozen=True)
class Variant:
    """A combination of a detector and a descriptor, with its name."""

    name: str
    detector: Detecting
    descriptor: Describing

    @classmethod
    def parse(cls, name: str, contrast: float | None = None) -> Variant:
        """Return the variant of a name: detector, gradient and "oriented", joined by +.

        Parameters
        ----------
        name
            For example "sift-oct" or "sift-oct+roewa+oriented".
        contrast
            Least contrast of features; None: the detector's default.

        Raises
        ------
        ParameterError
            The name has no detector, an unknown word, or more than one word of a kind.
        """
        words = name.split("+")
        detectors = [word for word in words if word in DETECTORS]
        gradients = [word for word in words if word in GRADIENTS]
        oriented = words.count(_TURNING)
        known = len(detectors) + len(gradients) + oriented
        if known < len(words) or len(detectors) != 1 or len(gradients) > 1 or oriented > 1:
            raise ParameterError(
                f"{name!r} is no variant: name a detector ({', '.join(DETECTORS)}), and at most "
                f"one gradient ({', '.join(GRADIENTS)}) and {_TURNING!r}, joined by +"
            )
        estimator = gradients[0] if gradients else GRADIENTS[0]
        descriptor = SiftVariantDescriptor(estimator, upright=not oriented)
        return cls(name, sift_detector(detectors[0], contrast), descriptor)


@dataclass(frozen=True)
class Consistency:
    """Agreement of matches with an affine model.

    Parameters
    ----------
    matches
        Number of matches.
    std_px
        Standard deviation of the residuals along columns and rows; NaN for too few matches.
    by_class
        Matches in each class of overlap error (see `repeatability.CLASS_NAMES`), shape (5,).
    """

    matches: int
    std_px: tuple[float, float]
    by_class: NDArray[np.int_]

    @classmethod
    def of(cls, first: Keypoints, second: Keypoints) -> Consistency:
        """Return the consistency of features that are matched row by row."""
        px, partner_px = first.position_px, second.position_px
        std = np.full(2, np.nan)
        if len(first) > PARAMETERS[_MODEL] // 2:
            residuals = partner_px - fit_model(_MODEL, px, partner_px)(px)
            std = residuals.std(axis=0)
        by_class = classes(overlap_error(first, second))
        return cls(len(first), (float(std[0]), float(std[1])), by_class)

    def summary(self) -> dict[str, Any]:
        """Return JSON-compatible values."""
        known = np.isfinite(self.std_px).all()
        return {
            "matches": self.matches,
            "std_px": list(self.std_px) if known else None,
            "by_class": dict(zip(CLASS_NAMES, self.by_class.tolist(), strict=True)),
        }


@dataclass(frozen=True)
class Evaluation:
    """Result of a variant on two registered images.

    Parameters
    ----------
    variant
        Name of the variant.
    detections
        Number of features in the reference and in the input.
    repeated
        Share of corresponding features in each class (see `repeatability`), shape (5,).
    matched, filtered
        Matches by the descriptors alone, and those that remain after filtered matching.
    detecting_s, matching_s
        Seconds for detecting, and for describing and matching.
    """

    variant: str
    detections: tuple[int, int]
    repeated: FloatArray
    matched: Consistency
    filtered: Consistency
    detecting_s: float
    matching_s: float

    def summary(self) -> dict[str, Any]:
        """Return JSON-compatible values."""
        return {
            "variant": self.variant,
            "detections": list(self.detections),
            "repeatability": dict(zip(CLASS_NAMES, self.repeated.tolist(), strict=True)),
            "matched": self.matched.summary(),
            "filtered": self.filtered.summary(),
            "detecting_s": self.detecting_s,
            "matching_s": self.matching_s,
        }


def evaluate(
    variant: Variant,
    reference: Patch,
    input: Patch,
    ratio: float,
    method: str,
    parts: tuple[Mask, Mask] | None = None,
) -> Evaluation:
    """Detect, describe and match the features of two registered images.

    Parameters
    ----------
    variant
        Detector and descriptor.
    reference, input
        Images of the same ground, registered pixel by pixel.
    ratio, method
        See `matching.match`.
    parts
        Masks of the reference and of the input within which features count, shape (h, w); None:
        everywhere.
    """
    started = time.perf_counter()
    found = [variant.detector.detect(patch) for patch in (reference, input)]
    if parts is not None:
        found = [lying_in(own, part) for own, part in zip(found, parts, strict=True)]
    detected = time.perf_counter()
    points, descriptors = variant.descriptor.describe(reference, found[0])
    partners, partner_descriptors = variant.descriptor.describe(input, found[1])
    matches = match(descriptors, partner_descriptors, ratio, method=method)
    matched = time.perf_counter()
    first, second = points.take(matches.first), partners.take(matches.second)
    kept = filter_matches(first.position_px, second.position_px, _MODEL)
    return Evaluation(
        variant.name,
        (len(found[0]), len(found[1])),
        repeatability(*found),
        Consistency.of(first, second),
        Consistency.of(first.take(kept), second.take(kept)),
        detected - started,
        matched - detected,
    )
