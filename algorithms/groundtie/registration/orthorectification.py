"""An image with RPCs, projected onto a map by them and a terrain model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..context import Context
from ..errors import GeoreferencingError, NoOverlapError
from ..rasters.delivery import warp_raster
from ..rasters.grid import FloatArray, Grid, crs_name, near_longitude
from ..rasters.target_grids import covering_grid, registered_grid
from ..sensor.dense import DenseOrientation
from ..sensor.orientation import Orientation
from .sensor_input import OrientedImage

# Most places along a side of an image at which its border is projected: more than a sensor's line
# has pixels, but few enough that a file of a few bytes cannot exhaust the memory.
_MOST_ALONG = 100_000


def write_orthoimage(
    image: OrientedImage,
    path: Path,
    context: Context,
    grid: Grid | None = None,
    pixel_size: float | None = None,
    resampling: str = "cubic",
) -> Grid:
    """Write an orthoimage, and return its grid.

    Parameters
    ----------
    image
        The image, and how it sees the ground.
    path
        The GeoTIFF; see `atomic.Outputs.stage`.
    context
        Threads and progress.
    grid
        The grid of the result; None: one that covers the image, in the orientation's CRS.
    pixel_size
        Pixel size of that grid, in metres; None: that of the image on level ground.
    resampling
        One of `warping.METHODS`.

    Raises
    ------
    NoOverlapError
        The image shows nothing of the grid that was given, or no height is known there.
    GeoreferencingError
        Without a grid: the image lies across the edge of its map.
    """
    source, by = image.source, image.orientation
    if grid is None:
        # Georeferencing other than the RPCs is ignored.
        pixels = source.grid.on_own_pixels()
        # Relief may displace any pixel of the border outwards.
        border = pixels.outline(min(max(pixels.size), _MOST_ALONG))
        if _is_torn(by, border):
            raise GeoreferencingError(
                f"{source.path} lies at both edges of the map {crs_name(by.crs)}, as across the "
                "antimeridian: take another CRS, such as that of its UTM zone"
            )
        # A wall or a steep slope must not determine the pixel size.
        grid = registered_grid(
            pixels, by.to_level_map, by.crs, pixel_size, by.to_nominal_map(border)
        )
    else:
        middle = grid.pixel_to_map([grid.centre_px])[0, 0]
        outline = near_longitude(by.to_nominal_map(source.grid.outline()), middle, by.crs)
        covering_grid(grid, outline, within=True)
    dense, workers, progress = DenseOrientation(by), context.workers, context.progress
    if not warp_raster(source, dense, grid, path, resampling, workers=workers, progress=progress):
        raise NoOverlapError(
            f"the orthoimage would hold no data: where its grid shows {source.path}, the height of "
            "the ground is not known, or the RPCs do not hold there"
        )
    return grid


def _is_torn(by: Orientation, border: FloatArray) -> bool:
    """Return whether the border of an image, pixels (n, 2), lies at both edges of a map.

    Midway between two pixels, positions are midway on the map, too, unless its edge lies between:
    then they are beside either of the two, half of their distance off.
    """
    xy = by.to_level_map(border)
    ends = np.stack([xy.argmin(axis=0), xy.argmax(axis=0)])
    middle = by.to_level_map(border[ends].mean(axis=0))
    apart, off = np.ptp(xy[ends], axis=0), middle - xy[ends].mean(axis=0)
    return bool((np.hypot(*off.T) > np.hypot(*apart.T) / 4).any())
