"""What a similarity surface says: where its peak lies, how sure and how exact it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .surface import Surface

# Fitting a paraboloid to the nine values around a peak: the least-squares solution for the
# coefficients of 1, x, y, x², xy, y², in rows.
_Y, _X = (axis.ravel().astype(float) for axis in np.mgrid[-1:2, -1:2])
_PARABOLOID = np.linalg.pinv(np.column_stack([np.ones(9), _X, _Y, _X**2, _X * _Y, _Y**2]))

# Peaks nearer than this to the first one belong to it.
_SAME_PEAK_PX = 3


@dataclass(frozen=True)
class Evidence:
    """The peak of a surface of robust standard deviations (see `surface`).

    Parameters
    ----------
    shift_px
        Sub-pixel shift of the peak (x along columns, y along rows).
    height
        Height of the peak in robust standard deviations of the surface.
    second_ratio
        Height of the second peak divided by this height.
    covariance_px2
        Covariance of the shift, shape (2, 2), x before y.
    at_border
        Whether the peak lies at the border of the search window, so that it may be no peak.
    """

    shift_px: tuple[float, float]
    height: float
    second_ratio: float
    covariance_px2: NDArray[np.float64]
    at_border: bool


def find_peak(surface: Surface) -> Evidence:
    """Return the evidence of a surface, shape (2 r + 1, 2 r + 1), whose centre is shift 0.

    The sub-pixel position is the maximum of the paraboloid through the peak's surroundings. For
    a background of unit variance whose correlation has the peak's own shape, the covariance of
    the position is the inverse of the negative Hessian divided by the peak's height.
    """
    radius = surface.shape[0] // 2
    row, col = (int(i) for i in np.unravel_index(surface.argmax(), surface.shape))
    height = float(surface[row, col])
    second = _second_height(surface, row, col)
    ratio = second / height if height > 0 else 1.0
    at_border = not (0 < row < surface.shape[0] - 1 and 0 < col < surface.shape[1] - 1)
    wide = np.eye(2) * (radius + 1) ** 2 / 3.0
    if at_border or height <= 0:
        return Evidence((col - radius, row - radius), height, ratio, wide, True)
    patch = surface[row - 1 : row + 2, col - 1 : col + 2].ravel().astype(float)
    _, bx, by, axx, axy, ayy = _PARABOLOID @ patch
    hessian = np.array([[2 * axx, axy], [axy, 2 * ayy]])
    if np.linalg.det(hessian) <= 0 or axx >= 0:
        return Evidence((col - radius, row - radius), height, ratio, wide, False)
    offset = np.clip(-np.linalg.solve(hessian, [bx, by]), -1, 1)
    shift = (float(col - radius + offset[0]), float(row - radius + offset[1]))
    return Evidence(shift, height, ratio, np.linalg.inv(-hessian) / height, False)


def _second_height(surface: Surface, row: int, col: int) -> float:
    rest = surface.copy()
    near = (max(row - _SAME_PEAK_PX, 0), max(col - _SAME_PEAK_PX, 0))
    rest[near[0] : row + _SAME_PEAK_PX + 1, near[1] : col + _SAME_PEAK_PX + 1] = -np.inf
    return float(rest.max(initial=0.0))
