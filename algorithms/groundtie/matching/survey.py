"""Chips all over a pair, matched around a model: those that confirm it, and parts elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.judging import TOLERANCE_PX
from ..rasters.grid import FloatArray, Grid
from ..similarity.order_statistics import robust_deviation
from ..similarity.peak import peak_shifts
from ..similarity.surface import Surface
from .belief_propagation import Surfaces
from .chip_windows import Resampled
from .chips import LEAST_VALID_MASKED, ChipMatcher
from .matcher import MaskOf, Places
from .parts import ELSEWHERE_PX, LEAST_EXCESS, MOST_OF_ONE, Part, find_parts

# Range of the chips' side, number of chips side by side along the grid's shorter side if that range
# allows it, and the most along any side.
_CHIP_RANGE_PX, _ALONG, _MOST_ALONG = (40, 64), 7, 9

# Largest shift of a part.
SURVEY_RADIUS_PX = 24

# A chip supports a model if it is as high where the model predicts it, in robust standard
# deviations: noise within the tolerance seldom is.
_SUPPORT = 3.0

# A peak is the highest value in the neighbourhood that counts as one place.
_NEIGHBOURS = np.ones((2 * int(TOLERANCE_PX) + 1,) * 2, np.uint8)


@dataclass(frozen=True)
class Survey:
    """Matches of chips all over a grid, relative to their positions predicted by a model.

    Parameters
    ----------
    grid
        The grid.
    centres
        Pixel positions (col, row) of the chips, shape (n, 2).
    shifts_px
        Shift (x, y) of each chip's best match from the prediction, shape (n, 2).
    surfaces
        Similarity of the chips around the prediction, in robust standard deviations of each
        surface, shape (n, 2 r + 1, 2 r + 1).
    elsewhere_px
        Common shifts of all chips beyond this distance are second places.
    far
        Unsupporting chips and where they match best together, beyond the surfaces' radius, evident
        or not; None: they are too few.
    """

    grid: Grid
    centres: NDArray[np.int_]
    shifts_px: FloatArray
    surfaces: Surfaces
    elsewhere_px: float = ELSEWHERE_PX
    far: Part | None = None

    @cached_property
    def mean(self) -> Surface:
        """The mean of the chips' surfaces, shape (2 r + 1, 2 r + 1)."""
        return np.asarray(self.surfaces.sum(axis=0) / max(len(self.surfaces), 1))

    @property
    def is_confirming_chip(self) -> NDArray[np.bool_]:
        """Which chips match where the model predicts them, shape (n,)."""
        return np.asarray(np.hypot(*self.shifts_px.T) <= TOLERANCE_PX)

    @property
    def is_unsupporting_chip(self) -> NDArray[np.bool_]:
        """Which chips hardly match where the model predicts them, shape (n,)."""
        return np.asarray(self._near.max(axis=1) < _SUPPORT)

    @property
    def confirming(self) -> int:
        """Number of chips that match where the model predicts them."""
        return int(self.is_confirming_chip.sum())

    @property
    def comparable(self) -> int:
        """Number of chips that overlap the input where predicted; others have surfaces of 0."""
        return int((self._near != 0).any(axis=1).sum())

    @property
    def height(self) -> float:
        """Mean similarity of the chips where the model predicts them, at its maximum."""
        return float(self.mean[self._distance_px <= TOLERANCE_PX].max())

    @property
    def rival_height(self) -> float:
        """Mean similarity of the chips at the best common shift elsewhere."""
        return float(self.mean[self._is_far].max())

    @property
    def second_peak(self) -> float:
        """Mean similarity of many chips at the highest peak elsewhere; 0: there is no peak.

        Ground that lies elsewhere has a peak; the flank of the first place has none.
        """
        mean, of_many = self.mean, self._mean_of_many
        # It must be a peak of both means. A wide peak that is cut off is a plateau, as high at its
        # rim as in its middle; and a peak of few chips may be on the flank of the first place.
        is_peak = (mean == cv2.dilate(mean, _NEIGHBOURS)) & (
            of_many == cv2.dilate(of_many, _NEIGHBOURS)
        )
        return float(of_many[self._is_far & is_peak].max(initial=0.0))

    @property
    def deviation_elsewhere(self) -> float:
        """The robust standard deviation of the mean similarity of many chips elsewhere.

        It is at least that of a mean of as many independent chips: where little overlaps, most
        values are 0, and would make it too small.
        """
        of_noise = max(len(self.surfaces), 1) ** -0.5
        return max(robust_deviation(self._mean_of_many[self._is_far]), of_noise)

    @cached_property
    def _mean_of_many(self) -> Surface:
        """As `mean`, but of surfaces cut off at the largest contribution of one chip.

        So a few displaced canopies make no peak of the whole.
        """
        total = np.minimum(self.surfaces, MOST_OF_ONE).sum(axis=0)
        return np.asarray(total / max(len(self.surfaces), 1))

    @property
    def _near(self) -> NDArray[np.float32]:
        """Similarity of each chip where the model predicts it, shape (n, shifts)."""
        return self.surfaces[:, self._distance_px <= TOLERANCE_PX]

    @property
    def _is_far(self) -> NDArray[np.bool_]:
        """Mask of the shifts that count as second places, shape (2 r + 1, 2 r + 1)."""
        return np.asarray(self._distance_px > self.elsewhere_px)

    @property
    def _distance_px(self) -> FloatArray:
        shift = np.arange(-SURVEY_RADIUS_PX, SURVEY_RADIUS_PX + 1)
        return np.hypot(*np.meshgrid(shift, shift))

    @cached_property
    def parts(self) -> Sequence[Part]:
        """Groups of chips that together match elsewhere, a far one first, then the most evident."""
        far = [] if self.far is None or self.far.excess < LEAST_EXCESS else [self.far]
        return [*far, *find_parts(self.grid, self.centres, self.surfaces)]


def survey_places(grid: Grid) -> Places:
    """Return chips all over a grid, side by side, or farther apart where it is large."""
    chip = int(np.clip(min(grid.size) / _ALONG, *_CHIP_RANGE_PX))
    return Places.spread(grid, chip, lambda side: np.clip(side // chip, 1, _MOST_ALONG))


def survey_model(
    matcher: ChipMatcher,
    images: Resampled,
    places: Places,
    elsewhere_px: float,
    context: Context,
    without: MaskOf | None = None,
) -> Survey:
    """Match chips all over a pair around their positions predicted by a model on the map.

    Parameters
    ----------
    matcher
        Matches the chips.
    images
        The pair's, resampled by the model with a margin of at least the radius.
    places
        The chips, on a regular layout.
    elsewhere_px
        See `Survey`.
    context
        Threads and progress.
    without
        Takes a piece of the grid and returns which pixels of the reference are left out; None:
        none.
    """
    is_whole = without is None and images.part_of is None
    least = None if is_whole else LEAST_VALID_MASKED
    seen = replace(matcher, held_out=without, least_valid=least)
    kept, surfaces = seen.match_forward(images, places, SURVEY_RADIUS_PX, context)
    return Survey(places.grid, kept, peak_shifts(surfaces), surfaces, elsewhere_px)
