"""The joint-histogram volume: joint histograms of a template and a search window at all shifts.

The joint histogram of generalised partial volume estimation (GPVE; [Chen2003], [Suri2010]
eq 3.34) at any continuous shift is a B-spline combination of the nearest-neighbour histograms at
integer shifts, as long as every shift sees the same template pixels:

    h(i + u, j + v) = Σ_p Σ_q β(p - u) β(q - v) h_NN(i + p, j + q)

So pixels are counted once, at integer shifts; every order, sub-pixel shift and derivative follows
from the volume without touching a pixel again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..context import Context
from ..rasters.kernels import bspline_weights
from .binning import MASKED

FloatArray = NDArray[np.float32]
ORDERS = (2, 3, 4, 5, 6, 7)

# The cubic B-spline is the first without interpolation artefacts.
ORDER = 4

# Templates of so many pixels or fewer are counted a row of shifts at a time.
_CODED_PIXELS = 20_000

# Seconds to count a pixel, one shift a call and a row of shifts a call; to call OpenCV; for each
# element and halving of an FFT: `benchmarks/run.py --only kernels`.
_PIXEL_COST, _CODED_PIXEL_COST, _CALL_COST, _SPECTRAL_COST = 0.5e-9, 0.95e-9, 6e-6, 0.4e-9


def support(order: int) -> int:
    """Return how far beyond a shift the kernel of this order reaches, in whole pixels."""
    return (order + 1) // 2


def reach(order: int = ORDER) -> int:
    """Return how far the kernel of this order reaches at integer shifts, in whole pixels."""
    return (order - 1) // 2


def kernel(order: int, offset: float) -> NDArray[np.float64]:
    """Return B-spline weights β(p - offset) at p = -support … support; they sum to 1.

    `offset` is within ±0.5. Order n is degree n - 1: 2 is linear (PVI), 4 is cubic.
    """
    far = support(order)
    start = offset - order / 2
    first = math.floor(start)
    weights = np.zeros(2 * far + 1)
    weights[far + first + 1 :][:order] = bspline_weights(order, start - first)
    return weights


@dataclass(frozen=True)
class JointHistogramVolume:
    """Nearest-neighbour joint histograms at integer shifts.

    Parameters
    ----------
    counts
        Histograms, shape (2 R + 1, 2 R + 1, template bins, search bins), for shifts -R … R of
        rows and columns.
    radius
        Largest shift for which surfaces are wanted; R - radius shifts remain for the kernel.
    """

    counts: FloatArray
    radius: int

    @property
    def margin(self) -> int:
        """How many further shifts there are on each side for the kernel."""
        return (self.counts.shape[0] - 1) // 2 - self.radius

    def histograms(self, order: int = ORDER) -> FloatArray:
        """Return the GPVE histograms at the integer shifts -radius … radius, float32."""
        near, far = reach(order), support(order)
        self._require(near)
        weights = kernel(order, 0.0).astype(np.float32)[far - near : far + near + 1]
        first = self.margin - near
        inner = slice(first, self.counts.shape[0] - first)
        return _convolve(_convolve(self.counts[inner, inner], weights, 0), weights, 1)

    def at(self, shift: tuple[float, float], order: int) -> NDArray[np.float64]:
        """Return the GPVE histogram at one shift (rows, columns), shape (bins, bins)."""
        far = support(order)
        self._require(far)
        centre = self.counts.shape[0] // 2
        whole = [round(s) for s in shift]
        weights = [kernel(order, s - w) for s, w in zip(shift, whole, strict=True)]
        rows, cols = (slice(centre + w - far, centre + w + far + 1) for w in whole)
        return np.einsum("p,q,pqab->ab", *weights, self.counts[rows, cols].astype(np.float64))

    def _require(self, needed: int) -> None:
        if needed > self.margin:
            raise ValueError(f"the volume's margin of {self.margin} is below the kernel's {needed}")


def _convolve(volume: FloatArray, weights: FloatArray, axis: int) -> FloatArray:
    """Correlate along axis 0 or 1 with a short kernel; the axis loses the kernel's ends."""
    count = volume.shape[axis] - len(weights) + 1
    total = np.zeros((), np.float32)
    for k, weight in enumerate(weights):
        part = volume[k : k + count] if axis == 0 else volume[:, k : k + count]
        total = total + part * weight
    return total


