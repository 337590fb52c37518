"""Pixel positions, and other smooth functions of the map, at all pixels of a grid.

They are interpolated between the nodes of a lattice.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from .grid import FloatArray, Grid, PointFunction, mesh
from .kernels import CACHED_PIXELS
from .windows import Window

_FIRST_STEP = 64

# Largest error of pixel positions interpolated between the nodes of a lattice.
_TOLERANCE_PX = 0.005

# Positions nearer than this to a pixel centre lie on it: map coordinates have no more digits.
ON_PIXELS = 1e-6

# Replaces positions that are not finite: outside of every image.
NOWHERE = -1e9


@runtime_checkable
class DenseMap(Protocol):
    """A map from a grid to input pixels that evaluates all pixels of a grid by its own method.

    It need not be smooth: terrain, for example, may have steps anywhere.
    """

    def __call__(self, xy: FloatArray) -> FloatArray:
        """Return the input pixels (col, row), shape (n, 2), at map positions (n, 2)."""

    def coordinates(self, grid: Grid) -> FloatArray:
        """Return the input column and row of every pixel of a grid, shape (2, height, width)."""


@dataclass(frozen=True)
class Lattice:
    """Values at the centres of cells of step × step pixels, one cell beyond the grid each way.

    Parameters
    ----------
    grid
        The pixels.
    step
        Side of a cell in pixels.
    values
        Shape (k, rows, cols), any floating-point type.
    """

    grid: Grid
    step: int
    values: NDArray[Any]

    def minus(self, origin: FloatArray) -> Lattice:
        """Return the values minus `origin`, (k,), in single precision."""
        left = self.values - np.reshape(origin, (-1, 1, 1))
        return replace(self, values=left.astype(np.float32))

    def bounds(self) -> NDArray[Any]:
        """Return the smallest and largest values at pixels, shape (2, k); NaN if any is unknown."""
        rows, cols = (
            np.unique(np.clip((np.arange(-1, nodes - 1) + 0.5) * self.step - 0.5, 0, side - 1))
            for nodes, side in zip(
                self.values.shape[1:], (self.grid.height, self.grid.width), strict=True
            )
        )
        along = self._between(self.values, rows)
        at = self._between(along.swapaxes(1, 2), cols)
        return np.stack([at.min(axis=(1, 2)), at.max(axis=(1, 2))])

    def lines(self, rows: slice) -> NDArray[Any]:
        """Return the values at all pixels of some rows, shape (k, rows, width)."""
        nodes = self._lines[:, rows]
        count, height, width = nodes.shape
        # Resizing takes nodes as the centres of cells, as they are.
        whole = cv2.resize(nodes.reshape(-1, width), (width * self.step, count * height))
        within = slice(self.step, self.step + self.grid.width)
        return np.asarray(whole.reshape(count, height, -1)[..., within])

    def coordinates(self) -> FloatArray:
        """Return the values, which must be pixel positions, at all pixels: (2, height, width).

        Unknown values become `NOWHERE`.
        """
        px = np.empty((2, self.grid.height, self.grid.width))
        for rows in row_strips(self.grid.height, self.grid.width):
            px[:, rows] = self.lines(rows)
        if np.isnan(self.values).any():
            px[np.isnan(px)] = NOWHERE
        return px

    def window(self) -> Window | None:
        """Return the window of pixels that coincide with the grid's, if values are pixel positions.

        None: the positions lie between pixels, or are not those of adjacent pixels.
        """
        rows, cols = (np.arange(n) * self.step for n in self.values.shape[1:])
        corner = self.values - np.stack(np.meshgrid(cols, rows))
        # The first node lies half a cell before the first pixel's corner.
        first = np.rint(corner[:, 0, 0] + (self.step + 1) / 2)
        if not np.abs(corner + (self.step + 1) / 2 - first[:, None, None]).max() < ON_PIXELS:
            return None
        return Window(int(first[0]), int(first[1]), self.grid.width, self.grid.height)

    def lies_within(self, width: int, height: int) -> bool:
        """Return whether the values, as pixel positions, all lie in an image of this size."""
        low, high = self.bounds()
        return bool(np.all((low > -0.49) & (high < np.array([width, height]) - 0.51)))

    @cached_property
    def _lines(self) -> NDArray[Any]:
        """The values at the columns of nodes in all rows of pixels, shape (k, height, cols)."""
        return self._between(self.values, np.arange(self.grid.height))

    def _between(self, values: NDArray[Any], places: NDArray[Any]) -> NDArray[Any]:
        """Interpolate values, (k, nodes, m), to rows of pixels: (k, places, m)."""
        place = (places + 0.5) / self.step + 0.5
        above = place.astype(int)
        share = (place - above).astype(values.dtype)[:, None]
        mixed = values[:, above] * (1 - share) + values[:, above + 1] * share
        # On a node, the next node carries no weight, even if it is unknown.
        return np.where(share > 0, mixed, values[:, above])


def coordinates(grid: Grid, to_input_px: PointFunction) -> FloatArray:
    """Return the input column and row of every pixel of a grid, shape (2, height, width).

    Accurate to 0.01 px; positions that are not finite become `NOWHERE`. `to_input_px` takes map
    positions of the grid, shape (n, 2), to input pixels (col, row), shape (n, 2).
    """
    if isinstance(to_input_px, DenseMap):
        return to_input_px.coordinates(grid)
    return lattice(grid, to_input_px).coordinates()


def row_strips(height: int, width: int) -> Iterator[slice]:
    """Yield the rows of an array in parts that fit into the processor's cache."""
    lines = max(CACHED_PIXELS // width, 1)
    for first in range(0, height, lines):
        yield slice(first, min(first + lines, height))


def lattice(
    grid: Grid,
    function: PointFunction,
    tolerance: float = _TOLERANCE_PX,
    domain_px: float = np.inf,
) -> Lattice:
    """Evaluate a function on a lattice, refined until it interpolates well midway between nodes.

    Parameters
    ----------
    grid
        The pixels.
    function
        A smooth function, mostly from map positions to input pixels, shapes (n, 2). Values that are
        not finite become NaN. It is evaluated up to a cell beyond the grid.
    tolerance
        Largest error.
    domain_px
        Width, in pixels, of the area where the function is known; if it is small, the first nodes
        are so near that one lies in it.
    """
    # A circle as wide as a square's diagonal holds one of its corners, however it is turned.
    step = int(np.clip(np.sqrt(2) * domain_px, 1, _FIRST_STEP))
    while step > 1:
        # Also evaluated halfway between nodes, along rows, columns and both.
        finer = _evaluate(grid, function, step, 2)
        nodes, halfway = finer[:, ::2, ::2], finer[:, 1::2]
        rows, cols = nodes[:, :-1] + nodes[:, 1:], nodes[..., :-1] + nodes[..., 1:]
        errors = (
            halfway[..., ::2] - rows / 2,
            finer[:, ::2, 1::2] - cols / 2,
            halfway[..., 1::2] - (cols[:, :-1] + cols[:, 1:]) / 4,
        )
        error = max(np.abs(error).max() for error in errors)
        if error < tolerance or np.isnan(finer).all():
            return Lattice(grid, step, nodes)
        step //= 2
        # The error of linear interpolation falls with the square of the step, at best.
        while step > 1 and error / 4 > tolerance:
            step, error = step // 2, error / 4
    return Lattice(grid, 1, _evaluate(grid, function, 1, 1))


def _evaluate(grid: Grid, function: PointFunction, step: int, parts: int) -> FloatArray:
    """Return a function's values, (k, rows, cols), at `parts` places per step of a lattice."""
    rows, cols = (
        np.arange(-parts, parts * -(-side // step) + 1) * (step / parts) + (step - 1) / 2
        for side in (grid.height, grid.width)
    )
    px = mesh(cols, rows)
    values = np.asarray(function(grid.pixel_to_map(px)), float).T
    return np.where(np.isfinite(values), values, np.nan).reshape(-1, len(rows), len(cols))
