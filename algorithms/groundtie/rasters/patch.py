"""Patches of images: grey values and their validity."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .grid import Grid, mesh
from .kernels import REACH
from .windows import FloatImage, Mask, Window

# Areas of zeros with at least this side hold no data.
_EMPTY_PX = 9

# Interpolating or averaging a constant changes it by a few units in the last place.
_ROUNDING = 8 * float(np.finfo(np.float32).eps)

# Side of a sample at full resolution, as averaging would remove speckle; its least valid share; and
# the places along each side of an image where one is looked for: 25 are read in half a second.
_SAMPLE_PX, _SAMPLE_SHARE, _SAMPLES_ALONG = 1024, 0.5, 5

# A larger share of negative values is not due to resampling, whose kernels undershoot at edges.
_NEGATIVE_SHARE = 0.02


@dataclass(frozen=True)
class Patch:
    """Grey values, float32, and their validity, bool, both of shape (h, w).

    A stack of patches of one size is a patch, too, with arrays of shape (n, h, w).
    """

    values: FloatImage
    valid: Mask

    @property
    def all_valid(self) -> bool:
        """Whether no pixel is masked."""
        return bool(self.valid.all())

    @property
    def valid_share(self) -> float:
        """Share of valid pixels, 0 to 1."""
        return float(self.valid.mean())

    @property
    def is_flat(self) -> bool:
        """Whether the valid pixels, if any, are all the same, but for rounding."""
        values = self.values[self.valid]
        if values.size == 0:
            return True
        low, high = float(values.min()), float(values.max())
        return high - low <= _ROUNDING * max(abs(low), abs(high))

    @property
    def images(self) -> Iterator[Patch]:
        """The patches of a stack, one after the other."""
        return map(Patch, self.values, self.valid)

    def take(self, which: ArrayLike) -> Patch:
        """Return the patches of a stack that an index or mask selects."""
        return Patch(self.values[np.asarray(which)], self.valid[np.asarray(which)])

    def inner(self, border: int) -> Patch:
        """Return this patch without a border on each side."""
        inside = slice(border, -border or None)
        return Patch(self.values[..., inside, inside], self.valid[..., inside, inside])


def reduced(image: NDArray[Any], factor: int) -> NDArray[Any]:
    """Return the means over blocks; incomplete blocks at the right and bottom are dropped."""
    height, width = (n // factor * factor for n in image.shape)
    size = (width // factor, height // factor)
    return np.asarray(cv2.resize(image[:height, :width], size, interpolation=cv2.INTER_AREA))


def reduced_patch(window: Patch, factor: int, least_valid: float = 1.0) -> Patch:
    """Return the means of a window's valid pixels over blocks, as `reduced`.

    Blocks with a smaller valid share than `least_valid` are masked.
    """
    if factor == 1:
        return window
    # Means have rounding errors, counts have none: a completely valid block must stay valid.
    count = np.rint(reduced(window.valid.astype(np.float32), factor) * factor**2)
    share = count / np.float32(factor**2)
    sums = reduced(np.where(window.valid, window.values, 0), factor)
    return Patch(sums / np.maximum(share, np.finfo(np.float32).eps), share >= least_valid)


def empty_areas(values: FloatImage, valid: Mask) -> Mask:
    """Return the pixels of areas that are 0 throughout, and their margin.

    Invalid pixels count as 0, so that narrow borders are found, but have no margin of their own.

    Many rasters fill uncovered areas with 0 without declaring it. The borders of such areas would
    be the strongest edges of the image, and the same in images of different places.
    """
    zero = (values == 0).astype(np.uint8)
    if not zero.any():
        return zero > 0
    areas = cv2.morphologyEx(zero, cv2.MORPH_OPEN, np.ones((_EMPTY_PX, _EMPTY_PX), np.uint8))
    areas[~valid] = 0
    # The margin is the reach of interpolation.
    return cv2.dilate(areas, np.ones((2 * REACH["cubic"] + 1,) * 2, np.uint8)) > 0


def window_sums(image: NDArray[Any], side_px: int) -> NDArray[Any]:
    """Return the sums in square windows around pixels; beyond the image, shape (h, w), is 0."""
    size = (side_px, side_px)
    sums = cv2.boxFilter(image, -1, size, normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(sums)


def distance_to_masked(valid: Mask) -> FloatImage:
    """Return the distance of each pixel from a masked one, in pixels; infinite without one."""
    if valid.all():
        return np.full(valid.shape, np.inf, np.float32)
    return np.asarray(cv2.distanceTransform(valid.astype(np.uint8), cv2.DIST_L2, 5), np.float32)


def has_negative(known: FloatImage) -> bool:
    """Return whether so many valid grey values, of any shape, are negative as in decibels."""
    return bool(np.count_nonzero(known < 0) > _NEGATIVE_SHARE * known.size)


def sample_of(read: Callable[[Window], Patch], grid: Grid, part: Window | None = None) -> Patch:
    """Return a piece of an image that is mostly valid, from the middle of a part if that is.

    Parameters
    ----------
    read
        Reads windows of the image.
    grid
        The image's pixels.
    part
        The part of the image whose content is asked for; None: all of it.
    """
    fullest = None
    for window in _sample_windows(grid, part or Window(0, 0, *grid.size)):
        patch = read(window)
        if patch.valid_share >= _SAMPLE_SHARE:
            return patch
        if fullest is None or patch.valid.sum() > fullest.valid.sum():
            fullest = patch
    assert fullest is not None
    return fullest


def _sample_windows(grid: Grid, part: Window) -> list[Window]:
    """Return windows all over a part of a grid, those in its middle first."""
    firsts, sides = [], [min(side, _SAMPLE_PX) for side in grid.size]
    for start, length, side, whole in zip(part[:2], part[2:], sides, grid.size, strict=True):
        free = max(length - side, 0)
        low = start + (length - side - free) / 2
        along = low + free * np.linspace(0, 1, _SAMPLES_ALONG)
        firsts.append(np.clip(along, 0, whole - side).astype(int))
    middle = [first[_SAMPLES_ALONG // 2] for first in firsts]
    places = mesh(*firsts)
    order = np.argsort(((places - middle) ** 2).sum(axis=1), kind="stable")
    return list(dict.fromkeys(Window(*place, *sides) for place in places[order].tolist()))


def middle_window(grid: Grid, side_px: int = 2048) -> Window:
    """Return the middle of a grid, at most `side_px` a side, as a sample of the image's content."""
    width, height = min(grid.width, side_px), min(grid.height, side_px)
    return Window((grid.width - width) // 2, (grid.height - height) // 2, width, height)
