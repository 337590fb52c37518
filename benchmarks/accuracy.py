"""How far a registration is from the truth, and what that makes of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Mapping = Callable[[FloatArray], FloatArray]

# What is accepted is correct up to the first, and silently wrong beyond the second, both beyond
# how far the truth itself can be believed.
CORRECT_PX = 1.0
SILENTLY_WRONG_PX = 3.0

CORRECT = "correct"
INACCURATE = "inaccurate"
SILENTLY_WRONG = "silently wrong"
REFUSED = "refused"
CRASHED = "crashed"
VERDICTS = (CORRECT, INACCURATE, REFUSED, SILENTLY_WRONG, CRASHED)

_LATTICE = 21


@dataclass(frozen=True)
class Truth:
    """Which input positions belong to which reference positions.

    Parameters
    ----------
    reference_px, input_px
        Positions (col, row) that belong together, float64 shape (n, 2).
    linear
        Input pixels per reference pixel, shape (2, 2): what takes errors in input pixels to
        reference pixels.
    """

    reference_px: FloatArray
    input_px: FloatArray
    linear: FloatArray

    @classmethod
    def on_lattice(cls, mapping: Mapping, size: tuple[int, int], linear: FloatArray) -> Truth:
        """Return the truth at a lattice over the whole reference of `size` (columns, rows)."""
        px = lattice(size)
        return cls(px, mapping(px), linear)

    def off_px(self, found: Mapping) -> FloatArray:
        """Return how far a mapping is off, in reference pixels, shape (n, 2).

        Parameters
        ----------
        found
            Function from reference pixels to input pixels, both shape (n, 2).
        """
        return (found(self.reference_px) - self.input_px) @ np.linalg.inv(self.linear).T

    def error_px(self, found: Mapping) -> float:
        """Return the root mean square error, in reference pixels, of a mapping; see `off_px`."""
        return float(np.sqrt(np.mean(np.sum(self.off_px(found) ** 2, axis=1))))


def lattice(size: tuple[int, int]) -> FloatArray:
    """Return positions (col, row) that cover an image of `size` (columns, rows), its border too."""
    side = [np.linspace(0, count - 1, _LATTICE) for count in size]
    return np.stack(np.meshgrid(*side), axis=-1).reshape(-1, 2)


def classify(accepted: bool, error_px: float, sigma_px: float) -> str:
    """Return what a registration is.

    Parameters
    ----------
    accepted
        Whether the tool accepted it.
    error_px
        Its error; infinite where nothing could have been right, as for two different places.
    sigma_px
        How far the truth itself can be believed.

    Returns
    -------
    str
        One of `VERDICTS`, but not `CRASHED`.
    """
    if not accepted:
        return REFUSED
    if math.isnan(error_px):
        raise ValueError("the error of an accepted registration must be known")
    if error_px <= sigma_px + CORRECT_PX:
        return CORRECT
    return SILENTLY_WRONG if error_px > sigma_px + SILENTLY_WRONG_PX else INACCURATE
