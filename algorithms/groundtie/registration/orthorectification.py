"""An image with RPCs, projected onto a map by them and a terrain model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..context import Context
from ..rasters.atomic import Outputs
from ..rasters.delivery import warp_raster
from ..rasters.grid import Grid
from ..rasters.reading import RasterSource
from ..rasters.target_grids import covering_grid, registered_grid
from ..sensor.dense import DenseOrientation
from ..sensor.orientation import Orientation


@dataclass(frozen=True)
class Orthorectification:
    """How an image is orthorectified.

    Parameters
    ----------
    source
        The image, open.
    orientation
        How it sees the ground.
    grid
        The grid of the result; None: one that covers the image, in the orientation's CRS.
    pixel_size
        Of that grid, in its unit; None: that of the image on the ground.
    """

    source: RasterSource
    orientation: Orientation
    grid: Grid | None = None
    pixel_size: float | None = None

    @property
    def target(self) -> Grid:
        """The grid of the result.

        Raises
        ------
        NoOverlapError
            The image shows nothing of the grid that was given.
        """
        image, by = self.source.grid, self.orientation
        if self.grid is None:
            return registered_grid(image, by.to_nominal_map, by.crs, self.pixel_size)
        covering_grid(self.grid, by.to_nominal_map(image.outline()), within=True)
        return self.grid

    def write(
        self,
        output: Path,
        outputs: Outputs,
        context: Context,
        resampling: str = "cubic",
    ) -> Grid:
        """Write the orthoimage, and return its grid.

        Parameters
        ----------
        output
            The GeoTIFF.
        outputs
            Where it is staged.
        context
            Threads and progress.
        resampling
            One of `warping.METHODS`.
        """
        target = self.target
        warp_raster(
            self.source,
            DenseOrientation(self.orientation),
            target,
            outputs.stage(output),
            resampling,
            workers=context.workers,
            progress=context.progress,
        )
        return target
