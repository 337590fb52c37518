"""Steps between neighbouring columns, or rows, that both arrays have: seams of mosaics and tiles.

What is drawn steps from one pixel to the next, along many of them. Edges of the ground are blurred,
and those of two images seldom follow one column.
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

# Steps are means along about so many pixels, as high as the windows that are looked at, of which
# this share must be known, in robust standard deviations; no more of them count, so that no single
# one decides.
_ALONG_PX, _LEAST_KNOWN, _MOST_DEVIATIONS = 96, 1 / 3, 8.0

# How many columns further on one array's steps are compared with the other's. What is this far off
# coincides by chance.
_LAGS, _NEAR = 16, 3
_LAG = np.arange(-_LAGS, _LAGS + 1)

# What is so many standard deviations more is exceeded by chance with 5 %.
ONE_SIDED_5_PERCENT = 1.645

# Steps of what is drawn are no wider. Suite sharpness: of different sensors' ground at its place
# from 0.51 on; of seams, stripes and lines of maps from 0.04 on, mostly below this.
DRAWN_WIDTH = 0.3

# Steps from so many standard deviations on, in both, are masked: one in 370 is as high by chance.
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
    """Return how wide the steps are that two arrays have in common; infinite: they have none.

    That is how well they coincide one column or row beside where they do best, as a share of that,
    beyond chance; at most, but by chance with 5 %.

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
    """Return the pixels of rows and columns beside which both patches step, shape (h, w)."""
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
        # Ground varies along rows alike, so that its steps are many deviations high.
        spread = max(DEVIATION_PER_MAD * float(median(np.abs(steps))), 1.0)
        found.append(np.clip(steps / spread, -_MOST_DEVIATIONS, _MOST_DEVIATIONS))
    return np.array(found, np.float32)


def _blocks(length: int) -> list[slice]:
    """Return the rows of blocks, side by side, of about `_ALONG_PX`."""
    ends = np.linspace(0, length, max(round(length / _ALONG_PX), 1) + 1).astype(int)
    return [slice(int(first), int(end)) for first, end in pairwise(ends)]
