"""SIFT with different octaves, smoothing, gradients and orientations ([Suri2010] 6.3, 6.4)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..features.descriptors import LENGTH, sift_rows
from ..features.detectors import SiftDetector, SiftOctDetector
from ..features.keypoints import Keypoints
from ..features.scale_space import gradients_at_scales
from ..rasters.patch import Patch, has_negative
from ..rasters.reading import FloatImage
from ..similarity.orientation import compress
from ..speckle.isef import isef
from .gradients import DECAY, GRADIENTS, gradient_operator, needs_positive
from .orientation import oriented

# Least contrast for the comparison of detectors. Without the octave that speckle dominates,
# keypoints are weaker, and the inliers among them, too.
_CONTRAST = {"sift": 0.04, "sift-oct": 0.075, "sift-isef-oct": 0.04}
DETECTORS = tuple(_CONTRAST)

# Nepers of amplitude per decibel.
_NEPER_PER_DB = np.log(10) / 20


def sift_detector(name: str, contrast: float | None = None) -> SiftDetector:
    """Return the detector for a name in `DETECTORS`, by default with its own least contrast.

    "sift" is the standard detector. "sift-oct" omits the first octave. "sift-isef-oct" does so on
    an image that was smoothed by the infinite symmetric exponential filter.
    """
    least = _CONTRAST[name] if contrast is None else contrast
    if name == "sift":
        return SiftDetector(least)
    return SiftOctDetector(least) if name == "sift-oct" else SiftIsefOctDetector(least)


@dataclass(frozen=True)
class SiftIsefOctDetector(SiftOctDetector):
    """SIFT-OCT on an image that was smoothed first."""

    def prepare(self, window: Patch) -> FloatImage:
        """Return the compressed grey values of a window, smoothed."""
        return isef(super().prepare(window), DECAY**2)


@dataclass(frozen=True)
class SiftVariantDescriptor:
    """SIFT descriptor with any gradient, upright or oriented.

    Parameters
    ----------
    gradient
        One of `gradients.GRADIENTS`.
    upright
        Whether keypoints keep the image's axes; otherwise each is rotated by its own orientation,
        and a keypoint with several orientations is repeated.
    """

    gradient: str = GRADIENTS[0]
    upright: bool = True

    def describe(self, window: Patch, found: Keypoints) -> tuple[Keypoints, FloatImage]:
        """Return m keypoints, m ≥ n unless upright, and their descriptors, shape (m, 128)."""
        image = compress(window)
        if needs_positive(self.gradient):
            is_decibel = has_negative(window.values[window.valid])
            image = np.exp(image * np.float32(_NEPER_PER_DB) if is_decibel else image)
        return self.describe_image(image, window.valid, found)

    def describe_image(
        self, image: FloatImage, valid: NDArray[np.bool_], found: Keypoints
    ) -> tuple[Keypoints, FloatImage]:
        """Describe keypoints of an image, without compressing its grey values."""
        owners, tables = [np.zeros(0, int)], [Keypoints.none()]
        descriptors = [np.zeros((0, LENGTH), np.float32)]
        operator = gradient_operator(self.gradient)
        for owner, points, fields in gradients_at_scales(image, valid, found, operator):
            if not self.upright:
                points, index = oriented(fields, points)
                owner = owner[index]
            owners.append(owner)
            tables.append(replace(found.take(owner), orientation_rad=points.orientation_rad))
            descriptors.append(sift_rows(fields, points))
        order = np.argsort(np.concatenate(owners), kind="stable")
        return Keypoints.concatenate(tables).take(order), np.concatenate(descriptors)[order]
