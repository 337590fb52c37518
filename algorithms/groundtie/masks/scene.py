"""Windows of one image, whatever they are read from, and mask rasters made from them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..progress import SILENT, Progress
from ..rasters.averaging import area_average
from ..rasters.grid import Grid
from ..rasters.patch import Patch
from ..rasters.reading import Mask, RasterSource, Window
from ..rasters.tiling import require_workable, tile_count, tiles
from ..rasters.writing import create_like, one_band


class Selection(NamedTuple):
    """Which pixels of a window take part, and which are valid at all, both of shape (h, w)."""

    part: Mask
    valid: Mask


# Pixels of the result that are averaged at a time.
_STRIP_PIXELS = 1 << 18

# Means that a histogram is made from, at most: larger scenes are sampled.
_SAMPLE = 4_000_000


@dataclass(frozen=True)
class Scene:
    """An image on a grid, of which windows can be read.

    Parameters
    ----------
    grid
        Where the pixels lie.
    read
        Returns the image in a window of the grid, which may reach beyond it.
    like
        A raster whose kind of file masks are written in.
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
        return Window(0, 0, self.grid.width, self.grid.height)

    def reduced(self, factor: int, progress: Progress = SILENT) -> Patch:
        """Return the whole scene as means over blocks of factor × factor pixels.

        Blocks at the right and lower border may be cut.
        """
        strips = list(self.reduced_strips(factor, progress))
        return Patch(
            np.concatenate([strip.values for strip in strips]),
            np.concatenate([strip.valid for strip in strips]),
        )

    def sample(self, factor: int, progress: Progress = SILENT) -> NDArray[np.float32]:
        """Return the valid means over blocks, shape (n,), of large scenes some spread evenly."""
        step = max(self.grid.width * self.grid.height // (factor**2 * _SAMPLE), 1)
        parts, first = [], 0
        for strip in self.reduced_strips(factor, progress):
            found = strip.values[strip.valid]
            parts.append(found[first::step])
            first = (first - len(found)) % step
        return np.concatenate(parts)

    def reduced_strips(self, factor: int, progress: Progress = SILENT) -> Iterator[Patch]:
        """Yield what `reduced` returns, some rows at a time."""
        width, height = self.grid.width, self.grid.height
        rows = max(_STRIP_PIXELS // width, 1) * factor
        for top in range(0, height, rows):
            progress.update(top / height)
            yield block_means(self.read(Window(0, top, width, min(rows, height - top))), factor)


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
    select: Callable[[Window], Selection],
    progress: Progress = SILENT,
) -> float:
    """Write a mask raster, 1 where pixels take part and else 0, and return the share of them.

    Parameters
    ----------
    scene
        Gives the grid.
    path
        The GeoTIFF to write; see `atomic.Outputs.stage`.
    select
        Returns which pixels of a tile take part.
    progress
        Receives every tile.

    Returns
    -------
    float
        Share of the valid pixels that take part, 0 to 1.
    """
    like = one_band(scene.like, "uint8")
    count = tile_count(scene.grid)
    selected = valid = 0
    with create_like(like, scene.grid, path, nodata=None) as file:
        for i, tile in enumerate(tiles(scene.grid)):
            chosen = select(tile)
            selected += int(np.count_nonzero(chosen.part))
            valid += int(np.count_nonzero(chosen.valid))
            file.write(chosen.part.astype(np.uint8), window=tile)
            progress.update((i + 1) / count)
    return selected / max(valid, 1)
