"""Overviews of a raster that is being written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import rasterio.windows
from numpy.typing import NDArray
from rasterio.enums import ColorInterp, MaskFlags, Resampling
from scipy import sparse

from .averaging import overlaps, weighted_sums
from .handles import FileHandles
from .metadata import numpy_dtype, rounded
from .nodata import put_nodata
from .tiff_directories import Image
from .windows import Mask, Window

# Types whose means are computed in single or double precision.
_MEANS = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64",
          "float32", "float64")  # fmt: skip

Task = tuple[list[int], Window]


@dataclass(frozen=True)
class Reduced:
    """An overview, computed from the previous level.

    Parameters
    ----------
    handles
        Handles of the previous level, which is finished in the file.
    level
        The overview, half the size of the previous level.
    nearest
        Whether pixels are picked; otherwise they are averages of valid pixels. Those of 64 bits
        are computed in double precision: of large numbers they lose the last digits.
    nodata
        The file's nodata value, or None. rasterio does not read all that 64 bits can hold.
    """

    handles: FileHandles
    level: Image
    nearest: bool
    nodata: float | None

    def tasks(self, bands: int) -> list[Task]:
        """Return the groups of bands, from 1, and windows that are processed at a time."""
        numbers = range(1, bands + 1)
        groups = [[*numbers]] if self.level.planes == 1 else [[number] for number in numbers]
        whole = Window(0, 0, self.level.width, self.level.height)
        return [(group, place) for _, _, place in self.level.blocks(whole) for group in groups]

    def read(self, task: Task) -> tuple[NDArray[Any], Mask | None]:
        """Return bands of a window, (bands, h, w), and the validity of the first, (h, w).

        The validity may be None if it is not needed: there is no mask, or the bands do not include
        the file's first.
        """
        bands, window = task
        with self.handles.borrow() as dataset:
            found = None if self.nearest else self._means(dataset, bands, window)
            return found or self._resampled(dataset, bands, window)

    def _scale(self, dataset: Any) -> tuple[float, float]:
        """Return how many columns and rows of the previous level a pixel of the overview spans.

        An odd last row or column is distributed over all of the overview's pixels.
        """
        return dataset.width / self.level.width, dataset.height / self.level.height

    def _resampled(
        self, dataset: Any, bands: list[int], window: Window
    ) -> tuple[NDArray[Any], Mask | None]:
        """Return `read` by GDAL's resampling, which handles all types of pixels."""
        x, y = self._scale(dataset)
        place = rasterio.windows.Window(
            window.col * x, window.row * y, window.width * x, window.height * y
        )
        shape = (window.height, window.width)
        how = Resampling.nearest if self.nearest else Resampling.average
        values = np.zeros((len(bands), *shape), numpy_dtype(dataset.dtypes[0]))
        dataset.read(bands, out=values, window=place, resampling=how)
        if self.level.mask is None:
            return values, None
        valid = dataset.read_masks(1, window=place, out_shape=shape, resampling=how) > 0
        # GDAL leaves invalid complex pixels uninitialised.
        values[:, ~valid] = 0
        return values, valid if bands[0] == 1 else None

    def _means(
        self, dataset: Any, bands: list[int], window: Window
    ) -> tuple[NDArray[Any], Mask] | None:
        """Return `read` as averages without GDAL's resampling; None in unusual cases."""
        if dataset.dtypes[0] not in _MEANS:
            return None
        made = self.level
        precision = np.result_type(dataset.dtypes[0], np.float32)
        rows, down = _shares(dataset.height, made.height, window.row, window.height, precision)
        cols, across = _shares(dataset.width, made.width, window.col, window.width, precision)
        place = rasterio.windows.Window.from_slices(rows, cols)
        masks = _masks(dataset, bands, place, self.nodata)
        if masks is None:
            return None
        values = dataset.read(bands, window=place)
        means = np.empty((len(bands), window.height, window.width), values.dtype)
        known = np.ones(means.shape, bool)
        x, y = self._scale(dataset)
        for band, mask, into, valid in zip(values, masks, means, known, strict=True):
            weight: Any = x * y
            if mask is not None:
                band[~mask] = 0
                weight = weighted_sums(down, across, mask.astype(precision))
                valid[:] = weight > 0
                weight[~valid] = 1
            mean = weighted_sums(down, across, band.astype(precision)) / weight
            whole = precision != values.dtype
            into[:] = rounded(np.floor(mean + 0.5), values.dtype) if whole else mean
            put_nodata(into, valid, self.nodata)
        return means, known[0]


def _shares(
    before: int, made: int, start: int, count: int, precision: np.dtype[Any]
) -> tuple[slice, sparse.csr_matrix]:
    """Return the pixels of the previous level that make some of an overview's, and their shares.

    Along an axis of `before` and `made` pixels, for the `count` pixels of the overview from `start`
    on.
    """
    edges = np.arange(start, start + count + 1) * before / made
    pixels = slice(int(edges[0]), min(int(np.ceil(edges[-1])), before))
    return pixels, overlaps(edges - pixels.start, pixels.stop - pixels.start, precision)


def _masks(
    dataset: Any, bands: list[int], place: Any, nodata: float | None
) -> list[Mask | None] | None:
    """Return the valid pixels of each band, None for all pixels; None if some are transparent."""
    masks: dict[int, Mask | None] = {}
    keys = []
    for number in bands:
        flags = dataset.mask_flag_enums[number - 1]
        keys.append(0 if {MaskFlags.per_dataset, MaskFlags.all_valid} & {*flags} else number)
        if keys[-1] in masks or MaskFlags.all_valid in flags:
            continue
        if MaskFlags.nodata in flags and ColorInterp.alpha in dataset.colorinterp:
            # The same as rasterio's masks, which warn that nodata takes precedence over alpha.
            values = dataset.read(number, window=place)
            mask = values != nodata if nodata == nodata else ~np.isnan(values)
        else:
            mask = dataset.read_masks(number, window=place) == 255
        masks[keys[-1]] = None if mask.all() else mask
        if MaskFlags.alpha in flags and not mask.all():
            return None
    return [masks.get(key) for key in keys]
