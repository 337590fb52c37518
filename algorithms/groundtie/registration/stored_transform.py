"""Stored transforms and tie points, for rasters that need not be those they were made with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..errors import GeoreferencingError, NoOverlapError, TransformFileError
from ..geometry.fitting import fit_model
from ..geometry.models import Model
from ..geometry.tie_point_files import EDITED, read_tie_points
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform, load_transform
from ..rasters.grid import Grid, apply_affine, reproject
from ..rasters.reading import RasterSource

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class TiePointFit:
    """How the transform that was fitted to tie points fits them.

    Parameters
    ----------
    points
        Number of points that it was fitted to.
    rmse_px
        Root mean square of their residuals in input pixels: no measure of accuracy.
    check_points
        Number of points that were held out.
    check_rmse_px
        Root mean square of their residuals; None if there are none.
    edited
        Number of points whose lines were moved or drawn by a person.
    """

    points: int
    rmse_px: float
    check_points: int
    check_rmse_px: float | None
    edited: int = 0

    def lines(self) -> list[str]:
        """Return the fit as lines of text."""
        residuals = f"residuals of {self.rmse_px:.2f} px (RMSE)"
        lines = [f"fitted to {self.points} tie points with {residuals}"]
        if self.check_rmse_px is not None:
            error = f"{self.check_rmse_px:.2f} px (RMSE)"
            lines.append(f"error at {self.check_points} check points: {error}")
        if self.edited:
            lines.append(
                f"edited by hand: {self.edited} points; their lines count, not their columns"
            )
        return lines


def load_stored(
    path: Path, model: str, source: RasterSource
) -> tuple[Transform, TiePointFit | None]:
    """Return a stored transform, or one that is fitted to stored tie points and how it fits.

    Parameters
    ----------
    path
        A `.json` with a transform, or a file of tie points.
    model
        The kind of model that is fitted to tie points.
    source
        The raster that tie points are meant for.

    Raises
    ------
    TransformFileError
        The file cannot be read or understood.
    TooFewPointsError
        There are too few tie points for the model.
    """
    if path.suffix.lower() == ".json":
        return load_transform(path), None
    points = read_tie_points(path, source.grid)
    if points.crs is None and source.grid.crs is not None:
        raise TransformFileError(f"{path} does not state the CRS of its map positions")
    found = Transform(_fit(points, model, source.grid), points.crs, source.grid)
    return found, _assess(found, points)


def _fit(points: TiePoints, kind: str, input_grid: Grid) -> Model:
    """Fit a model in metres, so that rigid ones preserve shapes also on maps in degrees."""
    nominal = Transform.nominal(points.crs, input_grid).nominal_xy(points.input_px)
    taken = points.used & ~points.is_check
    centre = points.reference_xy[taken].mean(axis=0) if taken.any() else np.zeros(2)
    here = Grid(Affine.translation(*(centre - 0.5)), points.crs, 1, 1)
    width, height = here.metres_per_unit
    metres = Affine(1 / width, 0, centre[0], 0, 1 / height, centre[1])
    xy, nominal_xy = (
        apply_affine(~metres, positions[taken]) for positions in (points.reference_xy, nominal)
    )
    return fit_model(kind, xy, nominal_xy).on_map(metres)


def _assess(found: Transform, points: TiePoints) -> TiePointFit:
    squared = np.sum(points.residual_px(found) ** 2, axis=1)
    fitted, check = points.used & ~points.is_check, points.used & points.is_check
    return TiePointFit(
        points=int(fitted.sum()),
        rmse_px=float(np.sqrt(squared[fitted].mean())),
        check_points=int(check.sum()),
        check_rmse_px=float(np.sqrt(squared[check].mean())) if check.any() else None,
        edited=int(np.sum(points.more.get(EDITED, 0.0))),
    )


def transform_of(found: Transform, source: RasterSource, name: object) -> Transform:
    """Return a transform for a raster, which need not be the one that was registered.

    Parameters
    ----------
    found
        The transform.
    source
        The raster.
    name
        What the transform is called in messages: the file that it comes from.

    Raises
    ------
    GeoreferencingError
        The raster cannot be located: it is not georeferenced and of another size, or only one
        has a CRS.
    NoOverlapError
        It lies elsewhere.
    """
    own, registered = source.grid, found.input_grid
    if own.is_georeferenced and registered.is_georeferenced:
        if (own.crs is None) != (registered.crs is None):
            raise GeoreferencingError(f"only one of {source.path} and {name} has a CRS")
        seen = registered.map_to_pixel(
            reproject(own.pixel_to_map(own.outline()), own.crs, registered.crs)
        )
        if not _boxes_meet(seen, registered):
            raise NoOverlapError(f"{source.path} does not lie where {name} was made for")
        return Transform(found.model, found.crs, own)
    if (own.width, own.height) != (registered.width, registered.height):
        raise GeoreferencingError(
            f"{source.path} has {own.width} × {own.height} pixels, but {name} was made for "
            f"{registered.width} × {registered.height}, and not both are georeferenced"
        )
    return found


def _boxes_meet(px: FloatArray, grid: Grid) -> bool:
    px = px[np.isfinite(px).all(axis=1)]
    size = np.array([grid.width, grid.height]) - 0.5
    return len(px) > 0 and bool(np.all((px.max(axis=0) > -0.5) & (px.min(axis=0) < size)))
