"""Inputs of the similarity measures: bins, orientation fields and edge strength of windows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch
from .binning import to_bins
from .joint_histogram import reach
from .orientation import SCALES_PX, edge_strength, orientation_fields

# Pixels that windows have beyond the chip on each side: the reach of the widest gradient filter and
# the widest histogram kernel.
BORDER_PX = 8

# Memory of a whole description: grey values and their validity, complex fields, strength and its
# validity, bins.
BYTES_A_PIXEL = 5 + 8 * len(SCALES_PX) + 5 + 1


@dataclass(frozen=True)
class _Window:
    """Image windows with `BORDER_PX` on each side; each description is made at its first use."""

    patch: Patch
    bin_count: int

    @cached_property
    def bins(self) -> NDArray[np.uint8]:
        around = self.patch.inner(BORDER_PX - reach())
        return to_bins(around.values, around.valid, self.bin_count)

    @cached_property
    def fields(self) -> NDArray[np.complex64]:
        return orientation_fields(self.patch)

    @cached_property
    def strength(self) -> Patch:
        return edge_strength(self.fields[0], self.patch.valid)


@dataclass(frozen=True)
class Description:
    """Image windows and their descriptions for measures, shared by all of their inner parts.

    Parameters
    ----------
    window
        The whole windows: one, or a stack of one size.
    border_px
        Pixels that are left out on each side, at least `BORDER_PX`.
    """

    window: _Window
    border_px: int = BORDER_PX

    @classmethod
    def of(cls, window: Patch, bin_count: int) -> Description:
        """Return the description of windows with `BORDER_PX` on each side."""
        return cls(_Window(window, bin_count))

    def inner(self, border_px: int) -> Description:
        """Return the description of the windows without a further border on each side."""
        return replace(self, border_px=self.border_px + border_px)

    @property
    def patch(self) -> Patch:
        """Grey values."""
        return self.window.patch.inner(self.border_px)

    @property
    def bin_count(self) -> int:
        """Number of bins."""
        return self.window.bin_count

    @property
    def bins(self) -> NDArray[np.uint8]:
        """Bins of the patch."""
        return self._bins(self.border_px - BORDER_PX + reach())

    @property
    def bins_around(self) -> NDArray[np.uint8]:
        """Bins of the patch and of its surroundings within reach of the histogram's kernel."""
        return self._bins(self.border_px - BORDER_PX)

    def _bins(self, border_px: int) -> NDArray[np.uint8]:
        inside = slice(border_px, -border_px or None)
        return self.window.bins[..., inside, inside]

    @property
    def fields(self) -> NDArray[np.complex64]:
        """Orientation fields at all scales, shape (scales, …, h, w)."""
        inside = slice(self.border_px, -self.border_px)
        return self.window.fields[..., inside, inside]

    @property
    def strength(self) -> Patch:
        """Strength of edges, 0 to 1."""
        return self.window.strength.inner(self.border_px)
