"""Errors of a transform at the points of a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import GeoreferencingError, TooFewPointsError, TransformFileError
from ..geometry.tie_point_files import read_tie_points
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..rasters.grid import reproject
from .point_errors import PointErrors


def measure_tie_points(
    path: Path, transform: Transform, max_error_px: float | None = None
) -> tuple[PointErrors, PointErrors]:
    """Measure a transform at its control points and at its test points, in a file of tie points.

    Control points have the role "fit", test points the role "check". Raises as `read_points`.
    """
    points = read_points(path, transform)
    test = _errors(transform, points, points.used & points.is_check)
    control = _errors(transform, points, points.used & ~points.is_check)
    return control, test.of_inliers(max_error_px)


def measure_check_points(path: Path, transform: Transform) -> PointErrors:
    """Measure a transform at independent points; raises as `read_points`.

    Where some points have the role "check", those without it do not take part.
    """
    points = read_points(path, transform)
    which = points.used & points.is_check
    return _errors(transform, points, which if which.any() else points.used)


def read_points(path: Path, transform: Transform) -> TiePoints:
    """Read tie points, or a CSV table of points, with reference positions in a transform's CRS.

    Parameters
    ----------
    path
        The file: see `geometry.tie_point_files`.
    transform
        Its map has a CSV table its reference positions on, if it names no CRS; its input grid
        locates the points in the input.

    Raises
    ------
    TransformFileError
        The file cannot be read or understood.
    TooFewPointsError
        It holds no points but rejected ones.
    GeoreferencingError
        Only one of the file and the transform has a CRS, or a position lies outside of it.
    """
    points = read_tie_points(path, transform.input_grid, table_crs=transform.crs)
    if not points.used.any():
        raise TooFewPointsError(f"{path} holds no points that are used")
    if not np.isfinite([*points.reference_xy, *points.input_px]).all():
        raise TransformFileError(f"{path} holds positions that are not finite")
    if (points.crs is None) != (transform.crs is None):
        raise GeoreferencingError(f"only one of {path} and the transform has a CRS")
    xy = reproject(points.reference_xy, points.crs, transform.crs)
    if not np.isfinite(xy).all():
        raise GeoreferencingError(f"{path} holds positions outside of a map's projection")
    return replace(points, reference_xy=xy, crs=transform.crs)


def _errors(transform: Transform, points: TiePoints, which: NDArray[np.bool_]) -> PointErrors:
    if not which.any():
        return PointErrors.none()
    return PointErrors.of(transform, points.reference_xy[which], points.input_px[which])
