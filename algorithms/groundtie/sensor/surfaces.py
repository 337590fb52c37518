"""Values of a raster of heights, of any CRS, at longitudes and latitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..errors import GeoreferencingError, NoOverlapError, RasterContentError
from ..rasters.grid import reproject
from ..rasters.reading import RasterSource, Window
from .smooth_map import Positions, smooth_map
from .voids import fill_voids

FloatArray = NDArray[np.float64]

LON_LAT = CRS.from_epsg(4326)

# Pixels of the raster that are read at a time, a side.
_BLOCK = 1024

# Points that are interpolated at a time: what they need stays in the processor's cache.
_POINTS = 1 << 14

# Voids are filled from the region reduced to at most so many pixels a side.
_FILL_SIDE = 512

# No place of the Earth is lower or higher, in metres: such values are voids that nobody declared.
_LOWEST_M, _HIGHEST_M = -600.0, 9_200.0

# Positions in pixels of the raster may be wrong by this much.
_TOLERANCE_PX = 1e-3

# Positions beyond the outer pixels' centres by less, in pixels, have the values of these.
_MARGIN_PX = 1.0


@dataclass(frozen=True)
class RasterSurface:
    """A raster whose values are interpolated bilinearly; voids are filled from their rims.

    Parameters
    ----------
    source
        The raster, open; its first band holds the values.
    to_px
        From longitude and latitude to its pixels, shapes (n, 2).
    region
        The pixels that are asked for.
    filled
        The region, reduced, without voids, for those of the raster.
    void_share
        Share of the region that holds no value.
    """

    source: RasterSource
    to_px: Positions
    region: Window
    filled: NDArray[np.float32]
    void_share: float

    def at(self, lon_lat: FloatArray) -> FloatArray:
        """Return the values, shape (n,), at longitudes and latitudes; NaN beyond the raster."""
        return self.at_pixels(*self.to_px(lon_lat).T)

    def at_pixels(self, cols: FloatArray, rows: FloatArray) -> FloatArray:
        """Return the values at columns and rows, all of one shape; NaN beyond the raster."""
        width, height = self.source.grid.width, self.source.grid.height
        if cols.size == 0:
            return np.zeros(cols.shape)
        box = cols.min(), rows.min(), cols.max(), rows.max()
        if min(box[:2]) >= 0 and box[2] <= width - 1 and box[3] <= height - 1:
            return self._inside(cols.ravel(), rows.ravel()).reshape(cols.shape)
        # So that NaN is outside, too.
        on_it = (cols >= -_MARGIN_PX) & (cols <= width - 1 + _MARGIN_PX)
        on_it &= (rows >= -_MARGIN_PX) & (rows <= height - 1 + _MARGIN_PX)
        values = np.full(cols.shape, np.nan)
        if on_it.any():
            values[on_it] = self._inside(
                np.clip(cols[on_it], 0, width - 1), np.clip(rows[on_it], 0, height - 1)
            )
        return values

    def _inside(self, cols: FloatArray, rows: FloatArray) -> FloatArray:
        if max(np.ptp(cols), np.ptp(rows)) < 2 * _BLOCK:
            return self._in_window(cols, rows)
        values = np.empty(len(cols))
        block = (cols // _BLOCK).astype(int) + (1 << 20) * (rows // _BLOCK).astype(int)
        for each in np.unique(block):
            here = block == each
            values[here] = self._in_window(cols[here], rows[here])
        return values

    def _in_window(self, cols: FloatArray, rows: FloatArray) -> FloatArray:
        left, top = int(cols.min()), int(rows.min())
        window = Window(left, top, int(cols.max()) + 2 - left, int(rows.max()) + 2 - top)
        image, valid = read_heights(self.source, window)
        if not valid.all():
            void_rows, void_cols = np.nonzero(~valid)
            image[void_rows, void_cols] = self._fill_at(void_cols + left, void_rows + top)
        return _bilinear(image, cols, rows, left, top)

    def _fill_at(self, cols: NDArray[np.int_], rows: NDArray[np.int_]) -> FloatArray:
        height, width = self.filled.shape
        x = (cols - self.region.col + 0.5) * width / self.region.width - 0.5
        y = (rows - self.region.row + 0.5) * height / self.region.height - 0.5
        padded = np.pad(self.filled, ((0, 1), (0, 1)), mode="edge")
        return _bilinear(padded, np.clip(x, 0, width - 1), np.clip(y, 0, height - 1), 0, 0)


def _bilinear(
    image: NDArray[np.float32], x: FloatArray, y: FloatArray, first_x: int, first_y: int
) -> FloatArray:
    """Return values, (n,), of an image whose first pixel lies at (first_x, first_y).

    Positions lie left of its last column and above its last row. Heights are exact to 0.1 mm.
    """
    width, flat = np.int32(image.shape[1]), image.ravel()
    values = np.empty(len(x))
    for start in range(0, len(x), _POINTS):
        part = slice(start, start + _POINTS)
        left, top = x[part].astype(np.int32), y[part].astype(np.int32)
        right, below = (x[part] - left).astype(np.float32), (y[part] - top).astype(np.float32)
        corner = (top - np.int32(first_y)) * width + (left - np.int32(first_x))
        upper, lower = flat.take(corner), flat.take(corner + width)
        upper += right * (flat.take(corner + np.int32(1)) - upper)
        lower += right * (flat.take(corner + (width + np.int32(1))) - lower)
        lower -= upper
        lower *= below
        np.add(upper, lower, out=values[part])
    return values


def read_heights(
    source: RasterSource, window: Window, out_shape: tuple[int, int] | None = None
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return heights and which of them are valid, as `RasterSource.read`."""
    values, valid = source.read(window, 1, out_shape)
    return values, valid & (values > _LOWEST_M) & (values < _HIGHEST_M)


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
    NoOverlapError
        No place of the region lies on it.
    RasterContentError
        It holds no value there.
    """
    grid = source.grid
    if grid.crs is None:
        raise GeoreferencingError(f"{source.path} has no CRS")

    def exact(places: FloatArray) -> FloatArray:
        xy = reproject(places, LON_LAT, grid.crs)
        return grid.map_to_pixel(np.where(np.isfinite(xy), xy, np.nan))

    size = np.array([grid.width, grid.height])
    px = exact(lon_lat)
    low = np.clip(np.floor(px.min(axis=0)).astype(int) - margin_px, 0, size)
    high = np.clip(np.ceil(px.max(axis=0)).astype(int) + margin_px + 1, 0, size)
    if (high <= low).any():
        raise NoOverlapError(f"{source.path} does not cover the image")
    region = Window(int(low[0]), int(low[1]), *(high - low).tolist())
    reduce = max(max(region.width, region.height) / _FILL_SIDE, 1.0)
    shape = (max(int(region.height / reduce), 1), max(int(region.width / reduce), 1))
    values, valid = read_heights(source, region, None if reduce == 1 else shape)
    if not valid.any():
        raise RasterContentError(f"{source.path} holds no heights in the area of the image")
    corner, opposite = lon_lat.min(axis=0), lon_lat.max(axis=0)
    around = 0.05 * (opposite - corner) + 1e-4
    to_px = smooth_map(exact, corner - around, opposite + around, _TOLERANCE_PX)
    return RasterSurface(source, to_px, region, fill_voids(values, valid), 1 - float(valid.mean()))
