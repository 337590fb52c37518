"""Grids for registered rasters that do not use the reference's grid as it is."""

from __future__ import annotations

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..errors import GridSizeError, NoOverlapError
from .grid import (
    MOST_PX,
    POSITION_ERROR_PX,
    FloatArray,
    Grid,
    PointFunction,
    finite,
    full_turn,
    is_invertible,
    metres_per_unit_at,
)
from .tiling import require_workable
from .windows import Window

# Largest ratio of the diagonal, in pixels, of a registered raster to that of the input. The largest
# scale that is searched for is 4, and a projection may double that again.
_LARGEST_STRETCH = 16.0


def covering_grid(grid: Grid, xy: FloatArray, *, within: bool = False) -> Grid:
    """Return the part of a grid, extended beyond its borders if needed, that covers a footprint.

    Parameters
    ----------
    grid
        Grid that gives CRS, pixel size and alignment of the pixels.
    xy
        Map positions in the grid's CRS, shape (n, 2); non-finite ones are ignored.
    within
        Whether the result is cropped to the grid.

    Raises
    ------
    NoOverlapError
        No pixel is left.
    GridSizeError
        The result would have more pixels than a raster can have, or than can be processed.
    """
    xy = finite(xy)
    px = grid.map_to_pixel(xy)
    if len(px) == 0:
        raise NoOverlapError("the footprint of the image lies outside of the map's projection")
    if not (np.abs(px) < MOST_PX).all() and not within:
        raise GridSizeError("the result would have more pixels a side than a raster can have")
    low, high = _covering_px(grid, px, within)
    if np.any(high <= low):
        raise NoOverlapError(
            f"the footprint of the image does not lie on the grid{_turned(grid, xy)}"
        )
    return require_workable(grid.window(*Window.between(low, high)), "the result")


def _covering_px(
    grid: Grid, px: FloatArray, within: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first pixel that covers positions, shape (n, 2), and the one after the last."""
    px = np.clip(px, -MOST_PX, MOST_PX)
    # An error of position alone must not add a row or column.
    low = np.floor(px.min(axis=0) + 0.5 + POSITION_ERROR_PX).astype(int)
    high = np.ceil(px.max(axis=0) + 0.5 - POSITION_ERROR_PX).astype(int)
    if not within:
        return low, high
    return np.clip(low, 0, grid.size), np.clip(high, 0, grid.size)


def _turned(grid: Grid, xy: FloatArray) -> str:
    """Return a hint for messages if a footprint misses a grid only by a full turn of longitude."""
    turn = full_turn(grid.crs)
    if turn is None:
        return ""
    for moved in (xy - [turn, 0], xy + [turn, 0]):
        low, high = _covering_px(grid, grid.map_to_pixel(moved), within=True)
        if np.all(high > low):
            return (
                ", but a full turn of longitude beside it: move the geotransform of one of them "
                f"by {turn:g}"
            )
    return ""


def registered_grid(
    input_grid: Grid,
    px_to_map: PointFunction,
    crs: CRS | None,
    pixel_size_m: float | None = None,
    footprint: FloatArray | None = None,
) -> Grid:
    """Return a grid that covers all of a registered raster.

    In the input's own CRS and without another pixel size it is the input's own grid, extended, so
    that the result is aligned with the input's neighbours. Otherwise it is north-up, with square
    pixels as large as the input's and pixel borders at multiples of their size.

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
    footprint
        Map positions, shape (n, 2), that the result covers; None: those of the input's outline.

    Raises
    ------
    NoOverlapError
        The raster lies outside of the domain of the CRS.
    GridSizeError
        The transform stretches the raster excessively, or there are too many pixels, or a pixel is
        larger than the whole raster.
    """
    if footprint is None:
        footprint = px_to_map(input_grid.outline())
    usual = _registered_grid(input_grid, px_to_map, crs, None, footprint)
    stretch = np.hypot(*usual.size) / np.hypot(*input_grid.size)
    if stretch > _LARGEST_STRETCH:
        raise GridSizeError(
            f"the transform stretches the raster {stretch:.3g} times: it is damaged, or not for "
            "this raster"
        )
    if pixel_size_m is None:
        return usual
    if pixel_size_m > np.max(np.multiply(usual.pixel_sides_m, usual.size)):
        raise GridSizeError(f"a pixel size of {pixel_size_m:.6g} is larger than the whole raster")
    return _registered_grid(input_grid, px_to_map, crs, pixel_size_m, footprint)


def _registered_grid(
    input_grid: Grid,
    px_to_map: PointFunction,
    crs: CRS | None,
    pixel_size_m: float | None,
    footprint: FloatArray,
) -> Grid:
    if pixel_size_m is None and crs == input_grid.crs:
        return covering_grid(input_grid, footprint)
    if not input_grid.is_georeferenced and crs is None:
        return covering_grid(input_grid.scaled(pixel_size_m or 1.0), footprint)
    col, row = input_grid.centre_px
    corners = px_to_map(np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) + [col, row])
    centre = corners.mean(axis=0)
    if not np.isfinite(centre).all():
        raise NoOverlapError("the footprint of the image lies outside of the map's projection")
    metres = metres_per_unit_at(centre, crs)[0]
    if pixel_size_m is None:
        along, across = corners[2] - corners[0], corners[3] - corners[1]
        area = abs(along[0] * across[1] - along[1] * across[0]) / 2
        pixel_size_m = float(np.sqrt(area * metres.prod()))
    width, height = pixel_size_m / metres
    pixels = Grid(Affine(width, 0, 0, 0, -height, 0), crs, 1, 1)
    if not is_invertible(pixels.transform):
        raise GridSizeError("the transform gives the raster's pixels no size on the map")
    return covering_grid(pixels, footprint)
