"""Apply a stored transform, or stored tie points, to a raster."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..errors import GeoreferencingError, NoOverlapError, ParameterError, TransformFileError
from ..geometry.fitting import fit_model
from ..geometry.models import KINDS, Model
from ..geometry.tie_point_files import StoredTiePoints, read_tie_points
from ..geometry.transform import Transform, load_transform
from ..kinds import Choice, Distance, FileIn, RasterIn
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.delivery import warp_raster
from ..rasters.grid import Grid, apply_affine, reproject
from ..rasters.reading import RasterSource, open_raster
from ..rasters.target_grids import covering_grid, registered_grid
from .common import Input, Output, Resampling, Workers, worker_count

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
    """

    points: int
    rmse_px: float
    check_points: int
    check_rmse_px: float | None


@dataclass(frozen=True)
class WarpResult:
    """What `warp` made."""

    output: Path
    grid: Grid
    transform: Transform
    fit: TiePointFit | None

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "output": str(self.output),
            "width": self.grid.width,
            "height": self.grid.height,
            "pixel_size": list(self.grid.pixel_size),
            "crs": _crs_name(self.grid),
            "model": self.transform.model.kind,
            "tie_points": None if self.fit is None else vars(self.fit),
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        grid = self.grid
        size = " × ".join(f"{side:g}" for side in grid.pixel_size)
        lines = [
            f"wrote {self.output}",
            f"grid: {grid.width} × {grid.height} pixels of {size}, {_crs_name(grid)}",
            f"model: {self.transform.model.kind}",
        ]
        if self.fit is not None:
            lines.append(
                f"fitted to {self.fit.points} tie points with residuals of "
                f"{self.fit.rmse_px:.2f} px (RMSE)"
            )
            if self.fit.check_rmse_px is not None:
                lines.append(
                    f"error at {self.fit.check_points} check points: "
                    f"{self.fit.check_rmse_px:.2f} px (RMSE)"
                )
        return lines


@tool(
    title="Warp a raster",
    group="Apply",
    outputs=(
        ResultOutput("WIDTH", "Width of the result in pixels", "width"),
        ResultOutput("HEIGHT", "Height of the result in pixels", "height"),
    ),
)
def warp(
    input: Input,
    output: Output,
    transform: Annotated[
        Path,
        FileIn(
            label="Transform or tie points",
            help="A transform (.json) or tie points (.gpkg, .geojson, .csv, or .points of the "
            "QGIS Georeferencer) of this raster or of another one of the same scene.",
            suffixes=(".json", ".gpkg", ".geojson", ".csv", ".points"),
            option=True,
        ),
    ],
    reference: Annotated[
        Path | None,
        RasterIn(
            label="Reference image",
            help="The result gets exactly the grid of this raster, so that the two stack. By "
            "default the result covers all of the input with pixels of the input's size.",
        ),
    ] = None,
    pixel_size: Annotated[
        float | None,
        Distance(
            label="Pixel size",
            help="Pixel size of the result, where it does not get the reference's grid.",
            minimum=1e-6,
        ),
    ] = None,
    model: Annotated[
        str,
        Choice(
            label="Model",
            help="What is fitted to tie points; a stored transform has a model already.",
            choices=KINDS,
        ),
    ] = "affine",
    resampling: Resampling = "cubic",
    workers: Workers = None,
    progress: Progress = SILENT,
) -> WarpResult:
    """Apply a stored transform or tie points to a raster.

    The raster may be the one that was registered, or another one of the same scene: other bands,
    another pixel size, another date on the same grid. Rasters with georeferencing are located by
    it; a raster without it must have the size of the one that was registered. All bands are
    resampled once, from the original pixels. Tie points are fitted as they are: those that are
    marked as rejected or as check points are left out.
    """
    if reference is not None and pixel_size is not None:
        raise ParameterError("give either a reference, which has a pixel size, or a pixel size")
    with open_raster(input) as source:
        found, fit = _load(transform, model, source)
        found = _transform_of(found, source, transform)
        target = _target_grid(found, reference, pixel_size)
        with Outputs() as outputs:
            warp_raster(
                source,
                lambda xy: found(reproject(xy, target.crs, found.crs)),
                target,
                outputs.stage(output),
                resampling,
                workers=worker_count(workers),
                progress=progress,
            )
    return WarpResult(output, target, found, fit)


