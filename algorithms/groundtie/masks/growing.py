"""Region growing from seeds to connected pixels of similar brightness, and the regions' shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.reading import Mask, Window

# Side of the squares that hold at most one seed, in pixels.
_SEED_PX = 8

# Values in OpenCV's mask: pixels that must not be entered; the growing region.
_TAKEN, _GROWING = 1, 2


@dataclass(frozen=True)
class Region:
    """Connected pixels: `mask`, shape (height, width) of their bounding box `box`.

    `level_db` is their mean.
    """

    box: Window
    mask: Mask
    level_db: float


def grow_regions(
    level_db: NDArray[np.float32],
    variation2: NDArray[np.float32],
    valid: Mask,
    seed_variation2: float,
    tolerance_db: float,
    smallest_px: int,
) -> Iterator[Region]:
    """Yield the homogeneous regions of an image, the most homogeneous seed first.

    Region growing [Castleman1996]: a region absorbs neighbours that differ from its seed by no
    more than a tolerance. No pixel belongs to two regions.

    Parameters
    ----------
    level_db
        Smoothed image in decibels, shape (h, w).
    variation2
        Squared coefficient of variation around each pixel, same shape.
    valid
        Pixels that may belong to a region, same shape.
    seed_variation2
        Largest variation of a seed.
    tolerance_db
        Largest difference from the seed.
    smallest_px
        Smaller regions are not returned.
    """
    taken = np.pad((~valid).astype(np.uint8), 1, constant_values=_TAKEN)
    flags = 4 | (_GROWING << 8) | cv2.FLOODFILL_MASK_ONLY | cv2.FLOODFILL_FIXED_RANGE
    image = np.ascontiguousarray(level_db, np.float32)
    for row, col in _seeds(np.where(valid, variation2, np.inf), seed_variation2):
        if taken[row + 1, col + 1]:
            continue
        area, _, _, box = cv2.floodFill(
            image, taken, (int(col), int(row)), 0, tolerance_db, tolerance_db, flags
        )
        window = Window(*box)
        part = taken[1:, 1:][window.slices]
        mask = part == _GROWING
        part[mask] = _TAKEN
        if area >= smallest_px:
            yield Region(window, mask, float(level_db[window.slices][mask].mean()))


def _seeds(variation2: NDArray[np.float32], largest: float) -> NDArray[np.intp]:
    """Return rows and columns, (n, 2), of the least variation in each square, in rising order."""
    height, width = (side // _SEED_PX for side in variation2.shape)
    squares = variation2[: height * _SEED_PX, : width * _SEED_PX]
    squares = squares.reshape(height, _SEED_PX, width, _SEED_PX).swapaxes(1, 2)
    flat = squares.reshape(height, width, _SEED_PX**2)
    place, least = flat.argmin(axis=2), flat.min(axis=2)
    row, col = np.nonzero(least <= largest)
    order = np.argsort(least[row, col], kind="stable")
    row, col = row[order], col[order]
    inner = place[row, col]
    return np.column_stack([row * _SEED_PX + inner // _SEED_PX, col * _SEED_PX + inner % _SEED_PX])


@dataclass(frozen=True)
class Shape:
    """Area, and sides of the rectangle with the region's second moments, in pixels, 1 at least."""

    area: float
    length: float
    width: float

    @classmethod
    def of(cls, region: Mask) -> Shape:
        """Return the shape of a mask, shape (h, w), with at least one pixel."""
        m = cv2.moments(region.astype(np.uint8), binaryImage=True)
        area = m["m00"]
        # Each pixel is a square with second moments of its own.
        xx, yy, xy = m["mu20"] / area + 1 / 12, m["mu02"] / area + 1 / 12, m["mu11"] / area
        middle, half = (xx + yy) / 2, float(np.hypot((xx - yy) / 2, xy))
        sides = np.sqrt(12 * np.array([middle + half, middle - half]))
        return cls(area, float(sides[0]), float(sides[1]))

    @property
    def elongation(self) -> float:
        """Length over width, at least 1."""
        return self.length / self.width