def count_joint_histograms(
    template: NDArray[np.uint8],
    search: NDArray[np.uint8],
    bins: tuple[int, int],
    radius: int,
    context: Context | None = None,
) -> JointHistogramVolume:
    """Count the joint histograms of a template at all integer shifts in its search window.

    Parameters
    ----------
    template
        Binned template, shape (h, w), with `binning.MASKED` where a pixel does not count.
    search
        Binned search window, shape (h + 2 R, w + 2 R), R ≥ `radius`; shift (0, 0) is its centre.
    bins
        Number of bins of template and search window.
    radius
        Largest shift for which surfaces are wanted.
    context
        Threads to count in; by default the calling one alone.
    """
    span = search.shape[0] - template.shape[0] + 1
    masked = bool((template == MASKED).any() or (search == MASKED).any())
    # Masked pixels go to one extra bin that is dropped; OpenCV's own mask is much slower.
    sizes = (bins[0] + masked, bins[1] + masked)
    template = np.minimum(template, bins[0]).astype(np.uint8)
    search = np.minimum(search, bins[1]).astype(np.uint8)
    coded = template.size <= _CODED_PIXELS and sizes[0] * sizes[1] <= 256 and span <= 256
    if _spectral_cost(search.size, bins) < _direct_cost(template.size, span, coded):
        counts = _count_spectrally(
            template, search, bins, 1 if context is None else context.workers
        )
    else:
        count_row = _row_counter(template, search, sizes, coded)
        counts = np.empty((span, span, *bins), np.float32)

        def store(dy: int) -> None:
            counts[dy] = count_row(dy)[:, : bins[0], : bins[1]]

        rows = range(span)
        for _ in map(store, rows) if context is None else context.quiet().map(store, rows):
            pass
    return JointHistogramVolume(counts, radius)


def _row_counter(
    template: NDArray[np.uint8], search: NDArray[np.uint8], sizes: tuple[int, int], coded: bool
) -> Callable[[int], FloatArray]:
    """Return the function that counts all shifts of one row, shape (shifts, *sizes)."""
    height, width = template.shape
    span = search.shape[1] - width + 1
    ranges = [0, sizes[0], 0, sizes[1]]

    def one_by_one(dy: int) -> FloatArray:
        rows = np.empty((span, *sizes), np.float32)
        for dx in range(span):
            window = search[dy : dy + height, dx : dx + width]
            rows[dx] = cv2.calcHist([template, window], [0, 1], None, list(sizes), ranges)
        return rows

    if not coded:
        return one_by_one
    # Small windows: a call would cost more than its counting. Template and search bin share a
    # byte, and all shifts of a row are counted by one call against the number of the shift.
    windows = np.lib.stride_tricks.sliding_window_view(search, (height, width))
    shape = (span * height, width)
    codes = np.broadcast_to(template * np.uint8(sizes[1]), (span, height, width)).reshape(shape)
    shifts = np.repeat(np.arange(span, dtype=np.uint8), height * width).reshape(shape)
    cells = sizes[0] * sizes[1]

    def all_at_once(dy: int) -> FloatArray:
        pairs = cv2.add(codes, windows[dy].reshape(shape))
        counted = cv2.calcHist([shifts, pairs], [0, 1], None, [span, cells], [0, span, 0, cells])
        return np.asarray(counted, np.float32).reshape(span, *sizes)

    return all_at_once


def _direct_cost(pixels: int, span: int, coded: bool) -> float:
    if coded:
        return span * (span * pixels * _CODED_PIXEL_COST + _CALL_COST)
    return span * span * (pixels * _PIXEL_COST + _CALL_COST)


def _spectral_cost(pixels: int, bins: tuple[int, int]) -> float:
    return bins[0] * bins[1] * pixels * np.log2(pixels) * _SPECTRAL_COST


def _count_spectrally(
    template: NDArray[np.uint8], search: NDArray[np.uint8], bins: tuple[int, int], workers: int
) -> FloatArray:
    """Count all shifts at once by correlating the planes of all bins with each other."""
    shape = [scipy.fft.next_fast_len(n, real=True) for n in search.shape]
    ny, nx = (s - t + 1 for s, t in zip(search.shape, template.shape, strict=True))
    counts = np.empty((ny, nx, *bins), np.float32)
    planes = np.stack([search == k for k in range(bins[1])]).astype(np.float32)
    spectra = scipy.fft.rfft2(planes, shape, workers=workers)
    for k in range(bins[0]):
        spectrum = scipy.fft.rfft2((template == k).astype(np.float32), shape)
        found = scipy.fft.irfft2(spectra * spectrum.conj(), shape, workers=workers)
        counts[:, :, k] = found[:, :ny, :nx].transpose(1, 2, 0)
    # Counts are whole numbers; what is left over is rounding, and so is the sign of zero.
    np.rint(counts, out=counts)
    np.abs(counts, out=counts)
    return counts
