"""SIFT features of SAR images ([Suri2010] 6.3): with all octaves, or without the first.

The first octave of SIFT's scale space, on the image at twice its size, holds most features of a SAR
image, and most of them are speckle. SIFT-OCT leaves this octave out. OpenCV's SIFT always begins on
an image twice as large as the one that it is given, so it gets one of half the size, blurred as the
scale space demands: its first octave is then the image's second. Nothing is found to be dropped,
and the image is reduced before anything else: means of amplitudes have less speckle to compress.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch, reduced_patch
from ..similarity.orientation import compress
from ..speckle.isef import isef
from .points import FeaturePoints

FloatImage = NDArray[np.float32]
ByteImage = NDArray[np.uint8]

# Contrast below which a feature is dropped, in OpenCV's terms: three times Lowe's, of the range of
# grey values. Without speckle's octave features are weaker, and right ones among them.
_CONTRAST = {"sift": 0.04, "sift-oct": 0.075, "sift-isef-oct": 0.04}
DETECTORS = tuple(_CONTRAST)

_LAYERS = 3
_EDGE_RATIO = 10.0
_FIRST_SIGMA_PX = 1.6

# OpenCV enlarges its image so that positions come out a quarter of a pixel too far.
_OPENCV_OFFSET_PX = 0.25

# OpenCV takes its image to be blurred by this, in its pixels.
_OPENCV_BLUR_PX = 0.5

# The mean of two pixels blurs by this, in pixels twice as large.
_MEAN_BLUR_PX = 0.25

# Decay of the ISEF per pixel, [Suri2010] eq 6.2.
_ISEF_DECAY = 0.5

# Share of the pixels that is saturated at either end of the grey values.
_SATURATED = 0.01

# About how many pixels this is told by.
_QUANTILE_PIXELS = 20_000

# A feature needs valid pixels up to so many of its scales.
_SEES_SCALES = 3.0


@dataclass(frozen=True)
class Detector:
    """How features are found.

    Parameters
    ----------
    name
        One of `DETECTORS`: "sift"; "sift-oct", without the first octave; "sift-isef-oct", the same
        on an image that was smoothed by the infinite symmetric exponential filter.
    contrast
        Least contrast of a feature as OpenCV counts it (three times Lowe's), as a share of the
        range of grey values; None: as fits the detector.
    """

    name: str = "sift-oct"
    contrast: float | None = None

    def detect(self, window: Patch) -> FeaturePoints:
        """Return the features of an image window, upright, each position and scale once.

        Grey values are compressed to a logarithmic scale first, on which speckle is alike
        everywhere.
        """
        if window.is_flat:
            return FeaturePoints.none()
        found = (
            self._detect_all(window) if self.name == "sift" else self._detect_from_second(window)
        )
        return found.take(seen_whole(found, window.valid))

    def _detect_all(self, window: Patch) -> FeaturePoints:
        return self._opencv(to_grey(compress(window), window.valid))

    def _detect_from_second(self, window: Patch) -> FeaturePoints:
        half = reduced_patch(window, 2)
        image = compress(half)
        if self.name == "sift-isef-oct":
            image = isef(image, _ISEF_DECAY**2)
        blur_px = _FIRST_SIGMA_PX / 2
        blurred = cv2.GaussianBlur(to_grey(image, half.valid), (0, 0), blur_px)
        found = self._opencv(np.asarray(blurred, np.uint8))
        # Variances add up, so the true scale follows from what OpenCV believes.
        more = blur_px**2 + _MEAN_BLUR_PX**2 - _OPENCV_BLUR_PX**2
        scale_px = np.sqrt(found.scale_px**2 + more)
        # The first half-sized pixel is the mean of the first two.
        position_px = 2 * found.position_px + 0.5
        none = np.zeros(len(found))
        return FeaturePoints(position_px, 2 * scale_px, none, found.response, found.octave + 1)

    def _opencv(self, grey: ByteImage) -> FeaturePoints:
        contrast = _CONTRAST[self.name] if self.contrast is None else self.contrast
        sift = cv2.SIFT.create(0, _LAYERS, contrast, _EDGE_RATIO, _FIRST_SIGMA_PX)
        rows = [(*k.pt, k.size, k.response, k.octave) for k in sift.detect(grey, None)]
        # OpenCV repeats a feature for each of its orientations.
        table = np.unique(np.array(rows, float).reshape(-1, 5), axis=0)
        # The octave is the lowest byte, a signed number.
        octave = (table[:, 4].astype(int) & 0xFF).astype(np.uint8).astype(np.int8).astype(int)
        position = table[:, :2] - _OPENCV_OFFSET_PX
        return FeaturePoints(position, table[:, 2] / 2, np.zeros(len(table)), table[:, 3], octave)


def to_grey(image: FloatImage, valid: NDArray[np.bool_]) -> ByteImage:
    """Return an image as bytes, its valid grey values stretched over their range."""
    # Some of a large image's pixels tell as much as all.
    step = max(int(np.sqrt(image.size / _QUANTILE_PIXELS)), 1)
    sample = image[::step, ::step][valid[::step, ::step]]
    if sample.size == 0:
        sample = image[valid]
    low, high = np.quantile(sample, (_SATURATED, 1 - _SATURATED))
    scaled = (image - low) * (255 / max(high - low, 1e-6))
    return np.asarray(np.clip(np.rint(scaled), 0, 255), np.uint8)


def seen_whole(
    found: FeaturePoints, valid: NDArray[np.bool_], scales: float = _SEES_SCALES
) -> NDArray[np.bool_]:
    """Tell which features have nothing masked within so many of their scales.

    The image's own border does not count.
    """
    if valid.all():
        return np.ones(len(found), bool)
    distance = cv2.distanceTransform(valid.astype(np.uint8), cv2.DIST_L2, 5)
    last = np.array(valid.shape)[::-1] - 1
    cols, rows = np.clip(np.rint(found.position_px).astype(int), 0, last).T
    return np.asarray(distance[rows, cols] > scales * found.scale_px)
