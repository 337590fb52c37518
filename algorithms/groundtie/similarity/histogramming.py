"""The joint histogram of a template and an image under any affine transform.

Generalised partial volume estimation (GPVE; Chen & Varshney 2003, thesis S 3.4.2, eq 3.34) spreads
each template pixel over the bins of the image pixels around its place, with the weights of a
B-spline. For shifts alone `joint_histogram` counts many transforms at once; here a transform may
rotate, scale and shear.
"""

from __future__ import annotations

import functools

import numpy as np
from affine import Affine
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Bins = NDArray[np.uint8]

# Up to so many template pixels every weight is summed up; beyond, that takes too long for a search.
_EXACT_PIXELS = 20_000


def joint_histogram_under(
    template: Bins,
    image: Bins,
    to_image: Affine,
    counts: tuple[int, int],
    order: int = 4,
    seed: int = 0,
    sample: NDArray[np.int_] | None = None,
) -> FloatArray:
    """Return the joint histogram of a template and an image under an affine transform.

    With up to 20 000 template pixels the weights of GPVE are summed up as they are. More pixels
    are moved each by a random offset, drawn from the B-spline of one order less, and counted with
    the nearest image pixel: its expectation is GPVE, its noise is that of counting alone, and it
    takes as long for every order. The same seed gives the same offsets for every transform, so
    that a search sees one function.

    Parameters
    ----------
    template, image
        Bins, shapes (h, w) and (H, W), with `binning.MASKED` where a pixel does not count.
    to_image
        From template to image pixels (col, row), pixel centres at integers.
    counts
        Number of bins of template and image.
    order
        Order of the B-spline, 2 (partial volume interpolation) to 7; 1 is nearest neighbour.
    seed
        Of the random offsets.
    sample
        Flat indices of the template pixels that take part; None: all.

    Returns
    -------
    Histogram, shape `counts`. Weights that fall outside the image or on masked pixels drop out.
    """
    own, x, y = _places(template, to_image, sample)
    if order == 1 or own.size <= _EXACT_PIXELS:
        return _spread(own, image, x, y, counts, order)
    dx, dy = _offsets(order - 1, seed, own.size)
    return _spread(own, image, x + dx, y + dy, counts, 1)


def _places(
    template: Bins, to_image: Affine, sample: NDArray[np.int_] | None
) -> tuple[Bins, FloatArray, FloatArray]:
    """Return bins and image positions (x, y) of template pixels, flat."""
    t = to_image
    height, width = template.shape
    if sample is not None:
        rows, cols = np.divmod(sample, width)
        x, y = (p * cols + q * rows + r for p, q, r in ((t.a, t.b, t.c), (t.d, t.e, t.f)))
        return template.ravel()[sample], x, y
    rows, cols = np.arange(height)[:, None], np.arange(width)
    x, y = (p * cols + r + q * rows for p, q, r in ((t.a, t.b, t.c), (t.d, t.e, t.f)))
    return template.ravel(), x.ravel(), y.ravel()


def _spread(
    own: Bins, image: Bins, x: FloatArray, y: FloatArray, counts: tuple[int, int], order: int
) -> FloatArray:
    """Sum up the weights of the order² image pixels around every template pixel's place."""
    # One extra bin on each side takes what does not count, and is dropped in the end.
    sizes = counts[0] + 1, counts[1] + 1
    codes = np.minimum(own, counts[0]).astype(np.intp) * sizes[1]
    padded = np.pad(np.minimum(image, counts[1]), 1, constant_values=counts[1]).ravel()
    stride = image.shape[1] + 2
    rows, along_y = _neighbours(y, image.shape[0], order)
    cols, along_x = _neighbours(x, image.shape[1], order)
    total = np.zeros(sizes[0] * sizes[1])
    for row, weight_y in zip(rows, along_y, strict=True):
        start = row * stride
        for col, weight_x in zip(cols, along_x, strict=True):
            weights = None if order == 1 else weight_y * weight_x
            pairs = codes + padded[start + col]
            total += np.bincount(pairs, weights, minlength=total.size)
    return total.reshape(sizes)[: counts[0], : counts[1]]


def _neighbours(position: FloatArray, size: int, order: int) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the pixels that a B-spline at each position reaches, and their weights.

    Both have shape (order, n). Pixels are counted from a border of one pixel; those outside of
    the image lie on the border.
    """
    start = position - order / 2
    first = np.floor(start)
    weights = _spline(start - first, order)
    first = np.clip(first, -order - 1, size) + 2
    pixels = first.astype(np.intp) + np.arange(order)[:, None]
    return np.clip(pixels, 0, size + 1), weights


def _spline(fraction: FloatArray, order: int) -> FloatArray:
    """Return the B-spline of an order at j + 1 - fraction for j = 0 … order - 1 (de Boor)."""
    weights = np.zeros((order, fraction.size))
    weights[0] = 1
    for n in range(2, order + 1):
        for j in reversed(range(n)):
            before = (n - 1 - j + fraction) * weights[j - 1] if j else 0
            weights[j] = ((j + 1 - fraction) * weights[j] + before) / (n - 1)
    return weights


@functools.lru_cache(maxsize=4)
def _offsets(order: int, seed: int, count: int) -> FloatArray:
    """Return random offsets (x, y) with the B-spline as density, shape (2, count)."""
    rng = np.random.default_rng(seed)
    offsets = rng.random((order, 2, count)).sum(axis=0) - order / 2
    offsets.flags.writeable = False
    return offsets
