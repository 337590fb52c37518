"""Speckle filters on rasters: tile by tile, band by band."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..errors import RasterContentError
from ..rasters.metadata import rounded
from ..rasters.patch import middle_window
from ..rasters.radar_tags import with_speckle_filter
from ..rasters.reading import Mask, RasterSource, Window
from ..rasters.tiling import in_order, require_workable, tile_count, tiles
from ..rasters.writing import create_like, fill_value, shared_nodata
from .filters import SpeckleFilter
from .statistics import estimate_looks

AMPLITUDE = "amplitude"
VALUES = (AMPLITUDE, "intensity")

# Filters work in float32; its power must not overflow.
_LARGEST_AMPLITUDE = 1e18


@dataclass(frozen=True)
class RasterFilter:
    """A speckle filter on a raster, band by band.

    Parameters
    ----------
    source
        The raster; complex bands become amplitudes.
    filter
        The filter.
    values
        Unit of the pixels, one of `VALUES`.
    """

    source: RasterSource
    filter: SpeckleFilter
    values: str

    def write(self, path: Path, context: Context) -> None:
        """Write the filtered raster, tile by tile; see `atomic.Outputs.stage`."""
        source = self.source
        require_workable(source.grid, source.path)
        like = _as_amplitudes(source) if source.is_complex else source
        nodata = shared_nodata(like)
        # Without speckle, only the tag identifies it as a radar image.
        like = with_speckle_filter(like, f"{self.filter.name}, {self.filter.window_px} px")
        workers, masked = context.workers, source.has_mask_band
        with create_like(
            like, source.grid, path, nodata=nodata, masked=masked, workers=workers
        ) as file:
            filtered = in_order(
                context.executor,
                lambda tile: (tile, *self.tile(tile)),
                tiles(source.grid),
                workers + 1,
            )
            for i, (tile, bands, valid) in enumerate(filtered):
                file.write(bands, window=tile, valid=valid)
                context.update((i + 1) / tile_count(source.grid))

    def tile(self, tile: Window) -> tuple[NDArray[Any], Mask]:
        """Return all bands of a tile, filtered, and which pixels of the first are valid."""
        source, around = self.source, tile.widened(self.filter.reach_px)
        inside = tile.slices_in(around)
        values, valid = source.read_bands(around)
        dtype = np.dtype(np.float32) if source.is_complex else values.dtype
        out = np.empty((source.count, tile.height, tile.width), dtype)
        for i in range(source.count):
            out[i] = self._filtered(values[i], valid[i], i + 1, dtype)[inside]
        return out, valid[0][inside]

    def _filtered(
        self, values: NDArray[Any], valid: Mask, band: int, dtype: np.dtype[Any]
    ) -> NDArray[Any]:
        source = self.source
        if band == source.alpha_band:
            return values
        power = _power(values, self.values)
        filtered = self.filter(power, valid)
        if self.values == AMPLITUDE:
            filtered = np.sqrt(filtered)
        filtered = rounded(filtered, dtype)
        if source.is_complex:
            return filtered
        # Without a nodata value, an invalid pixel keeps its value.
        nodata = source.bands[band - 1].nodata
        fill = values if nodata is None else fill_value(source, nodata, band)
        return np.where(valid, filtered, fill)


def _as_amplitudes(source: RasterSource) -> RasterSource:
    bands = tuple(replace(band, dtype="float32", nodata=None) for band in source.bands)
    return replace(source, bands=bands)


def _power(pixels: NDArray[Any], values: str) -> NDArray[np.float32]:
    """Return the power of pixels, float32."""
    if pixels.dtype.kind == "c":
        return np.asarray(pixels.real**2 + pixels.imag**2, np.float32)
    linear = np.clip(pixels.astype(np.float32), 0, _LARGEST_AMPLITUDE)
    return linear * linear if values == AMPLITUDE else linear


def looks_of(source: RasterSource, values: str) -> float:
    """Return the equivalent number of looks in the middle of a raster.

    Raises
    ------
    RasterContentError
        No pixel there is valid.
    """
    middle = middle_window(source.grid)
    bands, valid = source.read_bands(middle, source.image_bands[:1])
    if not valid.any():
        raise RasterContentError(f"{source.path} has no valid pixels in its middle")
    return estimate_looks(np.where(valid[0], _power(bands[0], values), np.float32(0)), valid[0])
