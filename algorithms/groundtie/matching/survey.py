"""Chips all over a pair, matched around a model: parts of the images that lie elsewhere by it.

Points that disagree with a right model fell anywhere. Where neighbours agree with each other on
another place, that part of an image lies elsewhere: a mosaic, another pass, layover.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError

from ..context import Context
from ..geometry.chance import agreement_probability, log10_chance
from ..geometry.judging import LARGEST_LOG10_CHANCE, SMALLEST_INLIER_SHARE
from ..geometry.models import Model
from ..rasters.grid import Grid
from ..similarity.peak import find_peak
from ..similarity.surface import Surface
from .belief_propagation import Surfaces
from .chips import LEAST_VALID_MASKED, ChipMatcher
from .ghost import ghost_height
from .matcher import FloatArray, MaskOf, Places
from .parts import Elsewhere, Part

# Chips lie side by side: so many along the shorter side of the grid if their sides allow it, and no
# more than so many along any.
_CHIP_RANGE_PX, _ALONG, _MOST_ALONG = (40, 64), 7, 9

# How far off a part may lie.
SURVEY_RADIUS_PX = 24

# Chips agree with each other, or with the model, within this distance.
_SAME_PX = 2.0

# Farther from where the model has them, they lie elsewhere.
ELSEWHERE_PX = 2 * _SAME_PX

_ROWS, _COLUMNS = ("upper", "", "lower"), ("left", "", "right")

# Chips nearer to each other than so many spacings are neighbours: those at a side.
_NEIGHBOUR_SPACINGS = 1.2


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
    spacing_px
        Distance between neighbours along columns and rows.
    mean
        The mean of their similarity surfaces, in robust standard deviations of one of them, shape
        (2 r + 1, 2 r + 1).
    elsewhere_px
        Chips farther than this from where the model has them lie elsewhere.
    ghost_height
        How high the mean is elsewhere when what the reference repeats of itself is taken out, in
        robust standard deviations of what is left.
    """

    grid: Grid
    centres: NDArray[np.int_]
    shifts_px: FloatArray
    spacing_px: FloatArray
    mean: Surface
    elsewhere_px: float = ELSEWHERE_PX
    ghost_height: float = 0.0

    @property
    def is_confirming_chip(self) -> NDArray[np.bool_]:
        """Which chips match where the model has them, shape (n,)."""
        return np.asarray(np.hypot(*self.shifts_px.T) <= _SAME_PX)

    @property
    def confirming(self) -> int:
        """How many chips match where the model has them."""
        return int(self.is_confirming_chip.sum())

    @property
    def is_confirming(self) -> bool:
        """Whether more of them do than would by chance, and a share as of check points does."""
        count = len(self.centres)
        chance = log10_chance(
            self.confirming, count, agreement_probability(_SAME_PX, SURVEY_RADIUS_PX)
        )
        enough = self.confirming >= SMALLEST_INLIER_SHARE * count
        return enough and chance <= LARGEST_LOG10_CHANCE

    @property
    def height(self) -> float:
        """How high the chips' similarity is on average where the model has them."""
        return float(self.mean[self._distance_px <= _SAME_PX].max())

    @property
    def rival_height(self) -> float:
        """How high it is where all of them are moved elsewhere, at the best such place."""
        return float(self.mean[self._distance_px > self.elsewhere_px].max())

    @property
    def _distance_px(self) -> FloatArray:
        shift = np.arange(-SURVEY_RADIUS_PX, SURVEY_RADIUS_PX + 1)
        return np.hypot(*np.meshgrid(shift, shift))

    @cached_property
    def parts(self) -> Sequence[Part]:
        """Groups of neighbours that agree with each other, not with the model, largest first."""
        free = np.hypot(*self.shifts_px.T) > self.elsewhere_px
        found = []
        while free.any():
            groups = [self._group(int(seed), free) for seed in np.flatnonzero(free)]
            largest = max(groups, key=len)
            if len(largest) < 2:
                break
            found.append(self._part(largest))
            free[largest] = False
        return found

    @property
    def elsewhere(self) -> Elsewhere:
        """The most chips, wherever they lie, that agree with each other and not with the model."""
        shifts = self.shifts_px[np.hypot(*self.shifts_px.T) > self.elsewhere_px]
        if len(shifts) == 0:
            return Elsewhere((0.0, 0.0), 0, np.inf)
        alike = np.hypot(*(shifts[:, None] - shifts).transpose(2, 0, 1)) <= _SAME_PX
        most = alike[int(alike.sum(axis=1).argmax())]
        count, every = int(most.sum()), len(self.centres)
        # One of the chips gives the place.
        chance = agreement_probability(_SAME_PX, SURVEY_RADIUS_PX)
        alarms = np.log10(every) + log10_chance(count - 1, every - 1, chance)
        right, down = np.median(shifts[most], axis=0)
        return Elsewhere((float(right), float(down)), count, float(alarms))

    def _group(self, seed: int, free: NDArray[np.bool_]) -> NDArray[np.int_]:
        """Return the chips, by number, that are connected to one and lie where it does."""
        apart = np.hypot(*(self.shifts_px - self.shifts_px[seed]).T)
        alike = np.flatnonzero(free & (apart <= _SAME_PX))
        between = np.abs(self.centres[alike][:, None] - self.centres[alike]) / self.spacing_px
        _, label = connected_components(between.max(axis=-1) <= _NEIGHBOUR_SPACINGS)
        return alike[label == label[np.searchsorted(alike, seed)]]

    def _part(self, group: NDArray[np.int_]) -> Part:
        inside = _inside_hull(self.centres, self.centres[group])
        confirming = int((np.hypot(*self.shifts_px[inside].T) <= _SAME_PX).sum())
        surrounded = int(inside.sum())
        # About as many parts as boxes of chips may be; one of the chips gives the place.
        boxes = np.prod([_pairs(len(np.unique(self.centres[:, k]))) for k in (0, 1)])
        chance = agreement_probability(_SAME_PX, SURVEY_RADIUS_PX)
        alarms = np.log10(boxes * surrounded) + log10_chance(len(group) - 1, surrounded - 1, chance)
        shift = np.median(self.shifts_px[group], axis=0)
        return Part(
            _where(self.grid, self.centres[group].mean(axis=0)),
            (float(shift[0]), float(shift[1])),
            len(group),
            surrounded,
            confirming,
            float(alarms),
            tuple(int(chip) for chip in group),
        )


