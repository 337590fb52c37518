"""The registered raster: on the reference's grid, on one like the input's, or untouched."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import ParameterError
from ..geometry.transform import FloatArray, Transform
from ..matching.surface_fit import AUTO
from ..progress import Progress
from ..rasters.atomic import Outputs
from ..rasters.delivery import warp_raster, write_with_geotransform
from ..rasters.grid import Grid, reproject
from ..rasters.pair import ImagePair
from ..rasters.target_grids import registered_grid

OUTPUT_GRIDS = ("reference", "input", "untouched")

# Pixels keep their places when only the geotransform changes, but for this error, in pixels.
_UNTOUCHED_TOLERANCE_PX = 0.05


@dataclass(frozen=True)
class RegisteredOutput:
    """How the registered raster is made.

    Parameters
    ----------
    path
        The GeoTIFF.
    grid
        "reference", "input" or "untouched" (see `OUTPUT_GRIDS`).
    resampling
        One of `warping.METHODS`.
    """

    path: Path
    grid: str
    resampling: str

    def write(
        self,
        pair: ImagePair,
        transform: Transform,
        outputs: Outputs,
        workers: int,
        progress: Progress,
    ) -> None:
        """Write the input of a pair as registered; it is resampled once, or not at all."""
        source, reference = pair.input.source, pair.reference.source.grid
        staged = outputs.stage(self.path)
        if self.grid == "untouched":
            moved = moved_grid(transform)
            write_with_geotransform(source, moved, staged, progress=progress)
            return
        if self.grid == "reference":
            warp_raster(
                source,
                transform,
                reference,
                staged,
                self.resampling,
                workers=workers,
                progress=progress,
            )
            return
        crs = source.grid.crs

        def px_to_own_map(px: FloatArray) -> FloatArray:
            return reproject(transform.inverse(px), transform.crs, crs)

        def own_map_to_px(xy: FloatArray) -> FloatArray:
            return transform(reproject(xy, crs, transform.crs))

        target = registered_grid(source.grid, px_to_own_map, crs)
        warp_raster(
            source,
            own_map_to_px,
            target,
            staged,
            self.resampling,
            workers=workers,
            progress=progress,
        )


def model_for_grid(model: str, output_grid: str) -> str:
    """Return the model that goes with an output grid; untouched pixels allow a shift only.

    Raises
    ------
    ParameterError
        They do not go together.
    """
    if output_grid != "untouched":
        return model
    if model not in (AUTO, "translation"):
        raise ParameterError(f"output_grid untouched goes with model translation, not {model}")
    return "translation"


def moved_grid(transform: Transform) -> Grid:
    """Return the input's grid with the geotransform that a pure shift gives it.

    Raises
    ------
    ParameterError
        The shift on the reference map is none in the input's own CRS.
    """
    grid = transform.input_grid
    px = grid.outline(3)
    xy = reproject(transform.inverse(px), transform.crs, grid.crs)
    shifts = xy - grid.pixel_to_map(px)
    dx, dy = shifts.mean(axis=0)
    if np.abs(shifts - [dx, dy]).max() > _UNTOUCHED_TOLERANCE_PX * min(grid.pixel_size):
        raise ParameterError(
            "output_grid untouched is not possible: the CRS of reference and input differ too much"
        )
    return grid.shifted(float(dx), float(dy))
