"""Speckle filters on rasters: tile by tile, band by band."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..errors import RasterContentError
from ..rasters.hidden_files import final_name
from ..rasters.metadata import rounded, working_dtype
from ..rasters.nodata import put_nodata
from ..rasters.patch import middle_window
from ..rasters.radar_tags import with_speckle_filter
from ..rasters.reading import Mask, RasterSource, Window
from ..rasters.tiling import in_order, require_workable, tile_count, tiles
from ..rasters.writing import chosen_nodata, create_like, different_masks
from .filters import SpeckleFilter
from .statistics import estimate_looks

AMPLITUDE = "amplitude"
VALUES = (AMPLITUDE, "intensity")


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

    @cached_property
    def like(self) -> RasterSource:
        """The source with the result's metadata."""
        source = _as_amplitudes(self.source) if self.source.is_complex else self.source
        # Without speckle, only the tag identifies it as a radar image.
        return with_speckle_filter(source, f"{self.filter.name}, {self.filter.window_px} px")

    @cached_property
    def nodata(self) -> float | None:
        """The result's nodata value."""
        return chosen_nodata(self.like)

    def write(self, path: Path, context: Context) -> None:
        """Write the filtered raster, tile by tile; see `atomic.Outputs.stage`.

        Raises
        ------
        RasterContentError
            A valid pixel is below 0, or see `require_linear`.
        """
        source = self.source
        require_linear(source)
        require_workable(source.grid, source.path)
        workers, masked = context.workers, source.has_mask_band
        with create_like(
            self.like, source.grid, path, nodata=self.nodata, masked=masked, workers=workers
        ) as file:
            filtered = in_order(
                context.executor,
                lambda tile: (tile, *self.tile(tile)),
                tiles(source.grid),
                workers + 1,
            )
            done = context.progress.over(filtered, tile_count(source.grid))
            for tile, bands, valid in done:
                file.write(bands, window=tile, valid=valid)

    def tile(self, tile: Window) -> tuple[NDArray[Any], Mask]:
        """Return all bands of a tile, filtered, and which pixels of the first band are valid."""
        source, around = self.source, tile.widened(self.filter.reach_px)
        inside = tile.slices_in(around)
        values, valid = source.read_bands(around)
        # Without nodata and alpha, only a mask that all bands share marks pixels without data.
        if self.nodata is None and source.alpha_band is None and (valid != valid[0]).any():
            raise different_masks(source)
        out = np.empty((source.count, tile.height, tile.width), self.like.dtype)
        for i in range(source.count):
            out[i] = self._filtered(values[i], valid[i], i + 1)[inside]
        return out, valid[0][inside]

    def _filtered(self, values: NDArray[Any], valid: Mask, band: int) -> NDArray[Any]:
        source = self.source
        if band == source.alpha_band:
            return values
        power, unit = _power(source, values, valid, self.values)
        filtered = self.filter(power, valid)
        if self.values == AMPLITUDE:
            filtered = np.sqrt(filtered)
        elif source.is_complex:
            unit *= unit
        dtype = self.like.dtype
        filtered = rounded(np.multiply(filtered, unit, dtype=working_dtype(dtype)), dtype)
        if self.nodata is not None:
            put_nodata(filtered, valid, self.nodata)
            return filtered
        # With a mask, an invalid pixel keeps its value; a complex one becomes 0.
        return filtered if source.is_complex else np.where(valid, filtered, values)


def require_linear(source: RasterSource) -> None:
    """Raise `RasterContentError` if stored numbers are not proportional to the quantity."""
    name = source.path
    if source.colormap is not None:
        raise RasterContentError(
            f"{name} has a palette: its pixels are numbers of colours, not amplitudes or "
            "intensities"
        )
    for band in (source.bands[number - 1] for number in source.image_bands):
        if band.is_in_decibels:
            raise RasterContentError(
                f"{name} is in decibels, by the unit or the name of its band: make it linear before"
            )
        if band.offset != 0:
            raise RasterContentError(
                f"{name} states an offset ({band.offset:g}), so its numbers as stored are not "
                "proportional to amplitudes or intensities: apply it before (gdal_translate "
                "-unscale -ot Float32)"
            )


def _as_amplitudes(source: RasterSource) -> RasterSource:
    # No finite number is free for nodata: amplitudes may be 0, complex numbers may have any parts.
    bands = tuple(
        replace(band, dtype="float32", nodata=None if band.nodata is None else float("nan"))
        for band in source.bands
    )
    return replace(source, bands=bands)


def _power(
    source: RasterSource, pixels: NDArray[Any], valid: Mask, values: str
) -> tuple[NDArray[np.float32], float]:
    """Return the power of pixels, and the unit of amplitude or intensity that it is based on.

    Filters square the power in single precision: in a unit of about the largest pixel, no square
    overflows. The unit is a power of two, so that results do not depend on it.
    """
    known = np.where(valid, pixels, pixels.dtype.type(0))
    parts = (known.real, known.imag) if source.is_complex else (known,)
    least, largest = float(min(map(np.min, parts))), float(max(map(np.max, parts)))
    if not source.is_complex and least < 0:
        raise RasterContentError(
            f"{source.path} has pixels below 0, which no amplitude or intensity is: make decibels "
            "linear before, or declare the nodata value"
        )
    unit = math.ldexp(1.0, math.frexp(max(largest, -least))[1] - 1)
    dtype = working_dtype(known.real.dtype)
    linear, *others = (
        np.divide(part, unit, dtype=dtype).astype(np.float32, copy=False) for part in parts
    )
    if not source.is_complex and values != AMPLITUDE:
        return linear, unit
    return sum((part * part for part in others), linear * linear), unit


def looks_of(source: RasterSource, values: str) -> float:
    """Return the equivalent number of looks at the centre of a raster.

    Raises
    ------
    RasterContentError
        No pixel there is valid, or one is below 0, or see `require_linear`.
    """
    require_linear(source)
    middle = middle_window(source.grid)
    bands, valid = source.read_bands(middle, source.image_bands[:1])
    if not valid.any():
        name = final_name(source.path)
        raise RasterContentError(f"{name} has no valid pixels in its middle")
    power, _ = _power(source, bands[0], valid[0], values)
    return estimate_looks(power, valid[0])
