"""The joint histogram of a template and an image under any affine transform ([Suri2010] 3.4.2).

Counting takes one step: each template pixel is spread over the bins of the surrounding image
pixels with the weights of a B-spline. This is generalised partial volume estimation (GPVE;
[Chen2003], [Suri2010] eq 3.34). Order 2 is partial volume interpolation (PVI [Maes1997]), which has
false maxima; orders of 4 and above have none. The two-step alternative, which interpolates the
image and counts one entry, has false maxima too: interpolation smooths the image between its pixels
but not on them.

For pure shifts, `joint_histogram` counts many transforms at once.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse
from affine import Affine
from numpy.typing import NDArray

from ..context import Context
from ..errors import ParameterError
from ..rasters.grid import FloatArray
from ..rasters.kernels import bspline_weights
from ..rasters.patch import Patch
from ..similarity.binning import MASKED, bin_edges
from ..similarity.joint_histogram import (
    ORDER,
    count_joint_histograms,
    gpve_histograms,
    reach,
)
from ..similarity.measures import HistogramMeasure

Bins = NDArray[np.uint8] | NDArray[np.uint16]

# Value of masked pixels in 16-bit grey levels; `binning.MASKED` is its 8-bit counterpart.
MASKED_LEVEL = np.uint16(65_535)

# Largest number of template pixels whose weights are all summed; more would slow down a search.
_EXACT_PIXELS = 20_000

# If the histograms of all shifts need more memory than this, they are counted one by one.
_MOST_VOLUME_BYTES = 150_000_000


def to_levels(
    image: Patch, bins: int | None = None, binning: str = "equal-frequency"
) -> tuple[NDArray[np.uint16], int]:
    """Return each pixel's grey level, `MASKED_LEVEL` where invalid, and the number of levels.

    Parameters
    ----------
    image
        Grey values.
    bins
        Number of levels, up to 65 535. None: every grey value that occurs is a level of its own,
        as in [Suri2010] for 11-bit and 16-bit images "without binning".
    binning
        One of `binning.BINNINGS`.

    Raises
    ------
    ParameterError
        The image has more grey values than 16 bits can number.
    """
    if bins is None:
        edges = np.unique(image.values[image.valid])[1:]
        if edges.size >= MASKED_LEVEL:
            raise ParameterError(
                f"the image has more than {MASKED_LEVEL} grey values: give a number of bins"
            )
    else:
        edges = bin_edges(image.values[image.valid], bins, binning)
    levels = np.searchsorted(edges, image.values.ravel(), side="right").astype(np.uint16)
    levels = levels.reshape(image.values.shape)
    levels[~image.valid] = MASKED_LEVEL
    return levels, edges.size + 1


def joint_histogram_under(
    template: Bins,
    image: Bins,
    to_image: Affine,
    counts: tuple[int, int],
    order: int = ORDER,
    seed: int = 0,
) -> FloatArray:
    """Return the joint histogram of a template and an image under an affine transform, by GPVE.

    Up to 20 000 template pixels are counted with exact GPVE weights. Above that, each pixel is
    moved by a random offset, drawn from the B-spline of the next lower order, and counted with
    the nearest image pixel. The expectation is GPVE; the only noise is counting noise. The cost
    is the same for every order (500 × 500 px: 4 ms; exact weights of order 4 take 55 ms, and
    exact weights for a twelfth of the pixels would be noisier). The same seed gives the same
    offsets for every transform, so that a search optimises one fixed function.

    Parameters
    ----------
    template, image
        Bins, shapes (h, w) and (H, W), with `binning.MASKED` for excluded pixels; or grey levels
        with `MASKED_LEVEL`.
    to_image
        From template to image pixels (col, row), pixel centres at integers.
    counts
        Number of bins of template and image.
    order
        Order of the B-spline, 2 (partial volume interpolation) to 7; 1 is nearest neighbour.
    seed
        Seed of the random offsets.

    Returns
    -------
    Histogram, shape `counts`. Weights outside the image or on masked pixels are dropped.
    """
    own, x, y = _places(template, to_image)
    if order > 1 and own.size > _EXACT_PIXELS:
        dx, dy = _offsets(order - 1, seed, own.size)
        x, y, order = x + dx, y + dy, 1
    sizes = counts[0] + 1, counts[1] + 1
    total = np.zeros(sizes[0] * sizes[1])
    for pairs, weights in _contributions(own, image, x, y, counts, order):
        total += np.bincount(pairs, weights, minlength=total.size)
    return total.reshape(sizes)[: counts[0], : counts[1]]


def sparse_joint_histogram_under(
    template: Bins, image: Bins, to_image: Affine, counts: tuple[int, int], order: int = ORDER
) -> Any:
    """Return the joint histogram under an affine transform as a sparse matrix, by exact weights.

    Meant for images with thousands of grey levels: only occupied cells take memory. The measures
    accept sparse histograms. The parameters are those of `joint_histogram_under`.

    Returns
    -------
    scipy.sparse.csr_matrix, shape `counts`.
    """
    own, x, y = _places(template, to_image)
    total = scipy.sparse.csr_matrix(counts)
    for pairs, weights in _contributions(own, image, x, y, counts, order):
        rows, cols = np.divmod(pairs, counts[1] + 1)
        counted = (rows < counts[0]) & (cols < counts[1])
        values = np.ones(own.size) if weights is None else weights
        cells = values[counted], (rows[counted], cols[counted])
        total = total + scipy.sparse.csr_matrix(cells, counts)
    return total


def measure_surface(
    template: Bins,
    search: Bins,
    counts: tuple[int, int],
    measure: HistogramMeasure,
    order: int,
    context: Context,
) -> NDArray[np.float32]:
    """Return a measure of the joint histogram at all whole-pixel shifts.

    Parameters
    ----------
    template
        Bins or grey levels as for `joint_histogram_under`, shape (h, w).
    search
        The same for a concentric window that is larger on each side by the radius plus
        `joint_histogram.reach` of the order.
    counts
        Number of bins of template and search window.
    measure
        The measure.
    order
        Order of the B-spline, 2 to 7.
    context
        Provides the threads; its progress receives every row.

    Returns
    -------
    Array of shape (2 radius + 1, 2 radius + 1); infinite where single precision overflows.
    """
    margin = reach(order)
    span = search.shape[0] - template.shape[0] - 2 * margin + 1

    def one_by_one(dy: int) -> FloatArray:
        shifts = [Affine.translation(margin + dx, margin + dy) for dx in range(span)]
        tables = (
            sparse_joint_histogram_under(template, search, shift, counts, order) for shift in shifts
        )
        return np.array([measure(table) for table in tables])

    volume_bytes = 4 * (span + 2 * margin) ** 2 * counts[0] * counts[1]
    if max(counts) <= MASKED and volume_bytes <= _MOST_VOLUME_BYTES:
        first, second = (np.minimum(bins, MASKED).astype(np.uint8) for bins in (template, search))
        counted = count_joint_histograms(first, second, counts, context)
        rows = context.map(measure, list(gpve_histograms(counted, order)))
    else:
        rows = context.map(one_by_one, range(span))
    with np.errstate(over="ignore"):
        return np.array(list(rows), np.float32)


def _places(template: Bins, to_image: Affine) -> tuple[Bins, FloatArray, FloatArray]:
    """Return bins and image positions (x, y) of template pixels, flat."""
    t = to_image
    height, width = template.shape
    rows, cols = np.arange(height)[:, None], np.arange(width)
    x, y = (p * cols + r + q * rows for p, q, r in ((t.a, t.b, t.c), (t.d, t.e, t.f)))
    return template.ravel(), x.ravel(), y.ravel()


def _contributions(
    own: Bins, image: Bins, x: FloatArray, y: FloatArray, counts: tuple[int, int], order: int
) -> Iterator[tuple[NDArray[np.intp], FloatArray | None]]:
    """Yield the histogram entries for each of the order² image pixels around the places.

    An entry holds, for each template pixel, the number of the cell and its weight (None: 1). The
    cells are those of a histogram with one extra bin per axis, which takes the excluded pixels.
    """
    codes = np.minimum(own, counts[0]).astype(np.intp) * (counts[1] + 1)
    padded = np.pad(np.minimum(image, counts[1]), 1, constant_values=counts[1]).ravel()
    stride = image.shape[1] + 2
    rows, along_y = _neighbours(y, image.shape[0], order)
    cols, along_x = _neighbours(x, image.shape[1], order)
    for row, weight_y in zip(rows, along_y, strict=True):
        start = row * stride
        for col, weight_x in zip(cols, along_x, strict=True):
            weights = None if order == 1 else weight_y * weight_x
            # Under whole-pixel shifts, the end pixels of even-order kernels have zero weight.
            if weights is None or weights.any():
                yield codes + padded[start + col], weights


def _neighbours(position: FloatArray, size: int, order: int) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the pixels in the support of a B-spline at each position, and their weights.

    Both have shape (order, n). Pixels are counted from a border of one pixel, which also stands
    for all pixels outside the image.
    """
    start = position - order / 2
    first = np.floor(start)
    weights = bspline_weights(order, start - first)
    first = np.clip(first, -order - 1, size) + 2
    pixels = first.astype(np.intp) + np.arange(order)[:, None]
    return np.clip(pixels, 0, size + 1), weights


@functools.lru_cache(maxsize=4)
def _offsets(order: int, seed: int, count: int) -> FloatArray:
    """Return random offsets (x, y) whose density is the B-spline, shape (2, count)."""
    rng = np.random.default_rng(seed)
    offsets = rng.random((order, 2, count)).sum(axis=0) - order / 2
    offsets.flags.writeable = False
    return offsets
