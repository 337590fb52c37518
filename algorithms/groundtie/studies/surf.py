"""SURF keypoints ([Bay2008]; [Patel2017] 4.2): blobs, found by the Hessian of box filters.

SURF's authors held patents, which may still be in force in some countries.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..features.detectors import seen_whole, to_grey
from ..features.keypoints import Keypoints
from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..similarity.orientation import compress
from .box_hessian import FloatImage, determinants, integral_image, sigma_of

# Number of octaves of blob size ([Bay2008] 3.2).
_OCTAVES = 3


@dataclass(frozen=True)
class SurfDetector:
    """Detects blobs in an image, with their sizes.

    Parameters
    ----------
    threshold
        Least determinant of a feature's Hessian, for grey values from 0 to 1 ([Patel2017]: 0.0005
        to 0.002).
    """

    threshold: float = 0.0004

    def detect(self, window: Patch, context: Context | None = None) -> Keypoints:
        """Return the features of an image window, upright.

        Parameters
        ----------
        window
            The image; features whose support includes masked pixels are left out.
        context
            Provides threads; None: the current one only.
        """
        if window.is_flat:
            return Keypoints.none()
        grey = to_grey(compress(window), window.valid)
        found = self.detect_image(grey.astype(np.float32) / np.float32(255), context)
        return found.take(seen_whole(found, window.valid))

    def detect_image(self, image: FloatImage, context: Context | None = None) -> Keypoints:
        """Return the features of an image with grey values from 0 to 1, shape (h, w)."""
        integral = integral_image(image)
        tables = [Keypoints.none()]
        for octave in range(_OCTAVES):
            sides = octave_sides(octave)
            if max(sides) > min(image.shape):
                break
            layers = determinants(integral, sides, 2**octave, context)
            for middle in (1, 2):
                three = layers[middle - 1 : middle + 2]
                tables.append(_peaks(three, sides, middle, octave, self.threshold))
        return Keypoints.concatenate(tables)


def octave_sides(octave: int) -> tuple[int, ...]:
    """Return the sides of an octave's four filters: 9, 15, 21, 27, then 15, 27, 39, 51 and so on.

    The sizes of features lie between those of the first and the last filter; octaves overlap.
    """
    spacing = 6 * 2**octave
    first = 3 + spacing
    return tuple(first + spacing * layer for layer in range(4))


def _peaks(
    layers: list[FloatImage], sides: tuple[int, ...], middle: int, octave: int, threshold: float
) -> Keypoints:
    """Return the peaks of the middle of three layers: maxima over neighbours in all three."""
    around = np.ones((3, 3), np.uint8)
    highest = np.maximum.reduce([cv2.dilate(layer, around) for layer in layers])
    at = (layers[1] > threshold) & (layers[1] >= highest)
    rows, cols = np.nonzero(at)
    inside = (rows > 0) & (cols > 0) & (rows < at.shape[0] - 1) & (cols < at.shape[1] - 1)
    rows, cols = rows[inside], cols[inside]
    offset, height = _vertices(layers, rows, cols)
    # A vertex a step or more from its lattice position belongs to another position, or to none.
    near = np.abs(offset).max(axis=1, initial=0.0) < 1
    offset, height, rows, cols = offset[near], height[near], rows[near], cols[near]
    position = 2**octave * (np.column_stack([cols, rows]) + offset[:, :2])
    side = sides[middle] + offset[:, 2] * (sides[1] - sides[0])
    return Keypoints(position, sigma_of(side), np.zeros(len(position)), height)


def _vertices(
    layers: list[FloatImage], rows: NDArray[np.intp], cols: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Return the offsets and heights of the vertices of quadratics fitted to peaks ([Brown2002]).

    The offsets are along columns, rows and layers, shape (n, 3).
    """

    def value(x: int, y: int, z: int) -> FloatArray:
        return layers[1 + z][rows + y, cols + x].astype(np.float64)

    axes = np.eye(3, dtype=int)
    centre = value(0, 0, 0)
    slope = np.stack([(value(*a) - value(*-a)) / 2 for a in axes], axis=-1)
    bend = np.empty((len(rows), 3, 3))
    for i, j in product(range(3), repeat=2):
        a, b = axes[i], axes[j]
        if i == j:
            bend[:, i, i] = value(*a) - 2 * centre + value(*-a)
        else:
            bend[:, i, j] = (value(*a + b) - value(*a - b) - value(*b - a) + value(*-a - b)) / 4
    offset = -_solved(bend, slope)
    return offset, centre + (slope * offset).sum(axis=1) / 2


def _solved(matrices: FloatArray, sides: FloatArray) -> FloatArray:
    """Return the solutions of linear systems; infinite for singular systems."""
    good = np.abs(np.linalg.det(matrices)) > 0
    solution = np.full(sides.shape, np.inf)
    solution[good] = np.linalg.solve(matrices[good], sides[good][..., None])[..., 0]
    return solution
