"""Grey images held in memory, for steps that read them again and again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Raster
from ..context import Context
from .bands import BandInfo
from .grid import Grid
from .handles import ArrayHandles
from .pair import Image, ToPixel
from .reading import FloatImage, Mask, RasterSource
from .tiling import tiles
from .windows import Window


def held_grey(source: RasterSource, band: int | None = None) -> RasterSource:
    """Return a raster that reads the same grey values and validity as another one, from memory.

    Parameters
    ----------
    source
        The raster.
    band
        Number of its band, from 1; None: the mean of all bands but alpha.
    """
    return _held(source, source.grid, *source.read(source.window, band))


def held_onto(image: Image, grid: Grid, to_px: ToPixel, context: Context) -> Image:
    """Return an image that reads the same onto parts of a grid as another one, from memory.

    Parameters
    ----------
    image
        The image.
    grid
        The grid, which becomes that of the image's own pixels.
    to_px
        Takes the grid's map positions to pixels of the image.
    context
        Threads and progress.
    """
    shape = grid.height, grid.width
    values, valid = np.empty(shape, np.float32), np.empty(shape, bool)
    shown = None if image.mask is None else np.empty(shape, np.uint8)

    def resample(tile: Window) -> None:
        piece = grid.window(*tile)
        values[tile.slices], valid[tile.slices] = image.values_onto(piece, to_px)
        if shown is not None:
            shown[tile.slices] = image.shown_on(piece, to_px)

    for _ in context.map(resample, list(tiles(grid))):
        pass
    mask = None
    if image.mask is not None and shown is not None:
        plain = (BandInfo.plain("uint8", None),)
        mask = replace(
            image.mask,
            grid=grid,
            bands=plain,
            has_mask_band=False,
            _handles=ArrayHandles(Raster(shown)),
        )
    source = _held(image.source, grid, values, valid)
    return replace(image, source=source, band=1, mask=mask, colours=None)


def _held(source: RasterSource, grid: Grid, values: FloatImage, valid: Mask) -> RasterSource:
    """Return a raster of values in memory, which are lost where they are not valid."""
    values[~valid] = np.nan
    # Whoever states nothing of what is valid must not seem to.
    nodata = float("nan") if source.says_what_is_valid else None
    return replace(
        source,
        grid=grid,
        bands=(BandInfo.plain("float32", nodata),),
        has_mask_band=False,
        colormap=None,
        _handles=ArrayHandles(Raster(values)),
    )
