"""Reduced images of a raster that is being written."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import rasterio.windows
from numpy.typing import NDArray
from rasterio.enums import MaskFlags, Resampling
from rasterio.env import env_ctx_if_needed

from .handles import OpenDataset
from .kernels import CACHED_PIXELS
from .tiled_file import Level
from .windows import Mask, Window

# Files beside the one that is written are none of its own.
_ALONE = {"GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR"}

# Types of which double precision holds all means.
_MEANS = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")

Task = tuple[list[int], Window]


@contextlib.contextmanager
def before_level(path: Path, number: int) -> Iterator[OpenDataset]:
    """Open the level before an overview, numbered from 1, in the file in which it is finished.

    By one handle for all threads, so that no block is decompressed twice for the pixels around.
    """
    level = {"overview_level": number - 2} if number > 1 else {}
    with rasterio.Env(**_ALONE), rasterio.open(path, sharing=False, **level) as dataset:
        yield OpenDataset(dataset)


@dataclass(frozen=True)
class Reduced:
    """An overview, as read from the level before.

    Parameters
    ----------
    handles
        Of that level in the file, in which it is finished.
    before, level
        That level, and the one that is made, half its size.
    nearest
        Whether pixels are picked; else they are averages of what is valid.
    """

    handles: OpenDataset
    before: Level
    level: Level
    nearest: bool

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
        with env_ctx_if_needed(), self.handles.borrow() as dataset:
            found = None if self.nearest else self._means(dataset, bands, window)
            return found or self._resampled(dataset, bands, window)

    @property
    def _scale(self) -> tuple[float, float]:
        """Return how many columns and rows of the level before a pixel of the overview has.

        A last row or column of an odd number is shared by all of the overview's pixels.
        """
        before, made = self.before.image, self.level.image
        return before.width / made.width, before.height / made.height

    def _has_mask(self, bands: list[int]) -> bool:
        return self.level.mask is not None and bands[0] == 1

    def _resampled(
        self, dataset: Any, bands: list[int], window: Window
    ) -> tuple[NDArray[Any], Mask | None]:
        """Return what GDAL makes of any pixels."""
        x, y = self._scale
        place = rasterio.windows.Window(
            window.col * x, window.row * y, window.width * x, window.height * y
        )
        shape = (window.height, window.width)
        how = Resampling.nearest if self.nearest else Resampling.average
        values = dataset.read(bands, window=place, out_shape=(len(bands), *shape), resampling=how)
        if not self._has_mask(bands):
            return values, None
        mask = dataset.read_masks(1, window=place, out_shape=shape, resampling=how)
        return values, mask > 0

    def _means(
        self, dataset: Any, bands: list[int], window: Window
    ) -> tuple[NDArray[Any], Mask | None] | None:
        """Return the same of usual pixels, in a tenth of the time; None: they are not."""
        if dataset.dtypes[0] not in _MEANS:
            return None
        before, made = self.before.image, self.level.image
        down = _Halves.of(before.height, made.height, window.row, window.height)
        across = _Halves.of(before.width, made.width, window.col, window.width)
        place = rasterio.windows.Window(across.first, down.first, across.count, down.count)
        masks = _masks(dataset, bands, place)
        if masks is None:
            return None
        around = (down.beyond, across.beyond)
        fill = 0 if dataset.nodata is None else dataset.nodata
        values = dataset.read(bands, window=place)
        means = np.empty((len(bands), window.height, window.width), values.dtype)
        known = np.ones(means.shape, bool)
        for band, mask, into, valid in zip(values, masks, means, known, strict=True):
            shown = None
            if mask is not None:
                band[~mask] = 0
                shown = np.pad(mask, around)
            _average(np.pad(band, around), shown, down, across, (into, valid))
            if dataset.nodata is not None and (into[valid] == fill).any():
                return None
            into[~valid] = fill
        return means, known[0] if self._has_mask(bands) else None


@dataclass(frozen=True)
class _Halves:
    """How pixels of an overview are made of those of the level before, along an axis.

    Parameters
    ----------
    first, count
        The pixels that are read.
    beyond
        How many before and after them do not exist.
    shares
        How much each pixel has of the one before its two, and of the second of these, shape (2, n);
        None: nothing and all.
    size
        How many pixels of the level before each has.
    """

    first: int
    count: int
    beyond: tuple[int, int]
    shares: NDArray[np.float64] | None
    size: float

    @classmethod
    def of(cls, before: int, made: int, start: int, count: int) -> _Halves:
        """Return it of `count` pixels from `start` on, of levels of these sizes."""
        if before == 2 * made:
            return cls(2 * start, 2 * count, (0, 0), None, 2)
        # Pixel i reaches from 2 i - i / made to 2 (i + 1) - (i + 1) / made.
        lost = np.arange(start, start + count + 1) / made
        first, stop = max(2 * start - 1, 0), min(2 * (start + count), before)
        beyond = first - (2 * start - 1), 2 * (start + count) - stop
        return cls(first, stop - first, beyond, np.stack([lost[:-1], 1 - lost[1:]]), before / made)

    def part(self, pixels: slice) -> _Halves:
        """Return it of some of the pixels."""
        shares = None if self.shares is None else self.shares[:, pixels]
        return replace(self, shares=shares)

    def sums(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the sums along the first axis of values, shape (2 n or 2 n + 1, m)."""
        if self.shares is None:
            return np.asarray(values[::2] + values[1::2])
        ahead, behind = self.shares.astype(values.dtype)[:, :, None]
        total = ahead * values[:-1:2]
        total += values[1::2]
        total += behind * values[2::2]
        return np.asarray(total)


def _average(
    values: NDArray[Any],
    shown: Mask | None,
    down: _Halves,
    across: _Halves,
    into: tuple[NDArray[Any], Mask],
) -> None:
    """Put the means of an image's pixels, 0 where they are not shown, and validity into arrays."""
    means, known = into
    precision = np.result_type(values, np.float32)
    height, width = means.shape
    lines = max(CACHED_PIXELS // width, 1)
    area: Any = down.size * across.size
    for first in range(0, height, lines):
        some = slice(first, min(first + lines, height))
        rows = slice(2 * some.start, 2 * some.stop + (down.shares is not None))
        halves = down.part(some)

        def sums(part: NDArray[Any], halves: _Halves = halves) -> NDArray[Any]:
            return across.sums(halves.sums(part.astype(precision)).T).T

        total = sums(values[rows])
        if shown is not None:
            area = sums(shown[rows])
            known[some] = area > 0
            area = np.where(known[some], area, 1)
        total /= area
        means[some] = total if precision == values.dtype else np.floor(total + 0.5)


def _masks(dataset: Any, bands: list[int], place: Any) -> list[Mask | None] | None:
    """Return which pixels of each band are valid, None for all; None: some are transparent."""
    masks: dict[int, Mask | None] = {}
    keys = []
    for number in bands:
        flags = dataset.mask_flag_enums[number - 1]
        keys.append(0 if {MaskFlags.per_dataset, MaskFlags.all_valid} & {*flags} else number)
        if keys[-1] in masks or MaskFlags.all_valid in flags:
            continue
        mask = dataset.read_masks(number, window=place) == 255
        masks[keys[-1]] = None if mask.all() else mask
        if MaskFlags.alpha in flags and not mask.all():
            return None
    return [masks.get(key) for key in keys]
