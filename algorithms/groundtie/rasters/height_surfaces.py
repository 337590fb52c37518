"""Bilinear interpolation of height rasters at arbitrary positions, with voids filled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import NoOverlapError, RasterContentError
from .averaging import average_window
from .grid import POSITION_ERROR_PX, FloatArray, PointFunction, finite
from .height_units import in_metres
from .kernels import interpolate
from .reading import FloatImage, Mask, RasterSource, Window
from .warping import are_inside, lies_inside

# Side of the blocks in which the raster is read, in pixels.
_BLOCK = 1024

# Voids are filled from the region reduced to at most this many pixels a side.
_FILL_SIDE = 512

# Margin around a region that is read for filling voids, in pixels.
_AROUND_PX = 2

# Relaxation steps of voids at each size.
_RELAXATIONS = 300

# No place on Earth is lower or higher, in metres: other values are undeclared voids.
_LOWEST_M, _HIGHEST_M = -600.0, 9_200.0

# The outermost pixels' values hold out to the edges of these pixels.
_HALF_PX = 0.5 + POSITION_ERROR_PX


@dataclass(frozen=True)
class RasterSurface:
    """A raster whose values are interpolated bilinearly.

    Parameters
    ----------
    source
        The raster, open; its first band holds the values.
    to_px
        From query positions, in any CRS, to the raster's pixels, shapes (n, 2).
    region
        The pixels in question.
    filled
        The region, reduced and with its voids filled; its values fill the voids of the raster.
    valid
        Which of the reduced pixels hold values of the raster.
    amid
        Which of the reduced pixels hold values, or lie in voids that do not reach the edge.
    margin_px
        Distance beyond the outermost pixels' centres at which their values still hold.
    fills_open
        Whether voids that are open to the region's edge, or lie beyond it, are filled.
    """

    source: RasterSource
    to_px: PointFunction
    region: Window
    filled: FloatImage
    valid: Mask
    amid: Mask
    margin_px: float = _HALF_PX
    fills_open: bool = True

    def at(self, positions: FloatArray) -> FloatArray:
        """Return the values, shape (n,), at positions, (n, 2); NaN where there are none."""
        px = self.to_px(positions)
        values = np.full(len(px), np.nan)
        for part in _parts(px):
            piece = self.piece(px[part])
            values[part] = piece.at((px[part] - piece.corner).T)
        return values

    def is_measured(self, positions: FloatArray) -> Mask:
        """Return which positions, (n, 2), lie on values of the raster, to a reduced pixel."""
        measured = np.isfinite(self.at(positions))
        col, row = np.rint(self.to_px(positions[measured])).T
        measured[measured] = self.valid[self._nearest(*self._reduced(col, row))]
        return measured

    def encloses(self, positions: FloatArray) -> Mask:
        """Return which positions, (n, 2), lie on values of the raster or in voids amid them."""
        px = self.to_px(positions)
        enclosed: Mask = np.asarray(np.isfinite(px).all(axis=1))
        col, row = np.rint(px[enclosed]).T
        enclosed[enclosed] = self.amid[self._nearest(*self._reduced(col, row))]
        return enclosed

    def piece(self, px: FloatArray) -> SurfacePiece:
        """Return the part of the surface needed for pixel positions, (n, 2)."""
        size = np.array(self.source.grid.size)
        low = np.clip(np.floor(px.min(axis=0)), 0, size - 1).astype(int)
        high = np.clip(np.floor(px.max(axis=0)) + 1, 0, size - 1).astype(int)
        window = Window.between(low, high + 1)
        image, valid = read_heights(self.source, window)
        if not valid.all():
            void_rows, void_cols = np.nonzero(~valid)
            image[void_rows, void_cols] = self._fill_at(void_cols + low[0], void_rows + low[1])
        return SurfacePiece(image, low.astype(float), self.margin_px)

    def _fill_at(self, cols: NDArray[np.int_], rows: NDArray[np.int_]) -> FloatImage:
        x, y = self._reduced(cols, rows)
        values = interpolate(self.filled, np.stack([x, y])[:, None], "bilinear")[0]
        if not self.fills_open:
            col, row, width, height = self.region
            known = (cols >= col) & (cols < col + width) & (rows >= row) & (rows < row + height)
            values[~(known & self.amid[self._nearest(x, y)])] = np.nan
        return values

    def _reduced(self, cols: NDArray[Any], rows: NDArray[Any]) -> tuple[FloatArray, FloatArray]:
        """Return the columns and rows of the raster's pixels in the reduced region."""
        height, width = self.filled.shape
        x = (cols - self.region.col + 0.5) * width / self.region.width - 0.5
        y = (rows - self.region.row + 0.5) * height / self.region.height - 0.5
        return np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)

    @staticmethod
    def _nearest(x: FloatArray, y: FloatArray) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        return np.rint(y).astype(int), np.rint(x).astype(int)


