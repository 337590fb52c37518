"""Joint histograms of a template and a search window at all shifts.

The joint histogram of generalised partial volume estimation (GPVE; [Chen2003], [Suri2010]
eq 3.34) at any continuous shift is a B-spline combination of the nearest-neighbour histograms at
integer shifts, as long as every shift sees the same template pixels:

    h(i + u, j + v) = Σ_p Σ_q β(p - u) β(q - v) h_NN(i + p, j + q)

Pixels are therefore counted once, at integer shifts; the histograms of every order follow from
these counts.
"""

from __future__ import annotations

import functools
import math
import operator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..rasters.kernels import bspline_weights
from ..rasters.reading import FloatImage
from .correlation import from_spectrum, spans, spectrum, tight_shape
from .stacks import each

# The cubic B-spline is the first without interpolation artefacts.
ORDER = 4

# Seconds to count a pixel at a shift, to call OpenCV, and for each element and halving of an FFT
# (`benchmarks/run.py --only kernels`).
_PIXEL_COST, _CALL_COST, _SPECTRAL_COST = 0.8e-9, 3.5e-6, 0.15e-9

# Rounding of a correlation by FFT stays below four times the product of both arrays' norms and
# half a unit in the last place. Whole numbers need an error below one half.
_LARGEST_ROUNDING = 0.5 / 4


def reach(order: int = ORDER) -> int:
    """Return the reach of the kernel of this order at integer shifts, in whole pixels."""
    return (order - 1) // 2


def gpve_histograms(counts: FloatImage, order: int = ORDER) -> FloatImage:
    """Return the GPVE histograms at all integer shifts at which the kernel lies inside the counts.

    Parameters
    ----------
    counts
        See `count_joint_histograms`.
    order
        Order of the B-spline, its degree + 1, 2 (partial volume interpolation) to 7.

    Returns
    -------
    Shape (…, ny - 2 reach, nx - 2 reach, template bins, search bins), float32.
    """
    far = reach(order)
    weights = bspline_weights(order, order % 2 / 2)[: 2 * far + 1].astype(np.float32)
    planes = np.moveaxis(counts, (-2, -1), (-4, -3))
    span_y, span_x = (n - 2 * far for n in planes.shape[-2:])
    made = np.empty((*planes.shape[:-2], span_y, span_x), np.float32)
    # Bin by bin, so that the working set stays in the processor's cache.
    for own in range(planes.shape[-4]):
        rows = _convolve(planes[..., own, :, :, :], weights, span_y, -2)
        made[..., own, :, :, :] = _convolve(rows, weights, span_x, -1)
    return np.moveaxis(made, (-4, -3), (-2, -1))


def _convolve(planes: FloatImage, weights: FloatImage, span: int, axis: int) -> FloatImage:
    """Correlate along an axis with a short kernel; the axis loses the kernel's ends."""
    along = planes.swapaxes(axis, -1)
    parts = (along[..., k : k + span] for k in range(len(weights)))
    found: FloatImage = functools.reduce(operator.iadd, map(np.multiply, parts, weights))
    return found.swapaxes(axis, -1)


def count_joint_histograms(
    template: NDArray[np.uint8],
    search: NDArray[np.uint8],
    bins: tuple[int, int],
    context: Context | None = None,
) -> FloatImage:
    """Count the joint histograms of a template at all integer shifts in its search window.

    Parameters
    ----------
    template
        Binned template, shape (…, h, w), with `binning.MASKED` where a pixel does not count.
    search
        Binned search window, shape (…, h + ny - 1, w + nx - 1).
    bins
        Number of bins of template and search window.
    context
        Threads to count in; by default the calling thread alone.

    Returns
    -------
    Nearest-neighbour histograms, shape (…, ny, nx, template bins, search bins), float32.
    """
    # Masked pixels go to one extra bin that is dropped; OpenCV's own mask is much slower.
    template = np.minimum(template, bins[0]).astype(np.uint8)
    search = np.minimum(search, bins[1]).astype(np.uint8)
    (own_rows, own_cols), (rows, cols) = template.shape[-2:], search.shape[-2:]
    if _spectral_cost(rows * cols, bins) < _direct_cost(own_rows * own_cols, rows - own_rows + 1):
        workers = 1 if context is None else context.workers
        return _count_spectrally(template, search, bins, workers)
    return _count_directly(template, search, bins, context)


def _direct_cost(pixels: int, span: int) -> float:
    return span * span * (pixels * _PIXEL_COST + _CALL_COST)


def _spectral_cost(pixels: int, bins: tuple[int, int]) -> float:
    return bins[0] * bins[1] * pixels * np.log2(pixels) * _SPECTRAL_COST


