"""The registered raster: on the reference's grid, on one like the input's, or untouched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..context import Context
from ..errors import NoOverlapError, ParameterError
from ..geometry.transform import FloatArray, Transform
from ..kinds import AUTO
from ..rasters.atomic import Outputs
from ..rasters.delivery import warp_raster, write_with_geotransform
from ..rasters.grid import Grid, PointFunction, mesh, near_longitude, reproject
from ..rasters.reading import Mask, RasterSource
from ..rasters.target_grids import registered_grid
from ..rasters.vrt import SUFFIX as VRT
from ..rasters.vrt import write_vrt

REFERENCE_GRID, UNTOUCHED = "reference", "untouched"
OUTPUT_GRIDS = (REFERENCE_GRID, "input", UNTOUCHED)

# Models that bend ever more where no point constrains them.
_BENDING = ("polynomial2", "polynomial3", "tps")

# A smaller share outside of the overlap is not reported: it would read as 0 %.
_LEAST_BEYOND = 0.005

# Places per side of a raster for estimating its share in the overlap.
_PLACES = 101

# Largest error, in pixels, of a correction that only changes the geotransform.
UNTOUCHED_TOLERANCE_PX = 0.05


@dataclass(frozen=True)
class RegisteredOutput:
    """How the registered raster is made.

    Parameters
    ----------
    path
        The GeoTIFF; for untouched pixels a `.vrt`, too.
    grid
        "reference", "input" or "untouched" (see `OUTPUT_GRIDS`).
    resampling
        One of `warping.METHODS`.
    """

    path: Path
    grid: str
    resampling: str = "cubic"

    def write(
        self,
        source: RasterSource,
        reference: Grid,
        transform: Transform,
        outputs: Outputs,
        context: Context,
    ) -> Grid:
        """Write a raster as registered, resampled once or not at all, and return its grid.

        Parameters
        ----------
        source
            The raster that the transform is for.
        reference
            The reference's own grid; its CRS need not be that of the transform.
        transform
            From map positions to the raster's pixels.
        outputs
            Where the file is staged.
        context
            Threads and progress.

        Raises
        ------
        NoOverlapError
            No pixel of a raster that is resampled would be valid; nothing of it is kept.
        """
        staged, progress = outputs.stage(self.path), context.progress
        if grid_of_output(self.path, self.grid) == UNTOUCHED:
            moved = moved_grid(transform)
            if self.path.suffix.lower() == VRT:
                write_vrt(source, moved, staged)
            else:
                write_with_geotransform(source, moved, staged, progress=progress)
            return moved
        to_px, target = resampled_onto(self.grid, reference, transform)
        method, workers = self.resampling, context.workers
        if not warp_raster(
            source, to_px, target, staged, method, workers=workers, progress=progress
        ):
            outputs.withdraw(self.path)
            raise NoOverlapError(
                f"the registered raster would hold no data: {source.path} has no valid pixels "
                "where its grid lies, or fewer than make one of its pixels"
            )
        return target


@dataclass(frozen=True)
class BeyondOverlap:
    """The part of an image, registered as a whole, where nothing has checked its transform.

    Parameters
    ----------
    share
        Share of its pixels outside of the overlap.
    model
        The kind of the transform's model.
    """

    share: float
    model: str

    @classmethod
    def of(
        cls, grid: str, transform: Transform, is_checked: Callable[[FloatArray], Mask]
    ) -> BeyondOverlap | None:
        """Return the part of a transform's raster that is written where nothing has checked it.

        None: there is no such part.

        Parameters
        ----------
        grid
            The grid that the raster is written on, one of `OUTPUT_GRIDS`.
        transform
            The transform.
        is_checked
            Returns which positions on the reference's map, (n, 2), lie where it was checked.
        """
        if grid == REFERENCE_GRID:
            return None
        # In the middles of equal parts: places on the border would count it as an area.
        along = (np.arange(_PLACES) + 0.5) / _PLACES
        px = mesh(*(along * side - 0.5 for side in transform.input_grid.size))
        xy = transform.inverse(px)
        share = 1 - float(is_checked(xy).mean())
        return cls(share, transform.model.kind) if share >= _LEAST_BEYOND else None

    @property
    def bends(self) -> bool:
        """Whether the model bends, and so is unknown beyond its points."""
        return self.model in _BENDING

    def summary(self) -> dict[str, Any]:
        """Return it as values that JSON can carry."""
        return {"share": self.share, "model_bends": self.bends}

    def line(self) -> str:
        """Return it as a line of text."""
        line = (
            f"outside of the overlap: {self.share:.0%} of the registered image, where nothing has "
            "checked the transform"
        )
        if not self.bends:
            return line
        return f"{line}; warning: {self.model} bends, and may be off there by any amount"


def resampled_onto(grid: str, reference: Grid, transform: Transform) -> tuple[PointFunction, Grid]:
    """Return the function from a registered raster's map positions to pixels, and its grid.

    Parameters
    ----------
    grid
        "reference" or "input".
    reference, transform
        As `RegisteredOutput.write` takes them.
    """
    if grid == REFERENCE_GRID:
        return transform.of_map(reference.crs), reference
    # The raster may lack the georeferencing that the transform's own image had.
    own = transform.input_grid
    return transform.of_map(own.crs), registered_grid(
        own, lambda px: _registered_px(px, own, transform), own.crs
    )


def _registered_px(px: FloatArray, own: Grid, transform: Transform) -> FloatArray:
    """Return the right positions of an input's pixels, shape (n, 2), on its own map.

    Longitudes stay near those of the input: borders of a global image may move beyond ±180°.
    """
    xy = reproject(transform.inverse(px), transform.crs, own.crs)
    return near_longitude(xy, own.pixel_to_map(px)[:, :1], own.crs)


def grid_of_output(output: Path | None, asked: str) -> str:
    """Return the grid of an output, one of `OUTPUT_GRIDS`: a `.vrt` holds untouched pixels."""
    return UNTOUCHED if output is not None and output.suffix.lower() == VRT else asked


def model_for_grid(model: str, output_grid: str) -> str:
    """Return the model that goes with an output grid; untouched pixels allow a shift only.

    Raises
    ------
    ParameterError
        Model and grid do not go together.
    """
    if output_grid != UNTOUCHED:
        return model
    if model not in (AUTO, "translation"):
        raise ParameterError(f"untouched pixels go with model translation, not {model}")
    return "translation"


def moved_grid(transform: Transform) -> Grid:
    """Return the input's grid with the geotransform that a pure shift gives it.

    Raises
    ------
    ParameterError
        The shift on the reference map is no shift in the input's own CRS.
    """
    grid = transform.input_grid
    px = grid.outline(3)
    shifts = _registered_px(px, grid, transform) - grid.pixel_to_map(px)
    dx, dy = shifts.mean(axis=0)
    if np.abs(shifts - [dx, dy]).max() > UNTOUCHED_TOLERANCE_PX * min(grid.pixel_size):
        raise ParameterError(
            "pixels cannot stay untouched: the correction is no shift in the input's own CRS"
        )
    return grid.shifted(float(dx), float(dy))
