"""Apply a stored transform, or stored tie points, to a raster."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..errors import GeoreferencingError, ParameterError
from ..geometry.models import KINDS
from ..geometry.transform import Transform
from ..kinds import Choice, Distance, FileIn, RasterIn
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.delivery import warp_raster
from ..rasters.grid import Grid, reproject
from ..rasters.reading import open_raster
from ..rasters.target_grids import covering_grid, registered_grid
from ..registration.stored_transform import TiePointFit, load_stored, transform_of
from .common import Input, Output, Resampling, Workers, crs_name, worker_count

FloatArray = NDArray[np.float64]


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
            "crs": crs_name(self.grid),
            "model": self.transform.model.kind,
            "tie_points": None if self.fit is None else vars(self.fit),
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        grid = self.grid
        size = " × ".join(f"{side:g}" for side in grid.pixel_size)
        lines = [
            f"wrote {self.output}",
            f"grid: {grid.width} × {grid.height} pixels of {size}, {crs_name(grid)}",
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
        found, fit = load_stored(transform, model, source)
        found = transform_of(found, source, transform)
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
