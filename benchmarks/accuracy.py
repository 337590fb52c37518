"""The error of a registration, and the verdict on it by this error."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from groundtie.rasters.grid import FloatArray, PointFunction, mesh

# An accepted registration is correct up to the first error and silently wrong beyond the second;
# the uncertainty of the truth is added to both.
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
    """Input positions that correspond to reference positions.

    Parameters
    ----------
    reference_px, input_px
        Corresponding positions (col, row), float64 shape (n, 2).
    linear
        Input pixels per reference pixel, shape (2, 2): its inverse converts errors from input
        pixels to reference pixels.
    """

    reference_px: FloatArray
    input_px: FloatArray
    linear: FloatArray

    @classmethod
    def on_lattice(cls, mapping: PointFunction, size: tuple[int, int], linear: FloatArray) -> Truth:
        """Return the truth on a lattice over the whole reference of `size` (columns, rows)."""
        px = lattice(size)
        return cls(px, mapping(px), linear)

    def off_px(self, found: PointFunction) -> FloatArray:
        """Return the errors of a mapping in reference pixels, shape (n, 2).

        Parameters
        ----------
        found
            Function from reference pixels to input pixels, both shape (n, 2).
        """
        return (found(self.reference_px) - self.input_px) @ np.linalg.inv(self.linear).T

    def error_px(self, found: PointFunction) -> float:
        """Return the root mean square error of a mapping in reference pixels; see `off_px`."""
        return float(np.sqrt(np.mean(np.sum(self.off_px(found) ** 2, axis=1))))


def lattice(size: tuple[int, int]) -> FloatArray:
    """Return a lattice (col, row) over an image of `size` (columns, rows), including its border."""
    return mesh(*(np.linspace(0, count - 1, _LATTICE) for count in size))


def classify(accepted: bool, error_px: float, sigma_px: float) -> str:
    """Return the verdict on a registration by its error.

    Parameters
    ----------
    accepted
        Whether the tool accepted it.
    error_px
        Its error; infinite where no transform is right, as for two different places.
    sigma_px
        Uncertainty of the truth itself.

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