def _count_directly(
    template: NDArray[np.uint8],
    search: NDArray[np.uint8],
    bins: tuple[int, int],
    context: Context | None,
) -> FloatImage:
    """Count shift by shift."""
    height, width = template.shape[-2:]
    rows, cols = spans(template, search)
    sizes = [n + 1 for n in bins]
    ranges = [0, sizes[0], 0, sizes[1]]

    def of_one(template: NDArray[np.uint8], search: NDArray[np.uint8]) -> FloatImage:
        counts = np.empty((rows, cols, *bins), np.float32)

        def count_row(dy: int) -> None:
            for dx in range(cols):
                window = search[dy : dy + height, dx : dx + width]
                counted = cv2.calcHist([template, window], [0, 1], None, sizes, ranges)
                counts[dy, dx] = counted[: bins[0], : bins[1]]

        for _ in (map if context is None else context.quiet().map)(count_row, range(rows)):
            pass
        return counts

    return each(of_one, template, search)


def _count_spectrally(
    template: NDArray[np.uint8], search: NDArray[np.uint8], bins: tuple[int, int], workers: int
) -> FloatImage:
    """Count all shifts at once by correlating the planes of all bins with each other.

    Counts are whole numbers. Several bins of the search window, weighted by powers of 2, therefore
    share a plane, and their counts are the digits of the correlation.
    """
    shape = tight_shape(template, search < bins[1])
    digits = _Digits.of(template, search, bins)
    other = np.moveaxis(np.take(digits.weights(bins[1]), search, axis=1), 0, -3)
    of_search = spectrum(other, shape, workers)
    counts = np.empty((*template.shape[:-2], *bins, *spans(template, search)), np.float32)
    # Bin by bin and in one buffer, so that the working set stays in the processor's cache.
    product = np.empty_like(of_search)
    for bin in range(bins[0]):
        of_template = spectrum((template == bin).astype(digits.dtype), shape, workers).conj()
        np.multiply(of_search, of_template[..., None, :, :], out=product)
        found = from_spectrum(product, shape, counts.shape[-2:], workers)
        digits.read(found, counts[..., bin, :, :, :])
    return np.moveaxis(counts, (-4, -3), (-2, -1))


@dataclass(frozen=True)
class _Digits:
    """Layout of the counts of several bins in one floating-point number.

    Parameters
    ----------
    dtype
        Type of the number.
    bits
        Bits of each count.
    count
        Number of counts in a number.
    """

    dtype: type[np.floating]
    bits: int
    count: int

    @classmethod
    def of(
        cls, template: NDArray[np.uint8], search: NDArray[np.uint8], bins: tuple[int, int]
    ) -> _Digits:
        """Return the digits that hold the counts of all pairs of binned windows exactly."""
        own, other = (
            max(int(each(_bin_counts, window)[..., :n].max()), 1)
            for window, n in zip((template, search), bins, strict=True)
        )
        bits = min(own, other).bit_length()

        def most(dtype: type[np.floating]) -> int:
            rounding = float(np.finfo(dtype).eps) / 2 * math.sqrt(own * other)
            spare = math.log2(_LARGEST_ROUNDING) - math.log2(rounding)
            return min(1 + math.floor(spare / bits), bins[1])

        single, double = most(np.float32), most(np.float64)
        # Double precision takes twice the time; reading more digits takes a little more.
        if double <= 2.5 * single:
            return cls(np.float32, bits, single)
        return cls(np.float64, bits, max(double, 1))

    def weights(self, bins: int) -> NDArray[np.floating]:
        """Return the weights of each bin, and of masked pixels, in planes, (planes, bins + 1)."""
        bin = np.arange(bins)
        weights = np.zeros((-(-bins // self.count), bins + 1), self.dtype)
        weights[bin // self.count, bin] = 2.0 ** (self.bits * (bin % self.count))
        return weights

    def read(self, planes: NDArray[np.floating], counts: FloatImage) -> None:
        """Write the counts in planes, (…, planes, ny, nx), to `counts`, (…, bins, ny, nx)."""
        whole = np.rint(planes).astype(np.int32 if self.dtype is np.float32 else np.int64)
        for digit in range(self.count):
            part = counts[..., digit :: self.count, :, :]
            held = whole[..., : part.shape[-3], :, :]
            part[:] = (held >> (digit * self.bits)) & ((1 << self.bits) - 1)


def _bin_counts(window: NDArray[np.uint8]) -> NDArray[np.intp]:
    return np.bincount(window.ravel(), minlength=256)
