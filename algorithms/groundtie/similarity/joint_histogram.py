"""The joint-histogram volume: joint histograms of a template and a search window at all shifts.

The joint histogram of generalised partial volume estimation (GPVE; Chen & Varshney 2003, thesis S
eq 3.34) at any continuous shift is a B-spline combination of the nearest-neighbour histograms at
integer shifts, as long as every shift sees the same template pixels:

    h(i + u, j + v) = Σ_p Σ_q β(p - u) β(q - v) h_NN(i + p, j + q)

So pixels are counted once, at integer shifts; every order, sub-pixel shift and derivative follows
from the volume without touching a pixel again.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from .binning import MASKED

FloatArray = NDArray[np.float32]
ORDERS = (2, 3, 4, 5, 6, 7)


def support(order: int) -> int:
    """Return how far beyond a shift the kernel of this order reaches, in whole pixels."""
    return (order + 1) // 2


def kernel(order: int, offset: float) -> NDArray[np.float64]:
    """Return B-spline weights β(p - offset) at p = -support … support; they sum to 1.

    `offset` is within ±0.5. Order n is degree n - 1: 2 is linear (PVI), 4 is cubic.
    """
    reach = support(order)
    knots = np.arange(order + 1) - order / 2
    spline = BSpline.basis_element(knots, extrapolate=False)
    return np.nan_to_num(spline(np.arange(-reach, reach + 1) - offset))


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

    def histograms(self, order: int) -> FloatArray:
        """Return the GPVE histograms at the integer shifts -radius … radius, float32."""
        weights = kernel(order, 0.0).astype(np.float32)
        weights = weights[weights > 0]
        reach = (len(weights) - 1) // 2
        self._require(reach)
        inner = slice(self.margin - reach, self.counts.shape[0] - self.margin + reach)
        smoothed = self.counts[inner, inner]
        return _convolve(_convolve(smoothed, weights, 0), weights, 1)

    def at(self, shift: tuple[float, float], order: int) -> NDArray[np.float64]:
        """Return the GPVE histogram at one shift (rows, columns), shape (bins, bins)."""
        self._require(support(order))
        centre = self.counts.shape[0] // 2
        reach = support(order)
        whole = [round(s) for s in shift]
        weights = [kernel(order, s - w) for s, w in zip(shift, whole, strict=True)]
        rows, cols = (slice(centre + w - reach, centre + w + reach + 1) for w in whole)
        return np.einsum("p,q,pqab->ab", *weights, self.counts[rows, cols].astype(np.float64))

    def _require(self, reach: int) -> None:
        if reach > self.margin:
            raise ValueError(f"the volume's margin of {self.margin} is below the kernel's {reach}")


def _convolve(volume: FloatArray, weights: FloatArray, axis: int) -> FloatArray:
    """Correlate along an axis with a short kernel; the axis loses the kernel's ends."""
    count = volume.shape[axis] - len(weights) + 1
    parts = (np.take(volume, range(k, k + count), axis) * w for k, w in enumerate(weights))
    total = next(parts)
    for part in parts:
        total += part
    return total


def count_joint_histograms(
    template: NDArray[np.uint8],
    search: NDArray[np.uint8],
    bins: tuple[int, int],
    radius: int,
    executor: Executor | None = None,
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
    executor
        Threads to count in; by default the calling one alone.
    """
    height, width = template.shape
    span = search.shape[0] - height + 1
    masked = bool((template == MASKED).any() or (search == MASKED).any())
    # Masked pixels go to one extra bin that is dropped; OpenCV's own mask is much slower.
    sizes = [count + masked for count in bins]
    if masked:
        template = np.minimum(template, bins[0]).astype(np.uint8)
        search = np.minimum(search, bins[1]).astype(np.uint8)
    counts = np.empty((span, span, *bins), np.float32)
    ranges = [0, sizes[0], 0, sizes[1]]

    def count_row(dy: int) -> None:
        for dx in range(span):
            window = search[dy : dy + height, dx : dx + width]
            histogram = cv2.calcHist([template, window], [0, 1], None, sizes, ranges)
            counts[dy, dx] = histogram[: bins[0], : bins[1]]

    _map(executor, count_row, span)
    return JointHistogramVolume(counts, radius)


def _map(executor: Executor | None, function: Callable[[int], None], count: int) -> None:
    for _ in (
        map(function, range(count)) if executor is None else executor.map(function, range(count))
    ):
        pass
