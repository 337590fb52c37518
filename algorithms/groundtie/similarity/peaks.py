"""Non-maximum suppression: the highest peaks of a surface, each away from the higher ones."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray


def suppress(
    surface: NDArray[np.floating],
    at: Sequence[int],
    footprint: NDArray[np.bool_],
    circular: Collection[int] = (),
) -> None:
    """Set a surface to 0, in place, around a place.

    Parameters
    ----------
    surface
        Any shape; heights above a background of 0.
    at
        Index of the place along each axis.
    footprint
        Pixels to set, centred at the place: as many axes as the surface, sides odd.
    circular
        Axes whose ends are neighbours, such as angles.
    """
    near = np.argwhere(footprint) - np.array(footprint.shape) // 2 + np.array(at)
    for axis in circular:
        near[:, axis] %= surface.shape[axis]
    inside = near[((near >= 0) & (near < surface.shape)).all(axis=1)]
    surface[tuple(inside.T)] = 0


def highest_peaks(
    surface: NDArray[np.floating],
    count: int,
    footprint: NDArray[np.bool_],
    circular: Collection[int] = (),
) -> Iterator[tuple[int, ...]]:
    """Yield the indices of the highest values, best first, none in a higher one's footprint.

    The surface is overwritten: a peak's footprint is suppressed before the next one is searched
    for. Parameters are those of `suppress`. The iterator always yields `count` indices; values
    that are not positive are no peaks.
    """
    for left in range(count, 0, -1):
        at = tuple(int(i) for i in np.unravel_index(surface.argmax(), surface.shape))
        yield at
        if left > 1:
            suppress(surface, at, footprint, circular)
