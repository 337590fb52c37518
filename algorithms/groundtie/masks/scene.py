"""Windows of one image, from any source, and mask rasters made from them."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..progress import SILENT, Progress
from ..rasters.averaging import area_average
from ..rasters.grid import Grid
from ..rasters.patch import Patch
from ..rasters.reading import Mask, RasterSource, Window
from ..rasters.tiff_directories import BLOCK
from ..rasters.tiling import require_workable, tile_count, tiles
from ..rasters.writing import create_like, one_band


class Selection(NamedTuple):
    """Pixels of a window that take part, and pixels that are valid, both of shape (h, w)."""

    part: Mask
    valid: Mask


# Returns the pixels of a window that take part.
Select = Callable[[Window], Selection]

# Number of pixels of the result that are averaged at a time.
_STRIP_PIXELS = 1 << 18


@dataclass(frozen=True)
class Scene:
    """An image on a grid, read in windows.

    Parameters
    ----------
    grid
        Grid of the pixels.
    read
        Returns the image in a window of the grid, which may reach beyond it.
    like
        A raster whose file format masks are written in.
    """

    grid: Grid
    read: Callable[[Window], Patch]
    like: RasterSource

    @classmethod
    def of(cls, source: RasterSource, band: int | None = None) -> Scene:
        """Return a raster as a scene; `band` as `RasterSource.read` takes it."""
        grid = require_workable(source.grid, source.path)
        return cls(grid, lambda window: Patch(*source.read(window, band)), source)

    @property
    def whole(self) -> Window:
        """All pixels of the grid."""
        return Window(0, 0, *self.grid.size)

    def reduced(self, factor: int, progress: Progress) -> Patch:
        """Return the whole scene as means over blocks of factor × factor pixels.

        Blocks at the right and lower border may be cut.
        """
        width, height = self.grid.size
        rows = max(_STRIP_PIXELS // width, 1) * factor
        strips = []
        for top in range(0, height, rows):
            progress.update(top / height)
            strip = self.read(Window(0, top, width, min(rows, height - top)))
            strips.append(block_means(strip, factor))
        return Patch(
            np.concatenate([strip.values for strip in strips]),
            np.concatenate([strip.valid for strip in strips]),
        )

    def sample(self, factor: int, most: int, progress: Progress = SILENT) -> NDArray[np.float32]:
        """Return valid means over blocks, shape (n,), of large scenes about `most` from some tiles.

        The tiles lie along diagonals, so that each row and column of tiles has equally many.
        """
        step = max(self.grid.width * self.grid.height // (factor**2 * most), 1)
        side = BLOCK // factor * factor
        all_tiles = tiles(self.grid, side)
        some = [one for one in all_tiles if (one.row + one.col) // side % step == 0]
        parts = []
        for tile in progress.over(some, len(some)):
            means = block_means(self.read(tile), factor)
            parts.append(means.values[means.valid])
        return np.concatenate(parts)


def block_means(patch: Patch, factor: int) -> Patch:
    """Return the means of a patch over blocks of factor × factor pixels from its first."""
    if factor == 1:
        return patch
    edges = [
        np.minimum(np.arange(0, size + factor, factor), size).astype(float)
        for size in patch.values.shape
    ]
    return Patch(*area_average(patch.values, patch.valid, edges[0], edges[1]))


def write_mask(
    scene: Scene,
    path: str | os.PathLike[str],
    select: Select,
    progress: Progress = SILENT,
) -> float:
    """Write a mask raster, 1 where pixels take part, else 0, and return the share of the former.

    Parameters
    ----------
    scene
        Provides the grid.
    path
        The GeoTIFF to write; see `atomic.Outputs.stage`.
    select
        Returns the pixels of a tile that take part.
    progress
        Receives every tile.

    Returns
    -------
    float
        Share of the valid pixels that take part, 0 to 1.
    """
    selected = valid = 0

    def part(tile: Window) -> NDArray[np.uint8]:
        nonlocal selected, valid
        chosen = select(tile)
        selected += int(np.count_nonzero(chosen.part))
        valid += int(np.count_nonzero(chosen.valid))
        return chosen.part.astype(np.uint8)

    write_tiles(scene, path, part, progress)
    return selected / max(valid, 1)


def write_tiles(
    scene: Scene,
    path: str | os.PathLike[str],
    values: Callable[[Window], NDArray[Any]],
    progress: Progress = SILENT,
    dtype: str = "uint8",
    nodata: float | None = None,
) -> None:
    """Write a raster of one band on a scene's grid, tile by tile.

    Parameters
    ----------
    scene, path, progress
        As in `write_mask`.
    values
        Returns the pixels of a tile.
    dtype, nodata
        Data type and nodata value of the raster.
    """
    with create_like(one_band(scene.like, dtype), scene.grid, path, nodata=nodata) as file:
        for tile in progress.over(tiles(scene.grid), tile_count(scene.grid)):
            file.write(values(tile), window=tile)
