"""Which grid a registered raster gets, when it does not get the reference's as it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..errors import GridSizeError, NoOverlapError
from .grid import Grid

FloatArray = NDArray[np.float64]

# A footprint that reaches into a further row or column by less than this does not need it.
_TOLERANCE_PX = 1e-3

# GDAL counts the pixels of a side in 32 bits.
_MOST_PX = 2.0**31 - 1

# A registered raster is larger than its centre's pixels say by what its model bends, in either
# direction: the largest scale that is searched for is 4, either way, so 16 is none's.
_LARGEST_STRETCH = 16.0


def covering_grid(lattice: Grid, xy: FloatArray, *, within: bool = False) -> Grid:
    """Return the part of a lattice, continued beyond its grid, that covers a footprint.

    Parameters
    ----------
    lattice
        Gives CRS, pixel size and where the pixels' borders are.
    xy
        Map positions in the lattice's CRS, shape (n, 2); those that are not finite are left out.
    within
        Cut the result to the grid of the lattice.

    Raises
    ------
    NoOverlapError
        Nothing is left.
    GridSizeError
        It would have more pixels a side than rasters can have.
    """
    px = lattice.map_to_pixel(xy[np.isfinite(xy).all(axis=1)])
    if len(px) == 0:
        raise NoOverlapError("the footprint of the image lies outside of the map's projection")
    if not (np.abs(px) < _MOST_PX).all() and not within:
        raise GridSizeError("the result would have more pixels a side than a raster can have")
    px = np.clip(px, -_MOST_PX, _MOST_PX)
    low = np.floor(px.min(axis=0) + 0.5 + _TOLERANCE_PX).astype(int)
    high = np.ceil(px.max(axis=0) + 0.5 - _TOLERANCE_PX).astype(int)
    if within:
        size = (lattice.width, lattice.height)
        low, high = np.clip(low, 0, size), np.clip(high, 0, size)
    if np.any(high <= low):
        raise NoOverlapError("the footprint of the image does not lie on the grid")
    width, height = high - low
    return lattice.window(int(low[0]), int(low[1]), int(width), int(height))


def registered_grid(
    input_grid: Grid,
    px_to_map: Callable[[FloatArray], FloatArray],
    crs: CRS | None,
    pixel_size_m: float | None = None,
) -> Grid:
    """Return a grid for a registered raster that covers all of it.

    In the input's own CRS and without another pixel size it is the input's own lattice, so that
    the result lines up with the input's neighbours. Otherwise it is north-up, with square pixels
    as large as the input's and pixel borders at multiples of their size.

    Parameters
    ----------
    input_grid
        The input's grid.
    px_to_map
        Takes input pixels (col, row), shape (n, 2), to map positions in `crs`.
    crs
        CRS of the result.
    pixel_size_m
        Pixel size in metres (in pixels without georeferencing).

    Raises
    ------
    NoOverlapError
        The raster lies outside of the domain of the CRS.
    GridSizeError
        The transform bends the raster out of all proportion, or the pixels are too many.
    """
    footprint = px_to_map(input_grid.outline())
    _require_size(input_grid, px_to_map, footprint)
    if pixel_size_m is None and crs == input_grid.crs:
        return covering_grid(input_grid, footprint)
    if not input_grid.is_georeferenced and crs is None:
        return covering_grid(input_grid.scaled(pixel_size_m or 1.0), footprint)
    corners = _centre_pixel(input_grid, px_to_map)
    centre = corners.mean(axis=0)
    if not np.isfinite(centre).all():
        raise NoOverlapError("the footprint of the image lies outside of the map's projection")
    # Its only pixel lies around the centre.
    here = Grid(Affine.translation(*(centre - 0.5)), crs, 1, 1)
    metres = np.array(here.metres_per_unit)
    if pixel_size_m is None:
        along, across = corners[2] - corners[0], corners[3] - corners[1]
        area = abs(along[0] * across[1] - along[1] * across[0]) / 2
        pixel_size_m = float(np.sqrt(area * metres.prod()))
    width, height = pixel_size_m / metres
    return covering_grid(Grid(Affine(width, 0, 0, 0, -height, 0), crs, 1, 1), footprint)


def _centre_pixel(grid: Grid, px_to_map: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the map positions of the corners of the pixel at a grid's centre, shape (4, 2)."""
    around = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    return px_to_map(around + grid.centre_px)


def _require_size(
    grid: Grid, px_to_map: Callable[[FloatArray], FloatArray], footprint: FloatArray
) -> None:
    """Raise if a raster becomes far larger than its pixels: its transform is not for it."""
    pixel = _centre_pixel(grid, px_to_map)
    extent = footprint[np.isfinite(footprint).all(axis=1)]
    if not len(extent) or not np.isfinite(pixel).all():
        return  # it lies outside of the projection, as is told elsewhere
    size = np.hypot(grid.width, grid.height) * np.hypot(*np.ptp(pixel, axis=0))
    extended = np.hypot(*np.ptp(extent, axis=0))
    if not extended <= _LARGEST_STRETCH * size:
        raise GridSizeError(
            f"the transform would stretch the raster {extended / size:.2g} times: it is damaged, "
            "or not for this raster"
        )
