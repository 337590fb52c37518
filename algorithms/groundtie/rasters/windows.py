"""Windows of rasters, and the validity of their pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import rasterio.windows
from numpy.typing import NDArray

from .metadata import fits, numpy_dtype
from .nodata import are_measured, is_nodata

if TYPE_CHECKING:
    from .reading import RasterSource

FloatImage = NDArray[np.float32]
Mask = NDArray[np.bool_]


class Window(NamedTuple):
    """A rectangle of pixels; it may reach beyond the raster."""

    col: int
    row: int
    width: int
    height: int

    @classmethod
    def between(cls, low: NDArray[np.int_], high: NDArray[np.int_]) -> Window:
        """Return the window from the pixel `low` (col, row) up to, but without, `high`."""
        (left, top), (width, height) = low.tolist(), (high - low).tolist()
        return cls(left, top, width, height)

    @property
    def slices(self) -> tuple[slice, slice]:
        """Its rows and columns in an array."""
        return slice(self.row, self.row + self.height), slice(self.col, self.col + self.width)

    def common(self, other: Window) -> Window:
        """Return the intersection with another window; if empty, a side is 0."""
        left, top = max(self.col, other.col), max(self.row, other.row)
        right = min(self.col + self.width, other.col + other.width)
        bottom = min(self.row + self.height, other.row + other.height)
        return Window(left, top, max(right - left, 0), max(bottom - top, 0))

    def widened(self, margin: int) -> Window:
        """Return the window with a margin on each side."""
        size = self.width + 2 * margin, self.height + 2 * margin
        return Window(self.col - margin, self.row - margin, *size)

    def aligned(self, side: int) -> Window:
        """Return the window of whole blocks, counted from pixel 0, that contains this one."""
        left, top = self.col // side * side, self.row // side * side
        right, bottom = (
            -(-end // side) * side for end in (self.col + self.width, self.row + self.height)
        )
        return Window(left, top, right - left, bottom - top)

    def slices_in(self, whole: Window) -> tuple[slice, slice]:
        """Return its rows and columns in the array of a window that contains it."""
        return self._replace(col=self.col - whole.col, row=self.row - whole.row).slices


def cut(array: NDArray[Any], window: Window) -> NDArray[Any]:
    """Return a window of an array, shape (…, h, w), which is 0 beyond it."""
    inside = window.common(Window(0, 0, *array.shape[:-3:-1]))
    if inside == window:
        return array[(..., *window.slices)]
    padded = np.zeros((*array.shape[:-2], window.height, window.width), array.dtype)
    padded[(..., *inside.slices_in(window))] = array[(..., *inside.slices)]
    return padded


def read_window(
    dataset: Any, source: RasterSource, window: Window, bands: Sequence[int]
) -> tuple[NDArray[Any], Mask]:
    """Return values and validity of some bands of a window, shapes (bands, h, w).

    Parameters
    ----------
    dataset
        A handle of the raster (see `handles`).
    source
        The raster's metadata.
    window
        The window; beyond the raster nothing is valid.
    bands
        Numbers of the bands, from 1.
    """
    inside = window.common(source.window)
    if not inside.width or not inside.height:
        shape = (len(bands), window.height, window.width)
        return np.zeros(shape, source.dtype), np.zeros(shape, bool)
    place = rasterio.windows.Window(*inside)
    values = read_values(dataset, source, place, bands)
    valid = _validity(dataset, source, place, bands, values)
    around = window._replace(col=window.col - inside.col, row=window.row - inside.row)
    return cut(values, around), cut(valid, around)


def read_values(
    dataset: Any, source: RasterSource, place: Any, bands: Sequence[int]
) -> NDArray[Any]:
    """Return some bands of a window inside the raster, in the type that holds all of them."""
    if len({source.bands[number - 1].dtype for number in bands}) == 1:
        return np.asarray(dataset.read(list(bands), window=place, out_dtype=source.dtype))
    # rasterio can read bands of different types only one by one.
    return np.stack([dataset.read(n, window=place, out_dtype=source.dtype) for n in bands])


def _validity(
    dataset: Any, source: RasterSource, place: Any, bands: Sequence[int], values: NDArray[Any]
) -> Mask:
    """Return which of `values` are valid, and set those that cannot be measurements to 0."""
    valid = np.ones(values.shape, bool)
    if values.dtype.kind in "fc":
        valid = are_measured(values)
        if not valid.all():
            values[~valid] = 0
    for i, number in enumerate(bands):
        if number == source.alpha_band:
            valid[i] = values[i] > 0
            continue
        nodata = source.bands[number - 1].nodata
        stored = numpy_dtype(source.bands[number - 1].dtype)
        if nodata is not None and fits(nodata, stored):
            valid[i] &= ~is_nodata(values[i], nodata, stored)
        if source.has_mask_band:
            valid[i] &= dataset.read_masks(number, window=place) > 0
        if source.alpha_band is not None:
            valid[i] &= dataset.read(source.alpha_band, window=place) > 0
    return valid
