"""The shape of a region by its moments."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..rasters.reading import Mask


@dataclass(frozen=True)
class Shape:
    """Area, and the sides of the rectangle that has the region's second moments, in pixels."""

    area: float
    length: float
    width: float

    @classmethod
    def of(cls, region: Mask) -> Shape:
        """Return the shape of the pixels of a mask, shape (h, w)."""
        m = cv2.moments(region.astype(np.uint8), binaryImage=True)
        area = m["m00"]
        if area == 0:
            return cls(0.0, 0.0, 0.0)
        # A pixel is a square: it has moments of its own.
        xx, yy, xy = m["mu20"] / area + 1 / 12, m["mu02"] / area + 1 / 12, m["mu11"] / area
        middle, half = (xx + yy) / 2, float(np.hypot((xx - yy) / 2, xy))
        sides = np.sqrt(12 * np.maximum([middle + half, middle - half], 0))
        return cls(area, float(sides[0]), float(sides[1]))

    @property
    def elongation(self) -> float:
        """Length over width, at least 1."""
        return self.length / max(self.width, 1e-9)
