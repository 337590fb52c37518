"""Parts of a pair that match elsewhere than a model predicts.

Single chips match poorly, but their similarity surfaces add up: a peak common to several chips
rises above the noise by the square root of their number. Chips form a part if they have a common
peak elsewhere and each is lower where the model predicts it: a strip of another pass, a tile of
another date, layover. They must be neighbours, as displaced canopies lie all over a scene that is
registered correctly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from ..geometry.accuracy import NEIGHBOUR_SPACINGS
from ..geometry.judging import RIVAL_HEIGHT, TOLERANCE_PX
from ..rasters.grid import FloatArray, Grid, mesh
from ..rasters.reading import Mask
from ..similarity.surface import Surface
from .belief_propagation import Surfaces

# Chips farther from the model's prediction than the first lie elsewhere. Peaks beyond the second
# may be canopies of 30 m, in pixels of 1 m, and are a part only if they are an eighth of the chips.
# Of 607 correct transforms, canopies were as many in one (suites calibration --seeds 440-499 and,
# large rural scenes, 440-565; simulated --seeds 201-206; real; attacks: controls --seeds
# 33000-33039). A fifth of an image holds 7 of 49 chips.
ELSEWHERE_PX, CANOPIES_PX, CANOPIES_SHARE = 2 * TOLERANCE_PX, 20.0, 1 / 8

# Fewest chips of a part, and the largest similarity that one chip may contribute.
FEWEST_CHIPS = 3
MOST_OF_ONE = 7.0

# The highest chip of a part determines its shift, and the others confirm it. The excess is how much
# higher these others are there than where the model predicts them: their sum over the square root
# of their number, in standard deviations of noise. It must exceed what one chip may contribute: two
# copies of one chip and a third by chance, 1.6 high as some of 81 are, leave 8.6 / √2 = 6.1.
# A far place must exceed the model's own by as much.
LEAST_EXCESS = MOST_OF_ONE

_PLACES = (
    ("upper left", "top", "upper right"),
    ("left side", "middle", "right side"),
    ("lower left", "bottom", "lower right"),
)


@dataclass(frozen=True)
class FarPlace:
    """The best match of a pair far from a model, beside the model's own.

    Parameters
    ----------
    own_height, height
        Similarity at the model and at the far place, in robust standard deviations.
    shift_px
        Shift (x, y) of the far place from the model's prediction, in pixels of the searched grid.
    """

    own_height: float
    height: float = 0.0
    shift_px: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(
        cls, surface: Surface, own_px: float, beyond_px: float, eligible: Mask | None = None
    ) -> FarPlace:
        """Return the highest place of a surface that is far off; height 0 if there is none.

        Parameters
        ----------
        surface
            Similarity at shifts from the model's prediction, shape (2 r + 1, 2 r + 1).
        own_px
            Shifts up to this length are the model's own place.
        beyond_px
            Longer ones are far off.
        eligible
            Shifts that count, same shape; None: all.
        """
        radius_px = len(surface) // 2
        shifts = mesh(*2 * [np.arange(-radius_px, radius_px + 1)])
        distance_px = np.hypot(*shifts.T).reshape(surface.shape)
        own = float(surface[distance_px <= own_px].max())
        is_far = distance_px > beyond_px
        if eligible is not None:
            is_far &= eligible
        at = np.argmax(np.where(is_far, surface, -np.inf))
        if not is_far.flat[at]:
            return cls(own)
        x, y = map(float, shifts[at])
        return cls(own, float(surface.flat[at]), (x, y))

    def scaled(self, factor: float) -> FarPlace:
        """Return the place with its shift times a factor."""
        x, y = self.shift_px
        return replace(self, shift_px=(x * factor, y * factor))

    @property
    def distance_px(self) -> float:
        """Length of the shift."""
        return float(np.hypot(*self.shift_px))

    @property
    def is_rival(self) -> bool:
        """Whether the pair matches about as well there."""
        return self.height >= RIVAL_HEIGHT * self.own_height


@dataclass(frozen=True)
class Part:
    """Neighbouring chips that together match elsewhere than a model predicts.

    Parameters
    ----------
    where
        Part of the grid in which their centre lies, such as "upper left".
    shift_px
        Their common shift from the model's prediction, (x, y) in pixels of the grid.
    excess
        See `LEAST_EXCESS`.
    members
        Their numbers among the chips of the survey.
    """

    where: str
    shift_px: tuple[float, float]
    excess: float
    members: tuple[int, ...]

    @classmethod
    def of(
        cls,
        grid: Grid,
        centres: NDArray[np.int_],
        members: NDArray[np.int_],
        shift_px: tuple[float, float],
        excess: float,
    ) -> Part:
        """Return the part of some members of a survey's chips, whose centres are given."""
        where = place_in_words(grid, centres[members].mean(axis=0))
        return cls(where, shift_px, excess, tuple(map(int, members)))

    @property
    def chips(self) -> int:
        """Number of chips."""
        return len(self.members)

    @property
    def distance_px(self) -> float:
        """Length of their shift."""
        return float(np.hypot(*self.shift_px))


