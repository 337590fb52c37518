"""Parts of a pair that match elsewhere than a model has them.

Single chips match badly, but their similarity surfaces add up: in any rectangle of chips, what all
of them have in common stands out of noise by the square root of their number. Where that lies
elsewhere, and not where the model has it, that part of an image does: the seam of a mosaic, a strip
of another pass, layover. It is a scan statistic [Kulldorff1997].
"""

from __future__ import annotations

import math
from collections.abc import Iterator
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

# How much higher a part is elsewhere than where the model has it, in standard deviations of noise.
# Measured by the suite margins (--seeds 2 --sample 120): 7.9 at most on the shared pairs, of right
# controls one at 9.0; where a part was moved, 8.6 and more, but 3.8 and 8.0 in two of six.
LEAST_EXCESS = 8.5

# Where fewer than two of three chips match where the model has them, less speaks for it: a part may
# not stand out as all n chips do of which each is one such deviation higher elsewhere, √n. Measured
# by the suites real, rotated_pairs and attacks, from 25 to 49 chips: right transforms up to 0.97
# times that, and one at 1.4; of ten wrong ones four from 1.08 times on. With more chips, right ones
# up to 6.5 and wrong ones from 7.1 on. Pixels that a mask leaves vary more: of right copies up to
# 6.9, so that there are never fewer than 49 counted.
_FEWEST_IF_WEAK, _MOST_IF_WEAK = 25, 49

# Fewer chips are no part. None counts for more than this, so that two of three are no part, either,
# unless few match where the model has them: 2 * 7 / sqrt(3) = 8.1.
_FEWEST_CHIPS = 3
_MOST_OF_ONE = 7.0

_ROWS, _COLUMNS = ("upper", "", "lower"), ("left", "", "right")


@dataclass(frozen=True)
class Part:
    """Neighbouring chips that together match elsewhere than a model has them.

    Parameters
    ----------
    where
        In which part of the grid they lie, such as "upper left".
    shift_px
        By how much they lie elsewhere, (x, y) in pixels of the grid.
    height, model_height
        How high the sum of their surfaces is there, and where the model has them, in standard
        deviations of a sum of noise.
    members
        Which chips of the survey they are, by number.
    """

    where: str
    shift_px: tuple[float, float]
    height: float
    model_height: float
    members: tuple[int, ...]

    @property
    def chips(self) -> int:
        """How many chips they are."""
        return len(self.members)

    @property
    def distance_px(self) -> float:
        """How far off they lie."""
        return float(np.hypot(*self.shift_px))

    @property
    def excess(self) -> float:
        """How much higher they are elsewhere than where the model has them."""
        return self.height - self.model_height


def excess_if_weak(chips: int, is_masked: bool) -> float:
    """Return the excess from which on a part lies elsewhere, where few of so many chips confirm."""
    fewest = _MOST_IF_WEAK if is_masked else _FEWEST_IF_WEAK
    return math.sqrt(np.clip(chips, fewest, _MOST_IF_WEAK))


def find_parts(
    grid: Grid, centres: NDArray[np.int_], surfaces: Surfaces, least: float = LEAST_EXCESS
) -> list[Part]:
    """Return evident parts, the most evident first; no chip is in two of them.

    Parameters
    ----------
    grid
        The grid.
    centres
        Pixel positions (col, row) of chips on a regular lattice, shape (n, 2).
    surfaces
        Their similarity around where the model has them, in robust standard deviations, shape
        (n, 2 r + 1, 2 r + 1).
    least
        The excess from which on neither noise nor the model explains a part.
    """
    found = []
    left = np.arange(len(centres))
    while part := highest_part(grid, centres, surfaces, left):
        if part.excess < least:
            break
        found.append(part)
        left = np.setdiff1d(left, part.members)
    return found


def highest_part(
    grid: Grid, centres: NDArray[np.int_], surfaces: Surfaces, which: NDArray[np.int_]
) -> Part | None:
    """Return the rectangle of chips that is highest elsewhere against where the model has it.

    Parameters
    ----------
    grid, centres, surfaces
        See `find_parts`.
    which
        Which of the chips, by number.
    """
    radius = surfaces.shape[-1] // 2
    shifts = np.stack(np.meshgrid(*2 * [np.arange(-radius, radius + 1)]), axis=-1).reshape(-1, 2)
    distance = np.hypot(*shifts.T)
    is_far = (distance > ELSEWHERE_PX) & (distance <= _FARTHEST_PX)
    span = (2 * radius + 1) ** 2
    shown = limited(surfaces[which]).astype(float).reshape(len(which), span)
    best: Part | None = None
    if len(which) < _FEWEST_CHIPS:
        return best
    cols, rows = (np.unique(of, return_inverse=True)[1] for of in centres[which].T)
    for boxes, sums in _rectangles(rows, cols, shown):
        own = sums[:, distance <= SAME_PX].max(axis=1)
        excess = sums[:, is_far].max(axis=1) - own
        first = int(np.argmax(excess))
        if best is None or excess[first] > best.excess:
            top, bottom, left, right = boxes[first]
            chips = which[(rows >= top) & (rows < bottom) & (cols >= left) & (cols < right)]
            shift = shifts[is_far][sums[first, is_far].argmax()]
            best = Part(
                _where(grid, centres[chips].mean(axis=0)),
                (float(shift[0]), float(shift[1])),
                float(excess[first] + own[first]),
                float(own[first]),
                tuple(int(chip) for chip in chips),
            )
    return best


def limited(surfaces: Surfaces) -> Surfaces:
    """Return surfaces, shape (n, h, w), of which none is higher than one chip counts."""
    highest = np.maximum(surfaces.max(axis=(1, 2), keepdims=True, initial=0.0), _MOST_OF_ONE)
    return np.asarray(surfaces * (_MOST_OF_ONE / highest))


def _rectangles(
    rows: NDArray[np.int_], cols: NDArray[np.int_], values: FloatArray
) -> Iterator[tuple[NDArray[np.int_], FloatArray]]:
    """Yield the sums of values in rectangles, over the square root of how many they hold.

    All rectangles of the same rows at once: (top, bottom, left, right), shape (k, 4), and the sums
    of values of shape (n, s), shape (k, s).
    """
    sums = np.zeros((rows.max() + 2, cols.max() + 2, values.shape[1] + 1))
    sums[rows + 1, cols + 1] = np.column_stack([values, np.ones(len(values))])
    sums = sums.cumsum(axis=0).cumsum(axis=1)
    left, right = np.triu_indices(sums.shape[1], 1)
    for top, bottom in zip(*np.triu_indices(sums.shape[0], 1), strict=True):
        between = sums[bottom] - sums[top]
        inside = between[right] - between[left]
        counts = np.rint(inside[:, -1])
        kept = counts >= _FEWEST_CHIPS
        if kept.any():
            boxes = np.column_stack(
                [np.full_like(left, top), np.full_like(left, bottom), left, right]
            )
            yield boxes[kept], inside[kept, :-1] / np.sqrt(counts[kept, None])


def _where(grid: Grid, px: FloatArray) -> str:
    """Return in which third of a grid along each axis a position (col, row) lies."""
    size = grid.width, grid.height
    col, row = (min(int(3 * at / side), 2) for at, side in zip(px, size, strict=True))
    return " ".join(filter(None, (_ROWS[row], _COLUMNS[col]))) or "middle"
