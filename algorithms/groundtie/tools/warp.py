"""Apply a stored transform, or stored tie points, to a raster."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from ..context import threads
from ..declaration import tool
from ..errors import ParameterError
from ..geometry.models import KINDS
from ..geometry.tie_point_files import SUFFIXES
from ..geometry.transform import Transform
from ..kinds import Choice, FileIn
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.grid import Grid, require_both_or_none
from ..rasters.reading import open_raster
from ..rasters.target_grids import covering_grid, registered_grid
from ..rasters.vrt import SUFFIX as VRT
from ..registration.registered_output import REFERENCE_GRID, RegisteredOutput
from ..registration.stored_transform import TiePointFit, load_stored, transform_of
from .parameters import general
from .results import SIZE_OUTPUTS, WrittenRaster


@dataclass(frozen=True)
class WarpResult(WrittenRaster):
    """What `warp` made: the raster, the transform, and how that fits tie points."""

    transform: Transform
    fit: TiePointFit | None

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        fit = None if self.fit is None else vars(self.fit)
        return {**super().summary(), "model": self.transform.model.kind, "tie_points": fit}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        lines = [*super().lines(), f"model: {self.transform.model.kind}"]
        return lines if self.fit is None else [*lines, *self.fit.lines()]


@tool(
    title="Warp a raster",
    group="Apply",
    outputs=SIZE_OUTPUTS,
)
def warp(
    input: general.Input,
    output: general.Output,
    transform: Annotated[
        Path,
        FileIn(
            label="Transform or tie points",
            help="A transform (.json) or tie points (.gpkg, .geojson, .csv, or .points of the "
            "QGIS Georeferencer) of this raster or of another one of the same scene.",
            suffixes=(".json", *SUFFIXES),
            option=True,
        ),
    ],
    reference: Annotated[
        Path | None, general.like_reference("input with pixels of the input's size")
    ] = None,
    pixel_size: Annotated[
        float | None,
        general.pixel_size_of_result(", where it does not get the reference's grid"),
    ] = None,
    model: Annotated[
        str | None,
        Choice(
            help="What is fitted to tie points, affine by default; a stored transform has a model "
            "already.",
            choices=KINDS,
        ),
    ] = None,
    resampling: general.Resampling = "cubic",
    workers: general.Workers = None,
    progress: Progress = SILENT,
) -> WarpResult:
    """Apply a stored transform or tie points to a raster.

    The raster may be the one that was registered, or another one of the same scene: other bands,
    another pixel size, another date on the same grid. Rasters with georeferencing are located by
    it; a raster without it must have the size of the one that was registered. All bands are
    resampled once, from the original pixels. Tie points are fitted as they are: those that are
    marked as rejected or as check points are left out.
    """
    is_vrt = output.suffix.lower() == VRT
    if is_vrt and (reference is not None or pixel_size is not None):
        raise ParameterError("a .vrt has the input's own pixels: no reference and no pixel size")
    if reference is not None and pixel_size is not None:
        raise ParameterError("give either a reference, which has a pixel size, or a pixel size")
    with open_raster(input) as source:
        found, fit = load_stored(transform, model, source)
        found = transform_of(found, source, transform)
        # A .vrt has but the pixels of the input.
        grid = found.input_grid if is_vrt else _target_grid(found, reference, pixel_size)
        made = RegisteredOutput(output, REFERENCE_GRID, resampling)
        with threads(workers, progress) as context, Outputs() as outputs:
            target = made.write(source, grid, found, outputs, context)
    return WarpResult(output, target, found, fit)


def _target_grid(found: Transform, reference: Path | None, pixel_size: float | None) -> Grid:
    if reference is None:
        return registered_grid(found.input_grid, found.inverse, found.crs, pixel_size)
    with open_raster(reference) as source:
        grid = source.grid
    require_both_or_none(grid.crs, found.crs, f"{reference} and the transform")
    footprint = grid.to_own_map(found.inverse(found.input_grid.outline()), found.crs)
    covering_grid(grid, footprint, within=True)
    return grid
