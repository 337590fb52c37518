"""The peak of a similarity surface: its sub-pixel position, covariance and height."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .surface import Surface

# Least-squares fit of a paraboloid to the nine values around a peak: its rows give the coefficients
# of 1, x, y, x², xy, y².
_Y, _X = (axis.ravel().astype(float) for axis in np.mgrid[-1:2, -1:2])
_PARABOLOID = np.linalg.pinv(np.column_stack([np.ones(9), _X, _Y, _X**2, _X * _Y, _Y**2]))


@dataclass(frozen=True)
class Peak:
    """The peak of a surface of robust standard deviations (see `surface`).

    Parameters
    ----------
    shift_px
        Sub-pixel shift of the peak (x along columns, y along rows).
    height
        Height of the peak in robust standard deviations of the surface.
    covariance_px2
        Covariance of the shift, shape (2, 2), x before y.
    at_border
        Whether the highest value lies at the border of the search window, and may be no peak.
    """

    shift_px: tuple[float, float]
    height: float
    covariance_px2: NDArray[np.float64]
    at_border: bool


def find_peak(surface: Surface) -> Peak:
    """Return the highest peak of a surface, shape (2 r + 1, 2 q + 1), whose centre is shift 0.

    The sub-pixel position is the maximum of the paraboloid through the peak's surroundings. For
    a background of unit variance whose correlation has the peak's own shape, the covariance of
    the position is the inverse of the negative Hessian divided by the peak's height.
    """
    rows, cols = (side // 2 for side in surface.shape)
    row, col = (int(i) for i in np.unravel_index(surface.argmax(), surface.shape))
    height = float(surface[row, col])
    wide = np.diag([(cols + 1) ** 2 / 3.0, (rows + 1) ** 2 / 3.0])
    whole = (float(col - cols), float(row - rows))
    at_border = not (0 < row < surface.shape[0] - 1 and 0 < col < surface.shape[1] - 1)
    if at_border or height <= 0:
        return Peak(whole, height, wide, True)
    patch = surface[row - 1 : row + 2, col - 1 : col + 2].ravel().astype(float)
    _, bx, by, axx, axy, ayy = (_PARABOLOID @ patch).tolist()
    xx, yy = 2 * axx, 2 * ayy
    determinant = xx * yy - axy * axy
    if determinant <= 0 or axx >= 0:
        return Peak(whole, height, wide, False)
    # The Hessian is inverted by hand: for a single matrix, numpy takes many times as long.
    dx = min(max((axy * by - yy * bx) / determinant, -1.0), 1.0)
    dy = min(max((axy * bx - xx * by) / determinant, -1.0), 1.0)
    covariance = np.array([[-yy, axy], [axy, -xx]]) / (determinant * height)
    return Peak((whole[0] + dx, whole[1] + dy), height, covariance, False)


def peak_shifts(surfaces: Surface) -> NDArray[np.float64]:
    """Return the shifts (x, y) of the highest peaks of surfaces, (n, 2 r + 1, …), shape (n, 2)."""
    return np.array([find_peak(surface).shift_px for surface in surfaces]).reshape(-1, 2)


def find_peak_near(surface: Surface, expected_px: ArrayLike, within_px: int) -> Peak:
    """Return the highest peak near an expected shift.

    Parameters
    ----------
    surface
        Shape (2 r + 1, 2 r + 1).
    expected_px
        The shift (x, y).
    within_px
        Largest distance of the peak from the expected shift along each axis. The peak counts as
        `at_border` if it does not lie inside, or if this area reaches beyond the surface.
    """
    radius = surface.shape[0] // 2
    col, row = (round(float(e)) for e in np.asarray(expected_px))
    reach = radius - within_px
    middle_col, middle_row = (min(max(c, -reach), reach) for c in (col, row))
    top, left = middle_row + radius - within_px, middle_col + radius - within_px
    span = 2 * within_px + 1
    found = find_peak(surface[top : top + span, left : left + span])
    beyond = (middle_col, middle_row) != (col, row)
    shift = (found.shift_px[0] + middle_col, found.shift_px[1] + middle_row)
    return replace(found, shift_px=shift, at_border=found.at_border or beyond)
