"""The inputs and results of matchers.

A matcher finds where places of the reference lie in the input, given a model that is nearly right.
There are three. `chips.ChipMatcher` (each chip by its own similarity surface) and
`pooled.PooledHistogramMatcher` (chips that share one joint histogram) match `Places` and return
`ChipSurfaces`. `keypoints.KeypointMatcher` matches keypoints all over the grid and returns
`Correspondences`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..geometry.accuracy import NEIGHBOUR_SPACINGS
from ..geometry.rows import Rows
from ..rasters.grid import FloatArray, Grid, mesh
from ..similarity.peak import find_peak
from ..similarity.surface import normalise
from .belief_propagation import Surfaces

MaskOf = Callable[[Grid], NDArray[np.bool_]]


@dataclass(frozen=True)
class Places:
    """Square chips of the reference.

    Parameters
    ----------
    grid
        Grid on which the chips are matched: the matching grid or a coarser level of it.
    centres
        Pixel positions (col, row) of the chips' centres in the grid, shape (n, 2).
    chip_px
        Side of the chips.
    """

    grid: Grid
    centres: NDArray[np.int_]
    chip_px: int

    @classmethod
    def tiles(cls, grid: Grid, chip_px: int) -> Places:
        """Return chips that cover a grid side by side; narrow grids have smaller ones."""
        chip_px = min(chip_px, *grid.size)
        sides = (np.arange(side // chip_px) * chip_px + chip_px // 2 for side in grid.size)
        return cls(grid, mesh(*sides).astype(int), chip_px)

    @classmethod
    def spread(cls, grid: Grid, chip_px: int, count: Callable[[int], float]) -> Places:
        """Return chips from border to border, equally spaced along each axis to a pixel.

        `count` takes the length of a side and returns the number of chips along it; a single one
        lies in the middle.
        """

        def along(length: int) -> FloatArray:
            number = int(count(length))
            if number == 1:
                return np.array([length / 2])
            return np.linspace(chip_px / 2, length - chip_px / 2, number)

        return cls(grid, np.rint(mesh(*map(along, grid.size))).astype(int), chip_px)

    @property
    def corners(self) -> NDArray[np.int_]:
        """First pixels (col, row) of the chips."""
        return self.centres - self.chip_px // 2

    @property
    def spacing_px(self) -> int:
        """Largest distance between successive columns or rows of chips."""
        return max(int(np.diff(np.unique(along)).max(initial=0)) for along in self.centres.T)


@dataclass(frozen=True)
class Correspondences(Rows):
    """Places of the reference and their matches in the input, resampled by a model.

    Parameters
    ----------
    px
        Pixel positions (col, row) in the grid, shape (n, 2).
    partner_px
        Positions of their matches, in pixels of the same grid, shape (n, 2).
    score
        Quality of the matches, larger is better, shape (n,).
    window_area_px2
        Area over which outliers are distributed.
    """

    px: FloatArray
    partner_px: FloatArray
    score: FloatArray
    window_area_px2: float


@dataclass(frozen=True)
class ChipSurfaces:
    """Similarity surfaces of chips on a grid: their full evidence, not the peaks alone.

    Parameters
    ----------
    centres
        Pixel positions (col, row) of the chips in the grid, shape (n, 2).
    forward
        Surfaces of reference chips in the input, shape (n, 2 r + 1, 2 r + 1).
    backward
        Surfaces of input chips in the reference, rotated by 180° so that they should peak at the
        same place; same shape.
    weight
        Weight of each chip's surface in a fit, shape (n,).
    """

    centres: NDArray[np.int_]
    forward: Surfaces
    backward: Surfaces
    weight: FloatArray

    @cached_property
    def combined(self) -> Surfaces:
        """The sum of both directions, in robust standard deviations."""
        return normalise(self.forward + self.backward)

    @property
    def weighted(self) -> Surfaces:
        """The sum of both directions, times the chip's weight in a fit."""
        return np.asarray(self.combined * self.weight[:, None, None], np.float32)

    @property
    def radius_px(self) -> int:
        """Largest shift."""
        return self.forward.shape[1] // 2

    @property
    def common_shift_px(self) -> FloatArray:
        """The shift (x, y) with the highest sum over all chips."""
        return np.array(find_peak(normalise(self.weighted.sum(axis=0))).shift_px)

    def correspondences(self) -> Correspondences:
        """Return the peaks inside their search windows."""
        peaks = [find_peak(surface) for surface in self.combined]
        inside = np.array([not peak.at_border for peak in peaks], bool)
        shifts = np.array([peak.shift_px for peak in peaks]).reshape(-1, 2)[inside]
        heights = np.array([peak.height for peak in peaks])[inside]
        px = self.centres[inside].astype(float)
        return Correspondences(px, px + shifts, heights, (2 * self.radius_px + 1.0) ** 2)

    def summed(self, groups: NDArray[np.int_]) -> ChipSurfaces:
        """Return the weighted sums of groups of chips, at the groups' mean positions.

        Parameters
        ----------
        groups
            Number of the group of each chip, shape (n,).
        """
        members = [np.flatnonzero(groups == group) for group in np.unique(groups)]
        middles = [np.rint(self.centres[of].mean(axis=0)) for of in members]
        return self._sums(np.array(middles, int).reshape(-1, 2), members)

    def with_neighbours(self, spacing_px: float) -> ChipSurfaces:
        """Return the weighted sum of each chip and its neighbours, given the chips' spacing."""
        from scipy.spatial import cKDTree  # takes long to import; few scenes need it

        if len(self.centres) == 0:
            return self
        reach = NEIGHBOUR_SPACINGS * spacing_px
        members = cKDTree(self.centres).query_ball_point(self.centres, reach, p=np.inf)
        return self._sums(self.centres, [np.sort(of) for of in members])

    def _sums(self, centres: NDArray[np.int_], members: list[NDArray[np.int_]]) -> ChipSurfaces:
        """Return the weighted sum at each centre; `members` holds the numbers of its chips."""
        weight = self.weight[:, None, None]

        def total(surfaces: Surfaces) -> Surfaces:
            added = [(surfaces[of] * weight[of]).sum(axis=0) for of in members]
            return normalise(np.array(added, np.float32).reshape(-1, *surfaces.shape[1:]))

        forward = total(self.forward)
        backward = forward if self.backward is self.forward else total(self.backward)
        weights = np.array([self.weight[of].sum() for of in members])
        return ChipSurfaces(centres, forward, backward, weights)
