"""SIFT's keypoints ([Lowe2004]; [Suri2010] 6.3): with all octaves, or without the first.

The first octave of SIFT's scale space, on the image at twice its size, holds most keypoints of a
SAR image, and most of them are speckle. SIFT-OCT leaves this octave out. OpenCV's SIFT always
doubles its image, so it is given one of half the size, blurred as the scale space requires: its
first octave is then the image's second. No keypoints need to be dropped afterwards. The image is
reduced before the grey values are compressed, because means of amplitudes have less speckle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch, distance_to_masked, reduced_patch
from ..rasters.reading import FloatImage
from ..similarity.orientation import compress
from .keypoints import Keypoints
from .scale_space import FIRST_SCALE_PX, IMAGE_BLUR_PX, LAYERS

ByteImage = NDArray[np.uint8]

# Largest ratio of the principal curvatures of a keypoint ([Lowe2004] 4.1).
_EDGE_RATIO = 10.0

# OpenCV's enlargement of the image shifts positions by a quarter of a pixel.
_OPENCV_OFFSET_PX = 0.25

# Blur by averaging two pixels, in pixels twice as large.
_MEAN_BLUR_PX = 0.25

# Share of the pixels that is saturated at each end of the grey values.
_SATURATED = 0.01

# Approximate number of pixels from which the ends are estimated.
_QUANTILE_PIXELS = 20_000

# A keypoint needs valid pixels within this many of its scales.
_SEES_SCALES = 3.0


@dataclass(frozen=True)
class SiftDetector:
    """SIFT.

    Parameters
    ----------
    contrast
        Least contrast of a keypoint in OpenCV's definition (three times Lowe's), as a share of the
        range of grey values.
    """

    contrast: float = 0.03

    def detect(self, window: Patch) -> Keypoints:
        """Return the keypoints of an image window, upright, each position and scale once.

        Grey values are first compressed to a logarithmic scale, on which speckle has the same
        variance everywhere.
        """
        if window.is_flat:
            return Keypoints.none()
        found = self._detect(window)
        return found.take(seen_whole(found, window.valid))

    def prepare(self, window: Patch) -> FloatImage:
        """Return the compressed grey values of a window."""
        return compress(window)

    def _detect(self, window: Patch) -> Keypoints:
        return self._opencv(to_grey(self.prepare(window), window.valid))

    def _opencv(self, grey: ByteImage) -> Keypoints:
        sift = cv2.SIFT.create(0, LAYERS, self.contrast, _EDGE_RATIO, FIRST_SCALE_PX)
        rows = [(*k.pt, k.size, k.response) for k in sift.detect(grey, None)]
        # OpenCV repeats a keypoint for each of its orientations.
        table = np.unique(np.array(rows, float).reshape(-1, 4), axis=0)
        position = table[:, :2] - _OPENCV_OFFSET_PX
        return Keypoints(position, table[:, 2] / 2, np.zeros(len(table)), table[:, 3])


@dataclass(frozen=True)
class SiftOctDetector(SiftDetector):
    """SIFT without its first octave."""

    def _detect(self, window: Patch) -> Keypoints:
        half = reduced_patch(window, 2)
        blur_px = FIRST_SCALE_PX / 2
        blurred = cv2.GaussianBlur(to_grey(self.prepare(half), half.valid), (0, 0), blur_px)
        found = self._opencv(np.asarray(blurred, np.uint8))
        # Variances add up, so the true scale follows from the blur that OpenCV assumes.
        more = blur_px**2 + _MEAN_BLUR_PX**2 - IMAGE_BLUR_PX**2
        scale_px = np.sqrt(found.scale_px**2 + more)
        # The first half-sized pixel is the mean of the first two.
        position_px = 2 * found.position_px + 0.5
        return replace(found, position_px=position_px, scale_px=2 * scale_px)


def to_grey(image: FloatImage, valid: NDArray[np.bool_]) -> ByteImage:
    """Return an image as bytes, its valid grey values stretched over their range."""
    # A sample of a large image's pixels is sufficient.
    step = max(int(np.sqrt(image.size / _QUANTILE_PIXELS)), 1)
    sample = image[::step, ::step][valid[::step, ::step]]
    if sample.size == 0:
        sample = image[valid]
    low, high = np.quantile(sample, (_SATURATED, 1 - _SATURATED))
    scaled = (image - low) * (255 / max(high - low, 1e-6))
    return np.asarray(np.clip(np.rint(scaled), 0, 255), np.uint8)


def seen_whole(
    found: Keypoints, valid: NDArray[np.bool_], scales: float = _SEES_SCALES
) -> NDArray[np.bool_]:
    """Return which keypoints have no masked pixel within a number of their scales.

    The image's own border does not count as masked.
    """
    distance = distance_to_masked(valid)
    last = np.array(valid.shape)[::-1] - 1
    cols, rows = np.clip(np.rint(found.position_px).astype(int), 0, last).T
    return np.asarray(distance[rows, cols] > scales * found.scale_px)
