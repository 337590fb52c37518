"""Overviews of remote rasters, read in place of pixels that would be averaged.

Only overviews whose pixels prove to be means of the previous level are used: picked pixels are
displaced by half a pixel, and contain aliasing.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from .averaging import area_average
from .grid import FloatArray, compose
from .handles import FileHandles
from .windows import Mask, Window

if TYPE_CHECKING:
    from .reading import RasterSource

# Side of the samples from which the kind of an overview is determined, in pixels, and their places
# in the image.
_SAMPLE_PX = 64
_PLACES = (0.75, 0.5, 0.25)


@dataclass
class RemoteOverviews:
    """The overviews of one raster file.

    Parameters
    ----------
    count
        Number of overviews.
    """

    count: int
    _lock: threading.Lock = field(init=False, repr=False, default_factory=threading.Lock)
    _known: list[RasterSource] = field(init=False, repr=False, default_factory=list)
    _is_complete: bool = field(init=False, repr=False, default=False)

    def coarsest(self, source: RasterSource, reduction: float) -> RasterSource:
        """Return the smallest level of a raster that is not smaller than the result.

        Parameters
        ----------
        source
            The raster itself.
        reduction
            Factor by which its pixels are to be enlarged.
        """
        with self._lock:
            if not self._known:
                self._known.append(source)
            while not self._is_complete and _factor(source, self._known[-1]) * 2 <= reduction:
                self._add_next()
            small = [one for one in self._known if _factor(source, one) <= reduction]
        return small[-1]

    def close(self) -> None:
        """Close the files of all overviews."""
        with self._lock:
            for one in self._known[1:]:
                one.close()

    def _add_next(self) -> None:
        before, number = self._known[-1], len(self._known) - 1
        found = None if number == self.count else _overview(self._known[0], number)
        if found is None or not _is_mean_of(found, before):
            self._is_complete = True
        else:
            self._known.append(found)


def _factor(source: RasterSource, level: RasterSource) -> float:
    return max(
        source.grid.width / level.grid.width,
        source.grid.height / level.grid.height,
    )


def _overview(source: RasterSource, number: int) -> RasterSource | None:
    """Return an overview as a raster; None if it is too small to determine its kind."""
    handles = FileHandles(source.path, number)
    with handles.borrow() as dataset:
        width, height = dataset.width, dataset.height
    if min(width, height) < _SAMPLE_PX:
        return None
    larger = Affine.scale(source.grid.width / width, source.grid.height / height)
    transform = compose(source.grid.transform, larger)
    grid = source.grid.on_same_map(transform, width, height)
    return replace(source, grid=grid, _handles=handles, _overviews=None)


def _is_mean_of(level: RasterSource, before: RasterSource) -> bool:
    """Return whether an overview's pixels are best explained as means of the level below.

    Alternatives are picked pixels, and means about another place, as with wavelets.
    """
    band = level.image_bands[0]
    for place in _PLACES:
        col, row = (int((side - _SAMPLE_PX) * place) for side in level.grid.size)
        values, valid = level.read_bands(Window(col, row, _SAMPLE_PX, _SAMPLE_PX), [band])
        x, y = before.grid.width / level.grid.width, before.grid.height / level.grid.height
        cols, rows = (np.arange(_SAMPLE_PX + 1, dtype=np.float64) + first for first in (col, row))
        candidates = [
            _mean(before, band, rows * y, cols * x),
            _mean(before, band, rows * y - 0.5, cols * x - 0.5),
            _picked(before, band, rows[:-1] * y, cols[:-1] * x),
        ]
        if (x, y) != (round(x), round(y)):
            candidates.append(_mean(before, band, rows * round(y), cols * round(x)))
        valid &= np.all([known for _, known in candidates], axis=0)
        misses = [float(np.abs(image - values)[valid].sum()) for image, _ in candidates]
        if misses[0] < min(misses[1:]):
            return True
        if misses[0] > 0:
            return False
    return False  # uniform samples do not determine the kind


def _mean(
    source: RasterSource, band: int, rows: FloatArray, cols: FloatArray
) -> tuple[NDArray[Any], Mask]:
    """Return means between edges, shape (1, n, n)."""
    values, valid, top, left = _around(source, band, rows, cols)
    means, known = area_average(values, valid, rows - top, cols - left)
    return means[None], known[None]


def _picked(
    source: RasterSource, band: int, rows: FloatArray, cols: FloatArray
) -> tuple[NDArray[Any], Mask]:
    """Return the pixels that GDAL's `nearest` picks, shape (1, n, n): the first of each block."""
    values, valid, top, left = _around(source, band, rows, cols)
    at = np.ix_((rows + 0.5).astype(int) - top, (cols + 0.5).astype(int) - left)
    return values[at][None], valid[at][None]


def _around(
    source: RasterSource, band: int, rows: FloatArray, cols: FloatArray
) -> tuple[NDArray[Any], Mask, int, int]:
    top, left = int(rows[0]) - 1, int(cols[0]) - 1
    window = Window(left, top, int(cols[-1]) + 2 - left, int(rows[-1]) + 2 - top)
    values, valid = source.read_bands(window, [band])
    values = np.abs(values[0]) if source.is_complex else values[0].astype(np.float64)
    return values, valid[0], top, left