def _load(path: Path, model: str, source: RasterSource) -> tuple[Transform, TiePointFit | None]:
    if path.suffix.lower() == ".json":
        return load_transform(path), None
    points = read_tie_points(path, source.grid)
    if points.crs is None and source.grid.crs is not None:
        raise TransformFileError(f"{path} does not tell the CRS of its map positions")
    found = Transform(_fit(points, model, source.grid), points.crs, source.grid)
    return found, _assess(found, points)


def _fit(points: StoredTiePoints, kind: str, input_grid: Grid) -> Model:
    """Fit a model in metres, so that rigid ones preserve shapes also on maps in degrees."""
    claimed = Transform.as_claimed(points.crs, input_grid).claimed_xy(points.input_px)
    taken = points.used & ~points.is_check
    centre = points.reference_xy[taken].mean(axis=0) if taken.any() else np.zeros(2)
    here = Grid(Affine.translation(*(centre - 0.5)), points.crs, 1, 1)
    width, height = here.metres_per_unit
    metres = Affine(1 / width, 0, centre[0], 0, 1 / height, centre[1])
    xy, claimed_xy = (
        apply_affine(~metres, positions[taken]) for positions in (points.reference_xy, claimed)
    )
    return fit_model(kind, xy, claimed_xy).on_map(metres)


def _assess(found: Transform, points: StoredTiePoints) -> TiePointFit:
    squared = np.sum((points.input_px - found(points.reference_xy)) ** 2, axis=1)
    fitted, check = points.used & ~points.is_check, points.used & points.is_check
    return TiePointFit(
        points=int(fitted.sum()),
        rmse_px=float(np.sqrt(squared[fitted].mean())),
        check_points=int(check.sum()),
        check_rmse_px=float(np.sqrt(squared[check].mean())) if check.any() else None,
    )


def _transform_of(found: Transform, source: RasterSource, path: Path) -> Transform:
    """Return the transform for the raster, which need not be the one that was registered."""
    own, registered = source.grid, found.input_grid
    if own.is_georeferenced and registered.is_georeferenced:
        if (own.crs is None) != (registered.crs is None):
            raise GeoreferencingError(f"only one of {source.path} and {path} has a CRS")
        seen = registered.map_to_pixel(
            reproject(own.pixel_to_map(own.outline()), own.crs, registered.crs)
        )
        if not _boxes_meet(seen, registered):
            raise NoOverlapError(f"{source.path} does not lie where {path} was made for")
        return Transform(found.model, found.crs, own)
    if (own.width, own.height) != (registered.width, registered.height):
        raise GeoreferencingError(
            f"{source.path} has {own.width} × {own.height} pixels, but {path} was made for "
            f"{registered.width} × {registered.height}, and not both are georeferenced"
        )
    return found


def _boxes_meet(px: FloatArray, grid: Grid) -> bool:
    px = px[np.isfinite(px).all(axis=1)]
    size = np.array([grid.width, grid.height]) - 0.5
    return len(px) > 0 and bool(np.all((px.max(axis=0) > -0.5) & (px.min(axis=0) < size)))


def _target_grid(found: Transform, reference: Path | None, pixel_size: float | None) -> Grid:
    if reference is None:
        return registered_grid(found.input_grid, found.inverse, found.crs, pixel_size)
    with open_raster(reference) as source:
        grid = source.grid
    if (grid.crs is None) != (found.crs is None):
        raise GeoreferencingError(f"only one of {reference} and the transform has a CRS")
    footprint = reproject(found.inverse(found.input_grid.outline()), found.crs, grid.crs)
    covering_grid(grid, footprint, within=True)
    return grid


def _crs_name(grid: Grid) -> str:
    return "no CRS" if grid.crs is None else str(grid.crs.to_string())