@dataclass(frozen=True)
class SurfacePiece:
    """A part of a surface in memory.

    Parameters
    ----------
    image
        Values of the surface; NaN in voids left unfilled.
    corner
        Column and row of the raster at which the part begins, shape (2,).
    margin_px
        See `RasterSurface`.
    """

    image: FloatImage
    corner: FloatArray
    margin_px: float

    def at(self, place: NDArray[Any]) -> FloatImage:
        """Return the values at columns and rows of the piece, shape (2, …); NaN beyond it."""
        px = place.reshape(2, -1, place.shape[-1])
        if are_inside(px, self.image.shape, 0):
            return interpolate(self.image, px, "bilinear").reshape(place.shape[1:])
        height, width = self.image.shape
        # NaN is outside, too.
        on_it = lies_inside(px, width, height, -self.margin_px)
        last = np.array([width, height])[:, None, None] - 1
        values = interpolate(self.image, np.where(on_it, np.clip(px, 0, last), 0), "bilinear")
        values[~on_it] = np.nan
        return values.reshape(place.shape[1:])


def _parts(px: FloatArray) -> list[NDArray[np.int_]]:
    """Return the indices of positions, (n, 2), grouped by blocks of the raster, without NaN."""
    known = np.flatnonzero(np.isfinite(px[:, 0] + px[:, 1]))
    if not len(known) or np.ptp(px[known], axis=0).max() < 2 * _BLOCK:
        return [known] if len(known) else []
    block = px[known] // _BLOCK @ [1, 1 << 20]
    return [known[block == each] for each in np.unique(block)]


def read_heights(
    source: RasterSource,
    window: Window,
    out_shape: tuple[int, int] | None = None,
    band: int = 1,
) -> tuple[FloatImage, Mask]:
    """Return heights in metres and which of them are valid, as `RasterSource.read`.

    Overviews are not read, as their means include undeclared voids.
    """

    def heights(whole: RasterSource, part: Window) -> tuple[FloatImage, Mask]:
        stored, valid = whole.read(part, band)
        values = in_metres(stored, whole, band)
        return values, valid & (values > _LOWEST_M) & (values < _HIGHEST_M)

    if out_shape is None:
        return heights(source, window)
    return average_window(heights, source, source, window, out_shape)


def surface_around(
    source: RasterSource, to_px: PointFunction, region: FloatArray, fill_open: bool = True
) -> RasterSurface:
    """Return the surface of a raster over a region.

    Parameters
    ----------
    source
        The raster.
    to_px
        From positions to the raster's pixels, shapes (n, 2); NaN for positions off the raster.
    region
        Positions of the region, (n, 2); positions between them belong to it, too.
    fill_open
        Also fill voids that are open to the region's edge, by continuing their rims.

    Raises
    ------
    NoOverlapError
        No position of the region lies on the raster.
    RasterContentError
        The raster holds no value in the region.
    """
    size = np.array(source.grid.size)
    px = finite(to_px(region))
    if not len(px):
        raise NoOverlapError(f"{source.path} does not cover the image")
    # Positions far off the raster may have any pixel coordinates.
    px = np.clip(px, -_AROUND_PX - 1, size + _AROUND_PX)
    low = np.clip(np.floor(px.min(axis=0)).astype(int) - _AROUND_PX, 0, size)
    high = np.clip(np.ceil(px.max(axis=0)).astype(int) + _AROUND_PX + 1, 0, size)
    if (high <= low).any():
        raise NoOverlapError(f"{source.path} does not cover the image")
    window = Window.between(low, high)
    reduce = max(max(window.width, window.height) / _FILL_SIDE, 1.0)
    shape = (max(int(window.height / reduce), 1), max(int(window.width / reduce), 1))
    values, valid = read_heights(source, window, None if reduce == 1 else shape)
    if not valid.any():
        raise RasterContentError(f"{source.path} holds no heights in the area of the image")
    from scipy.ndimage import binary_fill_holes  # takes long to import

    amid, filled = binary_fill_holes(valid), fill_voids(values, valid)
    return RasterSurface(source, to_px, window, filled, valid, amid, fills_open=fill_open)


def fill_voids(values: FloatImage, valid: Mask) -> FloatImage:
    """Return values, shape (h, w), whose voids are spanned by a membrane through their rims.

    Coarse to fine: voids start from the filled raster of half the size, and are relaxed until each
    pixel is the mean of its neighbours. A slope continues through a void.

    Raises
    ------
    ValueError
        Nothing is valid.
    """
    if valid.all():
        return values
    if not valid.any():
        raise ValueError("nothing is valid")
    height, width = valid.shape
    size = ((width + 1) // 2, (height + 1) // 2)
    share = cv2.resize(valid.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    known = np.where(valid, values, np.float32(0))
    sums = cv2.resize(known, size, interpolation=cv2.INTER_AREA)
    coarse = fill_voids((sums / np.maximum(share, 1e-6)).astype(np.float32), share > 1e-6)
    filled = np.where(valid, values, cv2.resize(coarse, (width, height)))
    cross = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32) / 4
    for _ in range(_RELAXATIONS):
        relaxed = cv2.filter2D(filled, -1, cross, borderType=cv2.BORDER_REPLICATE)
        filled = np.where(valid, values, relaxed)
    return filled
