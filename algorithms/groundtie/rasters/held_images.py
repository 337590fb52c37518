"""Grey images held in memory, for steps that read them repeatedly."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from affine import Affine

from ..arrays import Raster
from ..context import Context
from .averaging import HELD_PIXELS
from .grid import POSITION_ERROR_PX, Grid, PointFunction, compose
from .handles import ArrayHandles, read_by
from .metadata import BandInfo
from .pair import Image, ImagePair
from .patch import Patch
from .reading import FloatImage, Mask, RasterSource
from .tiling import tiles
from .warping import reduction
from .windows import Window, cut

# If a level shows less than this share of an image, its parts are read as needed instead.
_SHOWN_SHARE = 0.5


def held_grey(source: RasterSource, band: int | None = None) -> RasterSource:
    """Return a raster held in memory, with the grey values and validity of another raster.

    Parameters
    ----------
    source
        The raster.
    band
        Number of the band, from 1; None: the mean of all bands but alpha.
    """
    return _held(source, source.grid, *source.read(source.window, band))


@dataclass(frozen=True)
class HeldImage:
    """An image that is resampled on a grid and held in memory: 5 bytes per pixel, 6 with a mask.

    Parameters
    ----------
    image
        The image.
    grid
        The grid.
    values, valid
        What `Image.values_onto` returns on it.
    shown
        What the image's mask keeps; None: there is no mask.
    """

    image: Image
    grid: Grid
    values: FloatImage
    valid: Mask
    shown: Mask | None

    @classmethod
    def onto(cls, image: Image, grid: Grid, to_px: PointFunction, context: Context) -> HeldImage:
        """Resample an image on a grid; `to_px` takes map positions to pixels of the image."""
        shape = grid.height, grid.width
        values, valid = np.empty(shape, np.float32), np.empty(shape, bool)
        shown = None if image.mask is None else np.empty(shape, bool)

        def resample(tile: Window) -> None:
            piece = grid.window(*tile)
            values[tile.slices], valid[tile.slices] = image.values_onto(piece, to_px)
            if shown is not None:
                shown[tile.slices] = image.shown_on(piece, to_px)

        for _ in context.map(resample, list(tiles(grid))):
            pass
        return cls(image, grid, values, valid, shown)

    def read(self, piece: Grid, hidden: Mask | None = None) -> Patch:
        """Return the image as `Image.read_onto`, on pixels of the grid; none is valid beyond it.

        Raises
        ------
        ValueError
            The piece has other pixels than the grid.
        """
        px = self.grid.map_to_pixel(piece.pixel_to_map([[0, 0], piece.size]))
        first, end = np.rint(px).astype(int)
        off_px = np.abs(px - [first, first + piece.size]).max()
        if off_px > POSITION_ERROR_PX:
            raise ValueError(f"a piece lies {off_px:.1f} px off the pixels that are held")
        part = Window.between(first, end)
        values, valid = cut(self.values, part), cut(self.valid, part)
        shown = None if self.shown is None else cut(self.shown, part)
        return self.image.patch(values, valid, shown, hidden)


def held_on_level(pair: ImagePair, level: Grid, context: Context) -> ImagePair:
    """Return a pair that reads the same on parts of a coarse level, from means held in memory.

    Parameters
    ----------
    pair
        The images, which are read once.
    level
        A grid with larger pixels. The input may be read at any shift within the search limits.
    context
        Threads and progress.
    """
    to_reference = pair.reference.source.grid.map_to_pixel
    return replace(
        pair,
        reference=_means(pair.reference, level, to_reference, context),
        input=_means(pair.input, level, pair.nominal_px, context),
    )


def _means(image: Image, level: Grid, to_px: PointFunction, context: Context) -> Image:
    """Return an image of the means that `sample` takes first, over the same blocks of pixels."""
    source = image.source
    x, y = reduction(level, to_px, source.grid.size)
    width, height = -(-source.grid.width // x), -(-source.grid.height // y)
    is_shown = width * height * _SHOWN_SHARE <= level.width * level.height
    # A sensor model refers to its own pixels, so that its image cannot be averaged.
    if (x, y) == (1, 1) or not is_shown or type(source.grid) is not Grid:
        return image
    larger = compose(source.grid.transform, Affine.scale(x, y))
    grid = source.grid.on_same_map(larger, width, height)
    values, valid = np.empty((height, width), np.float32), np.empty((height, width), bool)

    def average(tile: Window) -> None:
        window = Window(tile.col * x, tile.row * y, tile.width * x, tile.height * y)
        shape = tile.height, tile.width
        values[tile.slices], valid[tile.slices] = source.read(window, image.band, shape)

    for _ in context.map(average, list(tiles(grid, max(math.isqrt(HELD_PIXELS) // max(x, y), 1)))):
        pass
    return replace(image, source=_held(source, grid, values, valid), band=1)


def _held(source: RasterSource, grid: Grid, values: FloatImage, valid: Mask) -> RasterSource:
    """Return a raster of values in memory; invalid values are overwritten."""
    values[~valid] = np.nan
    # A raster without any declaration of validity must not seem to have one.
    nodata = float("nan") if source.says_what_is_valid else None
    return read_by(source, ArrayHandles(Raster(values)), BandInfo.plain("float32", nodata), grid)