def _inside_hull(px: NDArray[np.int_], of: NDArray[np.int_]) -> NDArray[np.bool_]:
    """Return which positions lie in the convex hull of some of them; in their box, on a line."""
    try:
        # Corners lie on the hull, whatever the last digit is.
        return np.asarray(Delaunay(of).find_simplex(px, tol=1e-6) >= 0)
    except (QhullError, ValueError):
        return np.asarray(((px >= of.min(axis=0)) & (px <= of.max(axis=0))).all(axis=1))


def _where(grid: Grid, px: FloatArray) -> str:
    """Return in which third of a grid along each axis a position (col, row) lies."""
    size = grid.width, grid.height
    col, row = (min(int(3 * at / side), 2) for at, side in zip(px, size, strict=True))
    return " ".join(filter(None, (_ROWS[row], _COLUMNS[col]))) or "middle"


def _pairs(count: int) -> int:
    return count * (count + 1) // 2


def survey_places(grid: Grid) -> Places:
    """Return chips all over a grid, side by side, or farther apart where it is large."""
    chip = int(np.clip(min(grid.width, grid.height) / _ALONG, *_CHIP_RANGE_PX))
    cols, rows = np.meshgrid(*(_along(size, chip) for size in (grid.width, grid.height)))
    return Places(grid, np.column_stack([cols.ravel(), rows.ravel()]), chip)


def survey_model(
    matcher: ChipMatcher,
    model: Model,
    context: Context,
    without: MaskOf | None = None,
    places: Places | None = None,
    elsewhere_px: float = ELSEWHERE_PX,
    seeks_ghost: bool = True,
) -> Survey:
    """Match chips all over a pair around what a model on the map predicts.

    Parameters
    ----------
    matcher
        What the chips are matched by.
    model
        The model.
    context
        Threads and progress.
    without
        Returns for a piece of the grid which pixels of the reference are left out; None: none.
    places
        The chips, on a regular layout; None: side by side on the matching grid.
    elsewhere_px
        See `Survey`.
    seeks_ghost
        Whether a ghost is looked for, which takes as long again; never where pixels are left out.
    """
    places = places or survey_places(matcher.pair.grid)
    asked = model, places, SURVEY_RADIUS_PX, context
    least = None if without is None else LEAST_VALID_MASKED
    seen = replace(matcher, held_out=without, least_valid=least)
    own = None
    if seeks_ghost and without is None:
        kept, surfaces, own = seen.match_forward_and_own(*asked)
    else:
        kept, surfaces = seen.match_forward(*asked)
    surfaces = _of_overlaps(surfaces)
    shifts = np.array([find_peak(surface).shift_px for surface in surfaces]).reshape(-1, 2)
    spacing = [float(np.diff(np.unique(places.centres[:, axis])).max(initial=1)) for axis in (0, 1)]
    mean = surfaces.sum(axis=0) / max(len(kept), 1)
    ghost = 0.0
    if own is not None and len(own) > 0:
        ghost = ghost_height(mean, _of_overlaps(own).mean(axis=0))
    return Survey(places.grid, kept, shifts, np.array(spacing), mean, elsewhere_px, ghost)


def _of_overlaps(surfaces: Surfaces) -> Surfaces:
    """Return surfaces in robust standard deviations of the shifts at which enough overlaps.

    Others are 0: where they are many, all seem to vary little, and peaks to be hundreds high.
    """
    made = surfaces.copy()
    for surface in made:
        known = surface[surface != 0]
        if known.size:
            surface /= max(1.4826 * float(np.median(np.abs(known - np.median(known)))), 1.0)
    return made


def _along(size: int, chip_px: int) -> NDArray[np.int_]:
    """Return the centres of chips along a side of a grid."""
    count = int(np.clip(size // chip_px, 1, _MOST_ALONG))
    return np.rint(np.linspace(chip_px / 2, size - chip_px / 2, count)).astype(int)
