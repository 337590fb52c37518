"""Longitudes that go on across the antimeridian, where files and projections begin anew."""

from __future__ import annotations

import numpy as np
from rasterio.crs import CRS

from ..rasters.grid import FloatArray


def turned(xy: FloatArray, crs: CRS | None, x: float) -> FloatArray:
    """Return positions, shape (n, 2), by whole turns of longitude next to a longitude `x`.

    Of a CRS that is not geographic they stay as they are.
    """
    if crs is None or not crs.is_geographic:
        return xy
    # The unit in radians has 15 digits in WKT.
    turn = round(2 * np.pi / crs.units_factor[1], 9)
    turns = np.rint((xy[:, :1] - x) / turn)
    if not turns.any():
        return xy
    return np.asarray(xy - np.nan_to_num(turns, posinf=0, neginf=0) * [turn, 0])
