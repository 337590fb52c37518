"""Chips all over a pair, matched around a model: what confirms it, and what lies elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.judging import TOLERANCE_PX
from ..geometry.models import Model
from ..rasters.grid import FloatArray, Grid
from ..similarity.order_statistics import robust_deviation
from ..similarity.peak import peak_shifts
from ..similarity.surface import Surface
from .belief_propagation import Surfaces
from .chip_windows import Resampled
from .chips import LEAST_VALID_MASKED, ChipMatcher
from .matcher import MaskOf, Places
from .parts import ELSEWHERE_PX, MOST_OF_ONE, Part, find_parts

# Chips lie side by side: so many along the shorter side of the grid if their sides allow it, and no
# more than so many along any.
_CHIP_RANGE_PX, _ALONG, _MOST_ALONG = (40, 64), 7, 9

# How far off a part may lie.
SURVEY_RADIUS_PX = 24

# A peak is higher than all around it that counts as the same place.
_NEIGHBOURS = np.ones((2 * int(TOLERANCE_PX) + 1,) * 2, np.uint8)


@dataclass(frozen=True)
class Survey:
    """Where chips all over a grid match, relative to where a model has them.

    Parameters
    ----------
    grid
        The grid.
    centres
        Pixel positions (col, row) of the chips, shape (n, 2).
    shifts_px
        Where each matches best, (x, y) from where the model has it, shape (n, 2).
    surfaces
        Their similarity around where the model has them, in robust standard deviations of each,
        shape (n, 2 r + 1, 2 r + 1).
    elsewhere_px
        Places farther than this from where the model has all chips are second places.
    """

    grid: Grid
    centres: NDArray[np.int_]
    shifts_px: FloatArray
    surfaces: Surfaces
    elsewhere_px: float = ELSEWHERE_PX

    @cached_property
    def mean(self) -> Surface:
        """The mean of the chips' surfaces, shape (2 r + 1, 2 r + 1)."""
        return np.asarray(self.surfaces.sum(axis=0) / max(len(self.surfaces), 1))

    @property
    def is_confirming_chip(self) -> NDArray[np.bool_]:
        """Which chips match where the model has them, shape (n,)."""
        return np.asarray(np.hypot(*self.shifts_px.T) <= TOLERANCE_PX)

    @property
    def confirming(self) -> int:
        """How many chips match where the model has them."""
        return int(self.is_confirming_chip.sum())

    @property
    def comparable(self) -> int:
        """How many chips overlap with the input where the model has them: surfaces are 0 else."""
        near = self.surfaces[:, self._distance_px <= TOLERANCE_PX]
        return int((near != 0).any(axis=1).sum())

    @property
    def height(self) -> float:
        """How high the chips' similarity is on average where the model has them."""
        return float(self.mean[self._distance_px <= TOLERANCE_PX].max())

    @property
    def rival_height(self) -> float:
        """How high it is where all of them are moved elsewhere, at the best such place."""
        return float(self.mean[self._is_far].max())

    @property
    def second_peak(self) -> float:
        """How high many chips are at the highest peak elsewhere; 0: there is none.

        Ground that lies elsewhere has one; what is similar because it lies near has none.
        """
        mean, of_many = self.mean, self._mean_of_many
        # A peak of both: cut off, a wide one is a plateau, whose rim is as high as its middle; and
        # what few chips are highest at may be the flank of the first place to many.
        is_peak = (mean == cv2.dilate(mean, _NEIGHBOURS)) & (
            of_many == cv2.dilate(of_many, _NEIGHBOURS)
        )
        return float(of_many[self._is_far & is_peak].max(initial=0.0))

    @property
    def deviation_elsewhere(self) -> float:
        """The robust standard deviation of the mean similarity of many chips elsewhere.

        It is no less than that of a mean of as many independent chips: where little overlaps, most
        of it is 0.
        """
        of_noise = max(len(self.surfaces), 1) ** -0.5
        return max(robust_deviation(self._mean_of_many[self._is_far]), of_noise)

    @cached_property
    def _mean_of_many(self) -> Surface:
        """As `mean`, but of surfaces cut off where a chip would count for more than one may.

        So a few canopies that are displaced are no peak of the whole.
        """
        total = np.minimum(self.surfaces, MOST_OF_ONE).sum(axis=0)
        return np.asarray(total / max(len(self.surfaces), 1))

    @property
    def _is_far(self) -> NDArray[np.bool_]:
        """At which shifts second places lie, shape (2 r + 1, 2 r + 1)."""
        return np.asarray(self._distance_px > self.elsewhere_px)

    @property
    def _distance_px(self) -> FloatArray:
        shift = np.arange(-SURVEY_RADIUS_PX, SURVEY_RADIUS_PX + 1)
        return np.hypot(*np.meshgrid(shift, shift))

    @cached_property
    def parts(self) -> Sequence[Part]:
        """Chips that together match elsewhere, the most evident first."""
        return list(find_parts(self.grid, self.centres, self.surfaces))


def survey_places(grid: Grid) -> Places:
    """Return chips all over a grid, side by side, or farther apart where it is large."""
    chip = int(np.clip(min(grid.size) / _ALONG, *_CHIP_RANGE_PX))
    return Places.spread(grid, chip, lambda side: np.clip(side // chip, 1, _MOST_ALONG))


def survey_model(
    matcher: ChipMatcher,
    model: Model,
    places: Places,
    elsewhere_px: float,
    context: Context,
    without: MaskOf | None = None,
    images: Resampled | None = None,
) -> Survey:
    """Match chips all over a pair around what a model on the map predicts.

    Parameters
    ----------
    matcher
        What the chips are matched by.
    model
        The model.
    places
        The chips, on a regular layout.
    elsewhere_px
        See `Survey`.
    context
        Threads and progress.
    without
        Returns for a piece of the grid which pixels of the reference are left out; None: none.
    images
        The pair's, resampled by the model with the radius and more around them; None: they are
        resampled here.
    """
    least = None if without is None else LEAST_VALID_MASKED
    seen = replace(matcher, held_out=without, least_valid=least)
    kept, surfaces = seen.match_forward(model, places, SURVEY_RADIUS_PX, context, images)
    return Survey(places.grid, kept, peak_shifts(surfaces), surfaces, elsewhere_px)
