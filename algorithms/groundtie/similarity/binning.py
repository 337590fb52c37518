"""Radiometric binning: grey values to the bins of a histogram ([Suri2010] 3.4.3, eq 3.38)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..rasters.colours import levels
from .order_statistics import quantiles
from .stacks import each

MASKED = np.uint8(255)
BINNINGS = ("equal-frequency", "linear")

# Quantiles are taken from at most this many pixels; their error is then far below a bin.
_SAMPLE = 65_536


def bin_edges(
    known: NDArray[np.float32], bins: int, binning: str = "equal-frequency"
) -> NDArray[np.float32]:
    """Return the inner edges between the bins of values, (n,), shape (bins - 1,).

    Equal-frequency edges are quantiles of the values; linear ones divide their range evenly.
    """
    if known.size == 0:
        return np.zeros(bins - 1, np.float32)
    sample = known[:: -(-known.size // _SAMPLE)]
    inner = np.arange(1, bins) / bins
    if binning == "equal-frequency":
        return quantiles(sample, inner).astype(np.float32)
    low, high = sample.min(), sample.max()
    return (low + inner * (high - low)).astype(np.float32)


def to_bins(
    values: NDArray[np.float32],
    valid: NDArray[np.bool_],
    bins: int,
    binning: str = "equal-frequency",
) -> NDArray[np.uint8]:
    """Return each pixel's bin, 0 to `bins` - 1, and `MASKED` where it is not valid.

    Parameters
    ----------
    values, valid
        Grey values and their validity, shape (…, h, w).
    bins
        Number of bins, 2 to 255, of equally many pixels in each image.
    binning
        One of `BINNINGS`.
    """

    def binned(values: NDArray[np.float32], valid: NDArray[np.bool_]) -> NDArray[np.uint8]:
        return levels(values, bin_edges(values[valid], bins, binning))

    return np.where(valid, each(binned, values, valid), MASKED)
