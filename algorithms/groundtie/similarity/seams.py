"""Steps between neighbouring columns, or rows, that both arrays have: seam lines of mosaics, tiles.

Drawn content steps from one pixel to the next, along many pixels. Edges of the ground are blurred,
and seldom follow the same column in two images.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask
from .order_statistics import DEVIATION_PER_MAD, median
from .orientation import compress

# Steps are means along about this many pixels, the height of the compared windows; this share of
# the pixels must be valid. They are in robust standard deviations, clipped so that no single step
# decides.
_ALONG_PX, _LEAST_KNOWN, _MOST_DEVIATIONS = 96, 1 / 3, 8.0

# Largest lag, in columns, at which the steps of both arrays are compared. Steps coincide by chance
# at lags beyond _NEAR.
_LAGS, _NEAR = 16, 3
_LAG = np.arange(-_LAGS, _LAGS + 1)

# An upper limit at this many standard deviations is exceeded by chance with 5 %.
ONE_SIDED_5_PERCENT = 1.645

# Steps of drawn content are no wider. Suite sharpness: from 0.51 on for ground of different sensors
# at its right place; from 0.04 on, mostly below this limit, for seams, stripes and map lines.
DRAWN_WIDTH = 0.3

# Steps of at least this many standard deviations in both arrays are masked; one in 370 is as high
# by chance.
_MASKED_DEVIATIONS = 3.0


def step_products(reference: Patch, input: Patch) -> NDArray[np.float64]:
    """Return sums of products of steps of two patches, of columns and of rows, by lag, (2, k)."""
    sums = []
    for one, other in zip(_both_ways(reference), _both_ways(input), strict=True):
        inner = one[:, _LAGS:-_LAGS]
        moved = sliding_window_view(other, inner.shape[1], axis=1)
        sums.append(np.einsum("bn,bkn->k", inner, moved, dtype=np.float64))
    return np.array(sums)


def step_width(products: NDArray[np.floating]) -> float:
    """Return the width of the steps that two arrays have in common; infinite if they have none.

    The width is the sum of products one column or row beside the best lag over that at the best
    lag, both beyond chance. It is an upper limit, exceeded by chance with 5 %.

    Parameters
    ----------
    products
        Sums of `step_products`.
    """
    best = products[:, _LAGS - 1 : _LAGS + 2].argmax(axis=1) - 1
    aligned = np.sum([np.roll(of, -lag) for of, lag in zip(products, best, strict=True)], axis=0)
    far = aligned[np.abs(_LAG) > _NEAR]
    here, *beside = (float(aligned[_LAGS + k] - far.mean()) for k in (0, -1, 1))
    return (
        (max(*beside, 0.0) + ONE_SIDED_5_PERCENT * float(far.std())) / here if here > 0 else np.inf
    )


def seams(reference: Patch, input: Patch) -> Mask:
    """Return the pixels on both sides of the steps that both patches have, shape (h, w)."""
    found = np.zeros(reference.values.shape, bool)
    for mask, one, other in zip(
        (found, found.T), _both_ways(reference), _both_ways(input), strict=True
    ):
        apart = np.pad(other, ((0, 0), (1, 1)))
        near = [apart[:, k : k + one.shape[1]] for k in range(3)]
        both = np.minimum(np.abs(one), np.abs(near).max(axis=0)) >= _MASKED_DEVIATIONS
        for rows, steps in zip(_blocks(len(mask)), both, strict=True):
            mask[rows, :-1] |= steps
            mask[rows, 1:] |= steps
    return found


def _both_ways(patch: Patch) -> tuple[FloatImage, FloatImage]:
    """Return the steps between columns of a patch and between rows, each shape (blocks, n - 1)."""
    values = compress(patch)
    return _steps(values, patch.valid), _steps(values.T, patch.valid.T)


def _steps(values: FloatImage, valid: Mask) -> FloatImage:
    """Return steps between columns, in standard deviations, along blocks of rows."""
    both = valid[:, 1:] & valid[:, :-1]
    rises = np.where(both, values[:, 1:] - values[:, :-1], 0)
    found = []
    for rows in _blocks(len(values)):
        known, rise = both[rows], rises[rows]
        count = np.maximum(known.sum(axis=0), 1)
        mean = rise.sum(axis=0) / count
        variance = np.einsum("ij,ij->j", rise, rise) / count - mean**2
        deviation = np.sqrt(np.maximum(variance, np.finfo(np.float32).eps) / count)
        steps = np.where(count >= _LEAST_KNOWN * len(known), mean / deviation, 0)
        # Ground is correlated along a step, so that its steps are many standard deviations high.
        spread = max(DEVIATION_PER_MAD * float(median(np.abs(steps))), 1.0)
        found.append(np.clip(steps / spread, -_MOST_DEVIATIONS, _MOST_DEVIATIONS))
    return np.array(found, np.float32)


def _blocks(length: int) -> list[slice]:
    """Return the rows of blocks, side by side, of about `_ALONG_PX`."""
    ends = np.linspace(0, length, max(round(length / _ALONG_PX), 1) + 1).astype(int)
    return [slice(int(first), int(end)) for first, end in pairwise(ends)]
