"""Reduced images of a raster that is being written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rasterio
import rasterio.windows
from numpy.typing import NDArray
from rasterio.enums import Resampling

from .tiled_file import Level
from .windows import Mask, Window

# Files beside the one that is written are none of its own.
_ALONE = {"GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR"}

Task = tuple[list[int], Window]


@dataclass(frozen=True)
class Reduced:
    """An overview, as read from the level before.

    Parameters
    ----------
    path
        The file, in which that level is finished.
    before, level
        That level, and the one that is made.
    nearest
        Whether pixels are picked; else they are averages of what is valid.
    number
        Of the level before: 0 is the raster.
    """

    path: Path
    before: Level
    level: Level
    nearest: bool
    number: int

    def tasks(self, bands: int) -> list[Task]:
        """Return which bands, from 1, and windows are read at a time."""
        image = self.level.image
        together = [list(range(1, bands + 1))]
        groups = together if image.planes == 1 else [[band] for band in together[0]]
        return [
            (group, place)
            for _, _, place in image.blocks(Window(0, 0, image.width, image.height))
            for group in groups
        ]

    def read(self, task: Task) -> tuple[NDArray[Any], Mask | None]:
        """Return bands of a window, (bands, h, w), and, beside the first, what is valid, (h, w)."""
        bands, window = task
        # A last row or column of an odd number is shared by all of the overview's pixels.
        x = self.before.image.width / self.level.image.width
        y = self.before.image.height / self.level.image.height
        place = rasterio.windows.Window(
            window.col * x, window.row * y, window.width * x, window.height * y
        )
        shape = (window.height, window.width)
        how = Resampling.nearest if self.nearest else Resampling.average
        level = {} if self.number == 0 else {"overview_level": self.number - 1}
        with rasterio.Env(**_ALONE), rasterio.open(self.path, sharing=False, **level) as dataset:
            values = dataset.read(
                bands, window=place, out_shape=(len(bands), *shape), resampling=how
            )
            if self.level.mask is None or bands[0] != 1:
                return values, None
            mask = dataset.read_masks(1, window=place, out_shape=shape, resampling=how)
            return values, mask > 0
