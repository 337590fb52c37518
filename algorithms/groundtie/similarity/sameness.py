"""Content that two arrays share: coinciding edges, and windows that vary alike.

Independent views of one ground are similar, but hardly ever the same: noise, light, physics and
the phase of the pixels differ. Content that is drawn into both arrays is the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask
from .order_statistics import median, quantiles

# Where the same content is drawn into both arrays, the variance of their difference is at most this
# share of the sum of their variances, in windows of this side. For independent content, the two
# would be equal.
_DIFFERING_SHARE = 0.5
WINDOW_PX = 9
REACH_PX = WINDOW_PX // 2

# A variance below this share of the largest mean square is rounding: sums over some hundred pixels
# lose up to some hundred units in the last place. Windows of one grey value get variance 0.
_ROUNDING = 1000 * np.finfo(np.float64).eps

# Edges are maxima of the gradient along its own direction, after a Gaussian of this scale and
# relative to the gradients around. The quantiles above which they are weak, and strong. Nodata
# is kept outside a square of side _EDGE_RIM_PX.
_EDGE_SCALE_PX, _AROUND_PX = 0.8, 31
_WEAK_AND_STRONG = np.array([0.6, 0.85])
_EDGE_RIM_PX = 9

# Edges are parallel within 20°, and opposite one another within this distance along them.
_PARALLEL_COSINE = float(np.cos(np.deg2rad(20)))
_ALONG_PX = 0.5

# Pixels (x, y) in which the nearest edge is searched for; no shift.
FARTHEST_PX = 2
_EITHER_WAY = range(-FARTHEST_PX, FARTHEST_PX + 1)
_NEIGHBOURS = np.array([(x, y) for y in _EITHER_WAY for x in _EITHER_WAY])
_NONE = np.zeros((1, 2), int)


@dataclass(frozen=True)
class Windows:
    """How two patches vary in windows around their pixels, each shape (h, w).

    Parameters
    ----------
    valid
        Pixels that are valid in both.
    one, other, common
        Variances of both, and their covariance. The grey values of `other` are scaled so that the
        median ratio of the two variances is 1.
    means
        Mean grey values of both, as they are.
    """

    valid: Mask
    one: FloatImage
    other: FloatImage
    common: FloatImage
    means: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, one: Patch, other: Patch) -> Windows:
        """Return the windows of two patches."""
        valid = one.valid & other.valid
        share = np.maximum(_mean(valid.astype(np.float64)), np.finfo(np.float32).eps)
        first, second = (np.where(valid, patch.values, 0).astype(float) for patch in (one, other))
        mean, other_mean = (_mean(values) / share for values in (first, second))
        variance = _variance(first, mean, share)
        other_variance = _variance(second, other_mean, share)
        varies = valid & (variance > 0) & (other_variance > 0)
        common = np.where(varies, _mean(first * second) / share - mean * other_mean, 0)
        gain = np.sqrt(median(variance[varies] / other_variance[varies])) if varies.any() else 1.0
        found = variance, gain**2 * other_variance, gain * common
        of_one, of_other, of_both = (np.asarray(image, np.float32) for image in found)
        return cls(valid, of_one, of_other, of_both, (mean, other_mean))

    @cached_property
    def same(self) -> Mask:
        """Pixels around which the patches vary alike."""
        both = self.one + self.other
        return self.valid & (both - 2 * self.common <= _DIFFERING_SHARE * both)

    @property
    def related(self) -> Mask:
        """Pixels around which a linear function of one patch explains half of the other's variance.

        Copies have them, also in other colours. A constant window is related to constant ones only.
        """
        alike = self.common**2 >= (1 - _DIFFERING_SHARE) * self.one * self.other
        return self.valid & alike & ((self.one > 0) == (self.other > 0))

    @property
    def greys(self) -> FloatArray:
        """Number, sum and sum of squares of both images' means, shape (2, 2, 3).

        Of pixels that are the same, and of the other valid ones.
        """
        parts = self.same, self.valid & ~self.same
        return np.array([[_moments(of[part]) for part in parts] for of in self.means])

    @property
    def counts(self) -> tuple[int, int, int]:
        """Numbers of pixels that are the same, related, and valid."""
        return int(self.same.sum()), int(self.related.sum()), int(self.valid.sum())


@dataclass(frozen=True)
class Edges:
    """Edges of an image, found to a fraction of a pixel.

    Parameters
    ----------
    found, strong
        Pixels with an edge, and with a strong one, shape (h, w).
    x, y
        Unit normals, shape (h, w) each.
    offset
        Distance of each edge from its pixel's centre along its normal, in pixels, shape (h, w).
    """

    found: Mask
    strong: Mask
    x: FloatImage
    y: FloatImage
    offset: FloatImage

    @classmethod
    def of(cls, patch: Patch) -> Edges:
        """Return the edges of a patch, by their height above the gradients around [Canny1986].

        The sign of the contrast is ignored: the same content may be drawn in other colours.
        """
        values = np.where(patch.valid, patch.values, 0).astype(np.float32)
        smooth = cv2.GaussianBlur(values, (0, 0), _EDGE_SCALE_PX)
        tiny = np.finfo(np.float32).tiny
        along = [cv2.Sobel(smooth, cv2.CV_32F, *order) for order in ((1, 0), (0, 1))]
        length = cv2.magnitude(*along)
        x, y = (np.asarray(one / np.maximum(length, tiny), np.float32) for one in along)
        height = length / np.maximum(cv2.blur(length, (_AROUND_PX, _AROUND_PX)), tiny)
        rows, cols = np.indices(height.shape, np.float32)
        before, after = (
            cv2.remap(height, cols + by * x, rows + by * y, cv2.INTER_LINEAR) for by in (-1, 1)
        )
        valid = cv2.erode(patch.valid.astype(np.uint8), np.ones((_EDGE_RIM_PX,) * 2, np.uint8)) > 0
        found = valid & (height > after) & (height >= before)
        weak, strong = quantiles(height[valid], _WEAK_AND_STRONG) if valid.any() else (0.0, 0.0)
        found &= height > weak
        bend = np.where(found, 2 * height - before - after, 1)
        offset = np.where(found, (after - before) / (2 * bend), 0)
        is_strong = found & (height > strong)
        return cls(np.asarray(found), np.asarray(is_strong), x, y, np.asarray(offset, np.float32))

    @property
    def strongest(self) -> Edges:
        """The strong edges alone."""
        return replace(self, found=self.strong)

    def inner(self, rim_px: int) -> Edges:
        """Return the edges that are at least `rim_px` from the rim of the patch."""
        kept = np.zeros_like(self.found)
        kept[rim_px:-rim_px, rim_px:-rim_px] = self.found[rim_px:-rim_px, rim_px:-rim_px]
        return replace(self, found=kept, strong=self.strong & kept)


def edges_apart_px(one: Edges, other: Edges, shifts: NDArray[np.int_] = _NONE) -> FloatImage:
    """Return the distances of edges from the nearest parallel edges of another image.

    Parameters
    ----------
    one
        The edges, n of them.
    other
        Edges of the other image, of the same shape.
    shifts
        Columns and rows (x, y) by which the other image is read further on, shape (k, 2).

    Returns
    -------
    Shape (k, n), in the order of `np.nonzero(one.found)`, in pixels along the gradients of `one`,
    negative on their darker side; infinite without a parallel edge within two pixels or so.
    """
    reach = int(np.abs(shifts).max()) + FARTHEST_PX
    width = one.found.shape[1] + 2 * reach
    is_found = np.pad(other.found, reach).ravel()
    rows, cols = np.nonzero(one.found)
    # The few of all shifts, neighbours and edges, (k, 25, n), at which the other has an edge.
    step = (shifts[:, None] + _NEIGHBOURS) @ np.array([1, width])
    at = step[..., None] + ((rows + reach) * width + cols + reach)
    hits = np.flatnonzero(is_found.take(at))
    which, beside, edge = np.unravel_index(hits, at.shape)
    near = tuple(np.array(divmod(at.take(hits), width)) - reach)
    mine, (step_x, step_y) = (rows[edge], cols[edge]), _NEIGHBOURS[beside].T
    x, y, offset = one.x[mine], one.y[mine], one.offset[mine]
    other_x, other_y, other_offset = other.x[near], other.y[near], other.offset[near]
    right = step_x + other_offset * other_x - offset * x
    down = step_y + other_offset * other_y - offset * y
    is_parallel = np.abs(x * other_x + y * other_y) >= _PARALLEL_COSINE
    pairs = np.flatnonzero(is_parallel & (np.abs(right * y - down * x) <= _ALONG_PX))
    apart = (right * x + down * y)[pairs]
    # The nearest of several is assigned last.
    order = np.argsort(-np.abs(apart), kind="stable")
    along = np.full((len(shifts), len(rows)), np.inf, np.float32)
    along[which[pairs][order], edge[pairs][order]] = apart[order]
    return along


def covered(middles: Mask, side_px: int) -> Mask:
    """Return all pixels of the windows of a side around the given pixels."""
    window = np.ones((side_px, side_px), np.uint8)
    return np.asarray(cv2.dilate(middles.astype(np.uint8), window) > 0)


def _variance(values: FloatArray, mean: FloatArray, share: FloatArray) -> FloatArray:
    """Return the variance of values in windows around pixels, 0 where it is rounding, (h, w).

    `share` is the valid share of each window; the values of invalid pixels are 0.
    """
    squares = _mean(values**2) / share
    variance = squares - mean**2
    return np.where(variance > _ROUNDING * squares.max(initial=0.0), variance, 0.0)


def _moments(values: FloatArray) -> tuple[float, float, float]:
    return float(values.size), float(values.sum()), float(np.square(values).sum())


def _mean(of: FloatArray) -> FloatArray:
    """Return the mean in windows around pixels, shape (h, w)."""
    return np.asarray(cv2.blur(of, (WINDOW_PX, WINDOW_PX)))
