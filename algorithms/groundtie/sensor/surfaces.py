"""Values of a raster of heights, of any CRS, at longitudes and latitudes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..errors import GeoreferencingError
from ..rasters.grid import reproject
from ..rasters.reading import RasterSource
from ..rasters.surfaces import TOLERANCE_PX, RasterSurface, surface_around
from .smooth_map import smooth_map

FloatArray = NDArray[np.float64]

LON_LAT = CRS.from_epsg(4326)

# Grids of the whole Earth leave this much open where they meet themselves.
WHOLE_PX = 1.0


def surface_over(source: RasterSource, lon_lat: FloatArray, margin_px: int = 2) -> RasterSurface:
    """Return the surface of a raster over a region.

    Parameters
    ----------
    source
        The raster.
    lon_lat
        Places of the region, (n, 2): those in between are asked for, too.
    margin_px
        How far around the region is read for filling voids.

    Raises
    ------
    GeoreferencingError
        The raster has no CRS.
    NoOverlapError, RasterContentError
        See `surface_around`.
    """
    grid = source.grid
    if grid.crs is None:
        raise GeoreferencingError(f"{source.path} has no CRS")

    def exact(places: FloatArray) -> FloatArray:
        xy = reproject(places, LON_LAT, grid.crs)
        return grid.map_to_pixel(np.where(np.isfinite(xy), xy, np.nan))

    surface = surface_around(source, exact, lon_lat, margin_px)
    corner, opposite = lon_lat.min(axis=0), lon_lat.max(axis=0)
    around = 0.05 * (opposite - corner) + 1e-4
    fast = smooth_map(exact, corner - around, opposite + around, TOLERANCE_PX)
    return replace(surface, to_px=fast)
