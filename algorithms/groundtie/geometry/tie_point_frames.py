"""Tie points as columns: arrays by name, or a GeoDataFrame."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .point_tables import NOMINAL, PIXEL, REFERENCE, SIGMA
from .tie_points import TiePoints
from .transform import Transform

# Columns of numbers, in their order; columns of text follow.
NUMBERS = (
    *REFERENCE,
    *NOMINAL,
    *PIXEL,
    "residual_px",
    "dx_px",
    "dy_px",
    "score",
    "forward_backward_error_px",
    *SIGMA,
)
TEXTS = ("role", "state")


def tie_point_columns(points: TiePoints, transform: Transform) -> dict[str, NDArray[Any]]:
    """Return the columns that files of tie points have, by name, shape (n,) each.

    Parameters
    ----------
    points
        The points.
    transform
        Transform that the residuals refer to, with the CRS of the map and the input's grid.
    """
    residual = points.residual_px(transform)
    sigma = np.sqrt(points.covariance_px2[:, [0, 1], [0, 1]])
    numbers = np.column_stack(
        [
            points.reference_xy,
            points.nominal_xy(transform),
            points.input_px,
            np.hypot(*residual.T),
            residual,
            points.score,
            points.forward_backward_error_px,
            sigma,
        ]
    )
    texts = (np.where(points.is_check, "check", "fit"), points.state)
    return dict(zip((*NUMBERS, *TEXTS), (*numbers.T, *texts), strict=True))


def tie_point_geodataframe(points: TiePoints, transform: Transform) -> Any:
    """Return tie points as a `geopandas.GeoDataFrame` (extra `geopandas`) in the reference's CRS.

    Geometries are the positions on the reference map; columns as `tie_point_columns`.

    Raises
    ------
    ImportError
        geopandas is not installed.
    """
    try:
        import geopandas
    except ImportError as error:
        raise ImportError(
            "a GeoDataFrame needs geopandas: pip install 'groundtie[geopandas]'"
        ) from error
    crs = None if transform.crs is None else transform.crs.to_wkt()
    places = geopandas.points_from_xy(*points.reference_xy.T)
    return geopandas.GeoDataFrame(tie_point_columns(points, transform), geometry=places, crs=crs)
