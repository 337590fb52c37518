"""Tiles in which keypoints are found, and interfaces of their detectors and descriptors."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask, Window
from .keypoints import Keypoints

# Side of tiles, and the margin beyond their border that keypoints near it depend on.
TILE_PX = 1024
MARGIN_PX = 64


class Detecting(Protocol):
    """Detector of keypoints."""

    def detect(self, window: Patch) -> Keypoints:
        """Return the keypoints of an image window, upright."""


class Describing(Protocol):
    """Descriptor of keypoints."""

    def describe(self, window: Patch, found: Keypoints) -> tuple[Keypoints, FloatImage]:
        """Return m keypoints, which may be repeated, and their descriptors, shape (m, k)."""


def inside(px: FloatArray, window: Window) -> Mask:
    """Return whether positions (col, row), shape (n, 2), lie on the pixels of a window."""
    at = np.rint(px)
    low = np.array([window.col, window.row])
    return np.asarray(np.all((at >= low) & (at < low + [window.width, window.height]), axis=1))
