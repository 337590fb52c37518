"""The SURF descriptor: 64 sums of Haar wavelet responses around a keypoint ([Bay2008]).

Responses come from the integral image, at samples that rotate and scale with the keypoint, for all
keypoints at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..features.keypoints import Keypoints
from ..features.sampling import samples_around, square_samples, unit_rows
from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..similarity.orientation import compress
from .box_hessian import FloatImage, IntegralImage, integral_image

CELLS = 4
LENGTH = 4 * CELLS * CELLS

# Samples along a cell's side, one scale apart, and width of the Gaussian window in scales.
_SAMPLES = 5
_WINDOW_SCALES = 3.3

# Half the side of the wavelets in scales, for the descriptor and for the orientation.
_HALF_SCALES, _ORIENTATION_HALF_SCALES = 1.0, 2.0

# Orientation: reach and width of its window in scales; number of bins, and bins in a 60° sector.
_REACH_SCALES, _ORIENTATION_WINDOW_SCALES = 6, 2.0
_BINS = 72
_SECTOR_BINS = _BINS // 6

# Number of features that are described at a time.
_BLOCK = 512


@dataclass(frozen=True)
class _Sums:
    """Integral images of grey values and of the mask (None: nothing is masked)."""

    grey: IntegralImage
    masked: IntegralImage | None


@dataclass(frozen=True)
class HaarDescriptor:
    """How features are described.

    Parameters
    ----------
    upright
        Whether features keep the image's axes; otherwise each has its own orientation.
    """

    upright: bool = True

    def describe(
        self, window: Patch, found: Keypoints, context: Context | None = None
    ) -> tuple[Keypoints, FloatImage]:
        """Return the features, oriented unless `upright`, and their descriptors.

        Parameters
        ----------
        window
            The image; wavelets that cover masked pixels count as zero.
        found
            Features in the image, shape (n,).
        context
            Provides threads; None: the current one only.

        Returns
        -------
        points, descriptors
            The n features and their descriptors of unit length (zero where there is no contrast),
            shape (n, 64) float32. The order is rows and columns of cells, then the sums of the
            wavelets along columns and rows, and the sums of their absolute values.
        """
        masked = None if window.all_valid else _counts(~window.valid)
        sums = _Sums(integral_image(compress(window)), masked)
        blocks = [found.take(slice(at, at + _BLOCK)) for at in range(0, len(found), _BLOCK)]

        def one(points: Keypoints) -> tuple[Keypoints, FloatImage]:
            if not self.upright:
                points = replace(points, orientation_rad=_orientations(sums, points))
            return points, _described(sums, points)

        done = list(map(one, blocks) if context is None else context.map(one, blocks))
        return (
            Keypoints.concatenate([Keypoints.none(), *(points for points, _ in done)]),
            np.concatenate([np.zeros((0, LENGTH), np.float32), *(values for _, values in done)]),
        )


def _counts(mask: NDArray[np.bool_]) -> IntegralImage:
    return np.asarray(cv2.integral(mask.astype(np.uint8), sdepth=cv2.CV_64F), np.float64)


def _wavelets(
    sums: _Sums, points: Keypoints, samples: FloatArray, half_scales: float
) -> tuple[FloatImage, FloatImage]:
    """Return Haar wavelet responses at samples around each feature.

    Parameters
    ----------
    sums
        The image's integrals.
    points
        n features.
    samples
        Offsets in scales of a feature, along and across its orientation, shape (m, 2).
    half_scales
        Half the wavelets' side, in scales.

    Returns
    -------
    Responses along and across the features' orientation, shape (n, m) each.
    """
    cosine, sine = np.cos(points.orientation_rad)[:, None], np.sin(points.orientation_rad)[:, None]
    x, y = samples_around(points, samples)
    half = np.maximum(np.rint(half_scales * points.scale_px[:, None]), 1).astype(np.intp)
    height, width = sums.grey.shape
    # Positions in the integral image are pixel corners.
    col, row = np.rint(x + 0.5).astype(np.intp), np.rint(y + 0.5).astype(np.intp)
    cols = [np.clip(col + by, 0, width - 1) for by in (-half, 0, half)]
    rows = [np.clip(row + by, 0, height - 1) * width for by in (-half, 0, half)]
    flat = sums.grey.ravel()
    (a, b, c), (d, _, f), (g, h, i) = ([flat[r + k] for k in cols] for r in rows)
    along_cols = (i - c - g + a) - 2 * ((h - b) - (g - a))
    along_rows = (i - g - c + a) - 2 * ((f - d) - (c - a))
    if sums.masked is not None:
        hidden = sums.masked.ravel()
        top, bottom = ([hidden[rows[k] + cols[0]], hidden[rows[k] + cols[2]]] for k in (0, 2))
        seen = bottom[1] - bottom[0] - top[1] + top[0] == 0
        along_cols, along_rows = along_cols * seen, along_rows * seen
    # Mean differences make the responses of wavelets of all sizes comparable.
    area = half**2
    along = (cosine * along_cols + sine * along_rows) / area
    across = (cosine * along_rows - sine * along_cols) / area
    return along.astype(np.float32), across.astype(np.float32)


def _described(sums: _Sums, points: Keypoints) -> FloatImage:
    """Return the descriptors of features, shape (n, 64)."""
    samples = square_samples(CELLS * _SAMPLES / 2, CELLS * _SAMPLES)
    window = np.exp(-(samples**2).sum(axis=1) / (2 * _WINDOW_SCALES**2)).astype(np.float32)
    both = [window * part for part in _wavelets(sums, points, samples, _HALF_SCALES)]
    parts = np.stack([*both, *map(np.abs, both)], axis=-1)
    cells = parts.reshape(len(points), CELLS, _SAMPLES, CELLS, _SAMPLES, 4).sum(axis=(2, 4))
    return unit_rows(cells.reshape(len(points), LENGTH))


def _orientations(sums: _Sums, points: Keypoints) -> FloatArray:
    """Return the direction of the largest vector sum over any 60° sector, shape (n,)."""
    samples = square_samples(_REACH_SCALES + 0.5, 2 * _REACH_SCALES + 1)
    squared = (samples**2).sum(axis=1)
    samples, squared = samples[squared < _REACH_SCALES**2], squared[squared < _REACH_SCALES**2]
    window = np.exp(-squared / (2 * _ORIENTATION_WINDOW_SCALES**2)).astype(np.float32)
    upright = replace(points, orientation_rad=np.zeros(len(points)))
    along_cols, along_rows = _wavelets(sums, upright, samples, _ORIENTATION_HALF_SCALES)
    direction = np.arctan2(along_rows, along_cols)
    bins = np.floor(direction * (_BINS / (2 * np.pi))).astype(np.intp) % _BINS
    owner = np.arange(len(points))[:, None] * _BINS
    sector_sums = []
    for part in (along_cols, along_rows):
        weights = (part * window).ravel()
        histogram = np.bincount((owner + bins).ravel(), weights, len(points) * _BINS)
        around = np.tile(histogram.reshape(-1, _BINS), 2).cumsum(axis=1)
        sector_sums.append(around[:, _SECTOR_BINS : _BINS + _SECTOR_BINS] - around[:, :_BINS])
    best = np.hypot(*sector_sums).argmax(axis=1)[:, None]
    x_sum, y_sum = (np.take_along_axis(part, best, axis=1)[:, 0] for part in sector_sums)
    return np.asarray(np.arctan2(y_sum, x_sum))