def find_parts(
    grid: Grid, centres: NDArray[np.int_], surfaces: Surfaces, least: float = LEAST_EXCESS
) -> Iterator[Part]:
    """Yield parts, the most evident first; no chip belongs to two of them.

    Parameters
    ----------
    grid
        The grid.
    centres
        Pixel positions (col, row) of chips, shape (n, 2).
    surfaces
        Their similarity around the model's prediction, in robust standard deviations, shape
        (n, 2 r + 1, 2 r + 1).
    least
        The smallest excess of a part.
    """
    shifts, higher = _higher_elsewhere(surfaces)
    are_neighbours = _are_neighbours(centres)
    left = np.arange(len(centres))
    while found := _highest_group(higher, are_neighbours, left, least):
        members, place, excess = found
        x, y = map(float, shifts[place])
        if np.hypot(x, y) <= CANOPIES_PX or len(members) >= CANOPIES_SHARE * len(centres):
            yield Part.of(grid, centres, members, (x, y), excess)
        left = np.setdiff1d(left, members)


def largest_group(centres: NDArray[np.int_], which: NDArray[np.bool_]) -> NDArray[np.int_]:
    """Return the numbers of the largest group of neighbours among some chips, shape (n,)."""
    groups = _connected(np.flatnonzero(which), _are_neighbours(centres))
    return max(groups, key=len, default=np.zeros(0, int))


def _highest_group(
    higher: FloatArray, are_neighbours: NDArray[np.bool_], which: NDArray[np.int_], least: float
) -> tuple[NDArray[np.int_], np.intp, float] | None:
    """Return the neighbours with the largest excess, the index of their shift, and the excess.

    At a shift, the best set of a given size consists of the highest chips, so no more sets need be
    tried than there are chips [Neill2012]. Each group of neighbours in the best set may be a part.
    """
    if len(which) < FEWEST_CHIPS:
        return None
    sizes, excesses = _highest_sets(higher[which])
    best = None
    for place in np.argsort(-excesses):
        if excesses[place] < least:
            break  # no group has a larger excess than the set that contains it
        highest = which[np.argsort(-higher[which, place])[: sizes[place]]]
        for group in _connected(highest, are_neighbours):
            if len(group) >= FEWEST_CHIPS and _excess(higher[group, place]) >= least:
                least = _excess(higher[group, place])
                best = np.sort(group), place, least
    return best


def _higher_elsewhere(surfaces: Surfaces) -> tuple[FloatArray, FloatArray]:
    """Return shifts elsewhere, (x, y), (s, 2), and how much higher chips are there, (n, s)."""
    radius = surfaces.shape[-1] // 2
    shifts = mesh(*2 * [np.arange(-radius, radius + 1)])
    distance = np.hypot(*shifts.T)
    is_far = distance > ELSEWHERE_PX
    shown = _limited(surfaces).astype(float).reshape(len(surfaces), len(shifts))
    own = shown[:, distance <= TOLERANCE_PX].max(axis=1, keepdims=True)
    return shifts[is_far], shown[:, is_far] - own


def _highest_sets(higher: FloatArray) -> tuple[NDArray[np.int_], FloatArray]:
    """Return for each shift the size and excess of the set of highest chips with most excess."""
    confirming = np.sort(higher, axis=0)[-2::-1].cumsum(axis=0)
    excess = confirming / np.sqrt(np.arange(1, len(higher)))[:, None]
    excess = excess[FEWEST_CHIPS - 2 :]
    return excess.argmax(axis=0) + FEWEST_CHIPS, excess.max(axis=0)


def _excess(higher: FloatArray) -> float:
    """Return the excess of two chips or more, shape (n,): see `LEAST_EXCESS`."""
    return float((higher.sum() - higher.max()) / np.sqrt(len(higher) - 1))


def _are_neighbours(centres: NDArray[np.int_]) -> NDArray[np.bool_]:
    """Return which chips of a regular layout are adjacent, (n, n), diagonals included.

    Some of the layout's may be missing: those on both sides of a gap are not adjacent.
    """
    adjacent = np.ones((len(centres), len(centres)), bool)
    for along in centres.T:
        steps = np.diff(np.unique(along))
        reach = NEIGHBOUR_SPACINGS * steps.min() if len(steps) else 0
        adjacent &= abs(np.subtract.outer(along, along)) <= reach
    return adjacent


def _connected(
    chips: NDArray[np.int_], are_neighbours: NDArray[np.bool_]
) -> Iterator[NDArray[np.int_]]:
    """Yield groups of chips connected by adjacency."""
    count, group = connected_components(are_neighbours[np.ix_(chips, chips)])
    for number in range(count):
        yield chips[group == number]


def _limited(surfaces: Surfaces) -> Surfaces:
    """Return surfaces, shape (n, h, w), scaled so that none is higher than `MOST_OF_ONE`."""
    highest = np.maximum(surfaces.max(axis=(1, 2), keepdims=True, initial=0.0), MOST_OF_ONE)
    return np.asarray(surfaces * (MOST_OF_ONE / highest))


def place_in_words(grid: Grid, px: FloatArray) -> str:
    """Return the name of the thirds of a grid, along both axes, that hold a position (col, row)."""
    col, row = (min(int(3 * at / side), 2) for at, side in zip(px, grid.size, strict=True))
    return _PLACES[row][col]
