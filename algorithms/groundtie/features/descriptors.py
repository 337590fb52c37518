"""SIFT's descriptor on any gradient: what is around a feature, as 128 numbers.

Gradients around a feature are sampled on a lattice that turns and grows with it, so where a sample
lies in the descriptor is the same for all features: its share in the 4 × 4 cells is one constant
matrix, and all features are described by one product. Lowe 2004; thesis S appendix.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch
from ..similarity.orientation import compress, is_logarithmic
from .gradients import Gradient, gradient, needs_positive
from .points import FeaturePoints

FloatArray = NDArray[np.float64]
FloatImage = NDArray[np.float32]

CELLS = 4
DIRECTIONS = 8
LENGTH = CELLS * CELLS * DIRECTIONS

# Side of a cell, and width of the Gaussian window in cells.
_CELL_SCALES = 3.0
_WINDOW_CELLS = CELLS / 2

# Samples along a cell's side: they lie closer than a scale, by which the image is blurred.
_SAMPLES = 4

# The longest a component may be before the descriptor is normalised again.
_LARGEST_COMPONENT = 0.2

# Scale space: layers an octave, the first scale, and how much an image is blurred as it is.
_LAYERS = 3
_FIRST_SCALE_PX = 1.6
_IMAGE_BLUR_PX = 0.5

# A gradient sees what lies within so many scales, but for the Gaussian's tail.
_SEES_SCALES = 2.5

# Orientation: bins of its histogram, width of its window in scales, how far it reaches in widths,
# and how high a further peak must be.
_BINS = 36
_ORIENTATION_SCALES = 1.5
_REACH_WIDTHS = 3.0
_FURTHER_PEAK = 0.8
_ORIENTATION_SAMPLES = 19

# Amplitude in nepers, of which decibels are so many.
_NEPER_PER_DB = np.log(10) / 20

# Gradients below this share of the largest value are rounding.
_ROUNDING = 1e-5

# So many features are sampled at a time.
_BLOCK = 1024


@dataclass(frozen=True)
class Descriptor:
    """How features are described.

    Parameters
    ----------
    estimator
        One of `gradients.GRADIENTS`.
    upright
        Whether features keep the image's axes; else each is turned by its own orientation, and
        one with several is repeated.
    """

    estimator: str = "differences"
    upright: bool = True

    def describe(self, window: Patch, found: FeaturePoints) -> tuple[FeaturePoints, FloatImage]:
        """Return the features, oriented if they are to be, and what is around them.

        Parameters
        ----------
        window
            The image; masked pixels tell nothing.
        found
            Features in it, shape (n,).

        Returns
        -------
        points, descriptors
            m features, m ≥ n unless upright, and their descriptors of unit length (zero where
            there is no gradient), shape (m, 128) float32: rows and columns of cells, then
            directions from columns towards rows.
        """
        image = compress(window)
        if needs_positive(self.estimator):
            image = np.exp(image * np.float32(_NEPER_PER_DB) if is_logarithmic(window) else image)
        return self.describe_image(image, window.valid, found)

    def describe_image(
        self, image: FloatImage, valid: NDArray[np.bool_], found: FeaturePoints
    ) -> tuple[FeaturePoints, FloatImage]:
        """Describe features of an image whose grey values are taken as they are."""
        tables: list[FeaturePoints] = []
        descriptors = [np.zeros((0, LENGTH), np.float32)]
        owners = [np.zeros(0, int)]
        layer_of = np.rint(_LAYERS * np.log2(found.scale_px / _FIRST_SCALE_PX)).astype(int)
        layers = [int(layer) for layer in np.unique(layer_of)]
        distance = _distance(valid)
        for layer, level in zip(layers, _scale_space(image, layers), strict=True):
            pixel = 2 ** _octave_of(layer)
            seen = distance[::pixel, ::pixel] > _SEES_SCALES * _scale_of(layer)
            fields = _gradient(level, seen, self.estimator)
            own = np.nonzero(layer_of == layer)[0]
            for start in range(0, len(own), _BLOCK):
                block = own[start : start + _BLOCK]
                points = found.take(block)
                local = replace(
                    points,
                    position_px=points.position_px / pixel,
                    scale_px=points.scale_px / pixel,
                )
                index = np.arange(len(block))
                if not self.upright:
                    local, index = _oriented(fields, local)
                descriptors.append(_described(fields, local))
                tables.append(points.take(index).turned(local.orientation_rad))
                owners.append(block[index])
        if not tables:
            return FeaturePoints.none(), descriptors[0]
        order = np.argsort(np.concatenate(owners), kind="stable")
        return FeaturePoints.concatenate(tables).take(order), np.concatenate(descriptors)[order]


def _distance(valid: NDArray[np.bool_]) -> FloatImage:
    """Return how far each pixel is from a masked one."""
    if valid.all():
        return np.full(valid.shape, np.inf, np.float32)
    return np.asarray(cv2.distanceTransform(valid.astype(np.uint8), cv2.DIST_L2, 5), np.float32)


def _scale_space(image: FloatImage, layers: Iterable[int]) -> Iterator[FloatImage]:
    """Return an image blurred to the scales of rising layers, each in the pixels of its octave."""
    own = _blurred(image, _IMAGE_BLUR_PX, _FIRST_SCALE_PX)
    octave = 0
    for layer in layers:
        while octave < _octave_of(layer):
            # The first pixels lie on one another.
            own = _blurred(own, _FIRST_SCALE_PX, 2 * _FIRST_SCALE_PX)[::2, ::2]
            octave += 1
        if layer <= 0:
            yield _blurred(image, _IMAGE_BLUR_PX, _scale_of(layer))
        else:
            yield _blurred(own, _FIRST_SCALE_PX, _scale_of(layer) / 2**octave)


def _octave_of(layer: int) -> int:
    """Return the octave in whose pixels a layer is; those of the enlarged image stay in 0."""
    return max((layer - 1) // _LAYERS, 0)


def _scale_of(layer: int) -> float:
    return float(_FIRST_SCALE_PX * 2 ** (layer / _LAYERS))


def _blurred(image: FloatImage, blur_px: float, wanted_px: float) -> FloatImage:
    """Return an image that is blurred by `blur_px` already as one blurred by `wanted_px`."""
    more = float(np.sqrt(max(wanted_px**2 - blur_px**2, 0.01)))
    return np.asarray(cv2.GaussianBlur(np.ascontiguousarray(image), (0, 0), more), np.float32)


def _gradient(level: FloatImage, seen: NDArray[np.bool_], estimator: str) -> Gradient:
    """Return the gradient of a level, zero where masked pixels are seen or all is rounding."""
    along_cols, along_rows = gradient(level, estimator)
    least = np.float32(_ROUNDING * np.abs(level).max())
    counts = seen & (along_cols**2 + along_rows**2 > least**2)
    zero = np.float32(0)
    return np.where(counts, along_cols, zero), np.where(counts, along_rows, zero)


def _lattice(half: float, count: int) -> FloatArray:
    """Return a lattice of count² positions (x, y) in the middle of the squares of ± half."""
    side = (np.arange(count) + 0.5) * (2 * half / count) - half
    x, y = np.meshgrid(side, side)
    return np.column_stack([x.ravel(), y.ravel()])


def _sampled(
    fields: Gradient, points: FeaturePoints, lattice: FloatArray
) -> tuple[FloatImage, FloatImage]:
    """Return strength and direction of the gradient on a lattice around each feature.

    Parameters
    ----------
    fields
        The gradient, two arrays of shape (h, w).
    points
        n features, in pixels of the fields.
    lattice
        In scales of a feature, along and across its orientation, shape (m, 2).

    Returns
    -------
    Strength and direction against the feature's orientation, shape (n, m) each.
    """
    cosine, sine = np.cos(points.orientation_rad)[:, None], np.sin(points.orientation_rad)[:, None]
    scale = points.scale_px[:, None]
    x = points.position_px[:, :1] + scale * (cosine * lattice[:, 0] - sine * lattice[:, 1])
    y = points.position_px[:, 1:] + scale * (sine * lattice[:, 0] + cosine * lattice[:, 1])
    at = np.asarray(x, np.float32), np.asarray(y, np.float32)
    gx, gy = (
        cv2.remap(f, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        for f in fields
    )
    direction = np.arctan2(gy, gx) - points.orientation_rad[:, None].astype(np.float32)
    return np.hypot(gx, gy), np.asarray(direction, np.float32)


@cache
def _cell_weights() -> tuple[FloatArray, FloatImage]:
    """Return the descriptor's lattice in scales, and each sample's share in the cells, (16, m)."""
    # Cells share their samples with their neighbours, so samples reach half a cell further.
    half = (CELLS + 1) / 2
    lattice = _lattice(half, _SAMPLES * (CELLS + 1))
    centres = np.arange(CELLS) - (CELLS - 1) / 2
    x, y = (np.maximum(1 - np.abs(lattice[:, axis] - centres[:, None]), 0) for axis in (0, 1))
    window = np.exp(-(lattice**2).sum(axis=1) / (2 * _WINDOW_CELLS**2))
    weights = (y[:, None] * x[None] * window).reshape(CELLS * CELLS, -1)
    return lattice * _CELL_SCALES, weights.astype(np.float32)


def _described(fields: Gradient, points: FeaturePoints) -> FloatImage:
    """Return the descriptors of features, shape (n, 128)."""
    lattice, weights = _cell_weights()
    strength, direction = _sampled(fields, points, lattice)
    place = direction * np.float32(DIRECTIONS / (2 * np.pi))
    below = np.floor(place)
    share = place - below
    first = below.astype(np.int32) % DIRECTIONS
    spread = np.zeros((*strength.shape, DIRECTIONS), np.float32)
    for bins, part in ((first, 1 - share), ((first + 1) % DIRECTIONS, share)):
        np.put_along_axis(spread, bins[..., None], (strength * part)[..., None], axis=2)
    raw = np.matmul(weights, spread).reshape(len(points), LENGTH)
    return _unit(np.minimum(_unit(raw), np.float32(_LARGEST_COMPONENT)))


def _unit(rows: FloatImage) -> FloatImage:
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows / np.maximum(length, 1e-12), np.float32)


def _oriented(fields: Gradient, points: FeaturePoints) -> tuple[FeaturePoints, NDArray[np.int_]]:
    """Return features once for each of their orientations, and which of `points` each one is."""
    half = _REACH_WIDTHS * _ORIENTATION_SCALES
    lattice = _lattice(half, _ORIENTATION_SAMPLES)
    lattice = lattice[np.hypot(*lattice.T) <= half]
    upright = points.turned(np.zeros(len(points)))
    strength, direction = _sampled(fields, upright, lattice)
    window = np.exp(-(lattice**2).sum(axis=1) / (2 * _ORIENTATION_SCALES**2))
    bins = np.rint(direction * (_BINS / (2 * np.pi))).astype(int) % _BINS
    owner = np.arange(len(points))[:, None]
    histogram = np.bincount(
        (owner * _BINS + bins).ravel(), (strength * window).ravel(), len(points) * _BINS
    ).reshape(-1, _BINS)
    smooth = sum(
        weight * np.roll(histogram, by, axis=1)
        for by, weight in zip(range(-2, 3), np.array([1, 4, 6, 4, 1]) / 16, strict=True)
    )
    before, after = np.roll(smooth, 1, axis=1), np.roll(smooth, -1, axis=1)
    highest = smooth.max(axis=1, keepdims=True)
    peaks = (smooth > before) & (smooth >= after) & (smooth >= _FURTHER_PEAK * highest)
    index, at = np.nonzero(peaks)
    low, top, high = before[index, at], smooth[index, at], after[index, at]
    place = at + 0.5 * (low - high) / (low - 2 * top + high)
    return points.take(index).turned(place * (2 * np.pi / _BINS)), index
