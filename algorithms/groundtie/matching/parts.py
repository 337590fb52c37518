"""Parts of a pair that match elsewhere than a model has them.

Single chips match badly, but their similarity surfaces add up: what several of them have in common
stands out of noise by the square root of their number. Where that lies elsewhere, and each of them
is lower where the model has it, they do: a strip of another pass, tiles of another date, layover.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import Grid
from .belief_propagation import Surfaces
from .matcher import FloatArray

# Chips agree with each other, or with the model, within this distance.
SAME_PX = 2.0

# Farther from where the model has them, they lie elsewhere; still farther they are no part, but as
# canopies are displaced: of 30 m, in pixels of 1 m.
ELSEWHERE_PX, _FARTHEST_PX = 2 * SAME_PX, 20.0

# Fewer chips are no part, and none counts for more than this.
_FEWEST_CHIPS = 3
_MOST_OF_ONE = 7.0

# The highest chip of a part names the place where it lies, and the others confirm it. How much
# higher they are there than where the model has them is their sum over the square root of their
# number, in standard deviations of noise. It must be more than one chip may count for: two copies
# of one chip and a third by chance, 1.6 high as some of 81 are, leave 8.6 / √2 = 6.1.
LEAST_EXCESS = _MOST_OF_ONE

_ROWS, _COLUMNS = ("upper", "", "lower"), ("left", "", "right")


@dataclass(frozen=True)
class Part:
    """Chips that together match elsewhere than a model has them.

    Parameters
    ----------
    where
        In which part of the grid the middle of them lies, such as "upper left".
    shift_px
        By how much they lie elsewhere, (x, y) in pixels of the grid.
    excess
        See `LEAST_EXCESS`.
    members
        Which chips of the survey they are, by number.
    """

    where: str
    shift_px: tuple[float, float]
    excess: float
    members: tuple[int, ...]

    @property
    def chips(self) -> int:
        """How many chips they are."""
        return len(self.members)

    @property
    def distance_px(self) -> float:
        """How far off they lie."""
        return float(np.hypot(*self.shift_px))


def find_parts(grid: Grid, centres: NDArray[np.int_], surfaces: Surfaces) -> list[Part]:
    """Return evident parts, the most evident first; no chip is in two of them.

    Parameters
    ----------
    grid
        The grid.
    centres
        Pixel positions (col, row) of chips, shape (n, 2).
    surfaces
        Their similarity around where the model has them, in robust standard deviations, shape
        (n, 2 r + 1, 2 r + 1).
    """
    found = []
    left = np.arange(len(centres))
    while part := highest_part(grid, centres, surfaces, left):
        if part.excess < LEAST_EXCESS:
            break
        found.append(part)
        left = np.setdiff1d(left, part.members)
    return found


def highest_part(
    grid: Grid, centres: NDArray[np.int_], surfaces: Surfaces, which: NDArray[np.int_]
) -> Part | None:
    """Return the chips that are highest at one place elsewhere against where the model has each.

    Of all sets of so many chips, the highest is that of the highest ones: so no more sets need be
    looked at than there are chips [Neill2012].

    Parameters
    ----------
    grid, centres, surfaces
        See `find_parts`.
    which
        Which of the chips, by number.
    """
    if len(which) < _FEWEST_CHIPS:
        return None
    radius = surfaces.shape[-1] // 2
    shifts = np.stack(np.meshgrid(*2 * [np.arange(-radius, radius + 1)]), axis=-1).reshape(-1, 2)
    distance = np.hypot(*shifts.T)
    is_far = (distance > ELSEWHERE_PX) & (distance <= _FARTHEST_PX)
    shown = limited(surfaces[which]).astype(float).reshape(len(which), -1)
    higher = shown[:, is_far] - shown[:, distance <= SAME_PX].max(axis=1, keepdims=True)
    confirming = np.sort(higher, axis=0)[-2::-1].cumsum(axis=0)
    excess = confirming / np.sqrt(np.arange(1, len(which)))[:, None]
    excess[: _FEWEST_CHIPS - 2] = -np.inf
    last, place = np.unravel_index(excess.argmax(), excess.shape)
    members = which[np.argsort(-higher[:, place])[: last + 2]]
    x, y = shifts[is_far][place]
    return Part(
        _where(grid, centres[members].mean(axis=0)),
        (float(x), float(y)),
        float(excess[last, place]),
        tuple(int(chip) for chip in np.sort(members)),
    )


def limited(surfaces: Surfaces) -> Surfaces:
    """Return surfaces, shape (n, h, w), of which none is higher than one chip counts."""
    highest = np.maximum(surfaces.max(axis=(1, 2), keepdims=True, initial=0.0), _MOST_OF_ONE)
    return np.asarray(surfaces * (_MOST_OF_ONE / highest))


def _where(grid: Grid, px: FloatArray) -> str:
    """Return in which third of a grid along each axis a position (col, row) lies."""
    size = grid.width, grid.height
    col, row = (min(int(3 * at / side), 2) for at, side in zip(px, size, strict=True))
    return " ".join(filter(None, (_ROWS[row], _COLUMNS[col]))) or "middle"
