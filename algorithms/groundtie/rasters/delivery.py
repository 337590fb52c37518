"""Registered rasters: resampled onto another grid, or unchanged with another geotransform."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Raster
from ..progress import SILENT, Progress
from .grid import Grid, PointFunction
from .lattice import DenseMap, coordinates, lattice
from .nodata import put_nodata
from .reading import RasterSource
from .tiling import band_groups, in_order, tile_count, tiles
from .warping import read_around, reduction, resample
from .windows import Mask, Window
from .writing import chosen_nodata, create_like, different_masks, shared_nodata

# Share of the work that overviews take, after all pixels are written.
_OVERVIEWS = 0.1

# Bands resampled together, with shared weights: computing these takes as long as one band.
_BANDS = 4

# Complex types whose parts may be NaN.
_COMPLEX = ("complex64", "complex128")


@dataclass(frozen=True)
class _Warp:
    """Parameters common to all tiles of a raster."""

    source: RasterSource
    to_input_px: PointFunction
    target: Grid
    method: str
    nodata: float | None
    factor: tuple[int, int]
    groups: tuple[tuple[int, ...], ...]

    @classmethod
    def of(
        cls,
        source: RasterSource,
        to_input_px: PointFunction,
        target: Grid,
        resampling: str,
    ) -> _Warp:
        method = "nearest" if source.colormap else resampling
        nodata = chosen_nodata(source)
        size = source.grid.size
        factor = (1, 1) if method == "nearest" else reduction(target, to_input_px, size)
        return cls(source, to_input_px, target, method, nodata, factor, band_groups(source))

    @property
    def is_bare(self) -> bool:
        """Whether neither nodata nor alpha marks pixels without data."""
        return self.nodata is None and self.source.alpha_band is None

    @cached_property
    def leaves_gaps(self) -> bool:
        """Whether there may be pixels without data that only a mask can mark."""
        # Complex numbers may be NaN, which is invalid without a declaration.
        may_be_nan = any(band.dtype in _COMPLEX for band in self.source.bands)
        return self.source.has_mask_band or (self.is_bare and (may_be_nan or not _is_covered(self)))

    def tiles(
        self, pool: ThreadPoolExecutor, ahead: int, progress: Progress
    ) -> Iterator[tuple[Window, tuple[int, ...], NDArray[Any], Mask, bool]]:
        """Yield all tiles in groups of bands: place, bands, values, validity, whether any is valid.

        The validity is that of the first band, (h, w); the last value refers to the whole group.
        """
        count = tile_count(self.target) * len(self.groups)
        only_masked = self.is_bare and self.leaves_gaps
        # A generator: there may be any number of tiles.
        tasks = ((tile, group) for tile in tiles(self.target) for group in self.groups)
        found = in_order(pool, lambda task: (*task, *self.tile(task)), tasks, ahead)
        for place, bands, values, valid in progress.over(found, count):
            if bands[0] == 1:
                first = valid[0]
            if only_masked and (valid != first).any():
                raise different_masks(self.source)
            yield place, bands, values, first, bool(valid.any())

    def tile(self, task: tuple[Window, tuple[int, ...]]) -> tuple[NDArray[Any], Mask]:
        """Return some bands of a tile and which of their pixels are valid, (bands, h, w)."""
        place, bands = task
        px = coordinates(self.target.window(*place), self.to_input_px)
        size = self.source.grid.size
        out = np.zeros((len(bands), place.height, place.width), self.source.dtype)
        valid = np.zeros(out.shape, bool)
        found = read_around(
            px,
            size,
            self.method,
            self.factor,
            lambda window, shape: self.source.read_bands(window, bands, shape),
        )
        if found is not None:
            images, shown, px = found
            for first in range(0, len(bands), _BANDS):
                part = slice(first, first + _BANDS)
                out[part], valid[part] = resample(
                    images[part], shown[part], px, self.method, self.source.dtype
                )
        for values, known, band in zip(out, valid, bands, strict=True):
            put_nodata(values, known, 0 if band == self.source.alpha_band else self.nodata)
        return out, valid


def warp_raster(
    source: RasterSource,
    to_input_px: PointFunction,
    target: Grid,
    path: str | os.PathLike[str],
    resampling: str = "cubic",
    *,
    workers: int = 2,
    progress: Progress = SILENT,
) -> bool:
    """Resample a raster onto a grid into a GeoTIFF, in one step from its original pixels.

    Returns whether any pixel of the result is valid.

    Memory is bounded: tiles are read, resampled and written one by one. Bands, dtype, colours,
    names and metadata are kept (see `writing.create_like`). Pixels without data get the input's
    nodata value, by default NaN in real floating-point rasters, and are transparent in an alpha
    band. Without either they are 0 with an internal mask. An input's mask band becomes an internal
    mask. Rasters with a palette are always resampled by `nearest`.

    Parameters
    ----------
    source
        The raster.
    to_input_px
        Takes map positions of the target grid, shape (n, 2), to input pixels (col, row).
    target
        The grid of the result.
    path
        The GeoTIFF to write; see `atomic.Outputs.stage` and `writing.create_like`.
    resampling
        One of `warping.METHODS`. If the target's pixels are larger than 1.5 input pixels, means
        over the area are taken first (not with `nearest`).
    workers
        Number of threads.
    progress
        Receives every tile.

    Raises
    ------
    OutputError
        The file cannot be written.
    RasterOpenError
        The pixels cannot be read.
    ParameterError
        The pixel type cannot hold the raster's nodata value, or bands mark missing data in
        different ways (see `writing.shared_nodata`).
    CancelledError
        The user cancelled.
    """
    warp = _Warp.of(source, to_input_px, target, resampling)
    interleave = "band" if len(warp.groups) > 1 else None
    pixels = progress.part(0, 1 - _OVERVIEWS)
    with (
        create_like(
            source,
            target,
            path,
            nodata=warp.nodata,
            interleave=interleave,
            masked=warp.leaves_gaps,
            workers=workers,
            progress=progress.part(1 - _OVERVIEWS, 1),
        ) as file,
        ThreadPoolExecutor(workers) as pool,
    ):
        is_empty = True
        for tile, group, values, known, shows in warp.tiles(pool, workers + 1, pixels):
            file.write(values, group, window=tile, valid=known)
            is_empty &= not shows
    progress.update(1.0)
    return not is_empty


def warp_to_array(
    source: RasterSource,
    to_input_px: PointFunction,
    target: Grid,
    resampling: str = "cubic",
    *,
    workers: int = 2,
) -> Raster:
    """Resample a raster onto a grid, as `warp_raster` does, into an array.

    Parameters, errors and pixels are those of `warp_raster`; if that writes a mask into its file,
    the array is a masked array.

    Returns
    -------
    Raster
        Shape (bands, h, w), dtype of the raster.
    """
    warp = _Warp.of(source, to_input_px, target, resampling)
    values = np.empty((source.count, target.height, target.width), source.dtype)
    valid = np.ones(values.shape[1:], bool)
    with ThreadPoolExecutor(workers) as pool:
        for tile, group, part, known, _ in warp.tiles(pool, workers + 1, SILENT):
            rows, cols = tile.slices
            values[group[0] - 1 : group[-1], rows, cols] = part
            if group is warp.groups[0]:
                valid[rows, cols] = known
    if warp.leaves_gaps:
        values = np.ma.MaskedArray(values, np.broadcast_to(~valid, values.shape))
    return Raster(values, target.geotransform, target.crs, warp.nodata)


def write_with_geotransform(
    source: RasterSource,
    grid: Grid,
    path: str | os.PathLike[str],
    *,
    rpc_tags: Mapping[str, str] | None = None,
    progress: Progress = SILENT,
) -> None:
    """Write a raster's unchanged pixels with another geotransform and CRS into a GeoTIFF.

    Parameters
    ----------
    source
        The raster.
    grid
        The new grid, of the same size.
    path
        The GeoTIFF to write; see `atomic.Outputs.stage`.
    rpc_tags
        RPCs that locate the raster, as in GDAL's metadata domain RPC.
    progress
        Receives every tile.

    Raises
    ------
    OutputError, RasterOpenError, ParameterError, CancelledError
        As `warp_raster`.
    """
    if grid.size != source.grid.size:
        raise ValueError("a new geotransform does not change the size of a raster")
    pixels = progress.part(0, 1 - _OVERVIEWS)
    with create_like(
        source,
        grid,
        path,
        nodata=shared_nodata(source),
        masked=source.has_mask_band,
        rpc_tags=rpc_tags,
        progress=progress.part(1 - _OVERVIEWS, 1),
    ) as file:
        for tile in pixels.over(tiles(grid), tile_count(grid)):
            values, mask = source.read_untouched(tile)
            file.write(values, window=tile, valid=mask)
    progress.update(1.0)


def _is_covered(warp: _Warp) -> bool:
    """Return whether every pixel of the target is known to lie on the source."""
    if isinstance(warp.to_input_px, DenseMap):
        return False
    grid = warp.source.grid
    return all(
        lattice(warp.target.window(*tile), warp.to_input_px).lies_within(*grid.size)
        for tile in tiles(warp.target)
    )
