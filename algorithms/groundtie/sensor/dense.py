"""The image position of every pixel of a map grid, as fast as heights can be looked up.

A sensor model is smooth in position and height; terrain is not. So the model is evaluated at a
lattice of pixels and two or three heights that enclose the terrain, and interpolated between
them at the height of each pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import Grid
from .orientation import Orientation
from .smooth_map import Positions

FloatArray = NDArray[np.float64]

# Interpolation between the nodes of the lattice may be wrong by this, in image pixels.
_TOLERANCE_PX = 1e-3
_FIRST_STEP = 64

# Stands for positions that no pixel of the image sees.
_NOWHERE = -1e9

# Heights are enclosed by planes at least so far apart, in metres.
_LEAST_RANGE_M = 10.0


@dataclass(frozen=True)
class DenseOrientation:
    """An orientation as the function that rasters are warped by: see `warping.DenseMap`."""

    orientation: Orientation

    def __call__(self, xy: FloatArray) -> FloatArray:
        """Return image positions, shape (n, 2), of map positions."""
        return self.orientation.to_px(xy)

    def coordinates(self, grid: Grid) -> FloatArray:
        """Return the image column and row of every pixel of a grid, shape (2, height, width)."""
        orientation = self.orientation

        def on_nodes(function: Positions, tolerance: float) -> _Nodes:
            return _fine_enough(grid, lambda xy: function(orientation.to_lon_lat(xy)), tolerance)

        height = orientation.heights.on_pixels(
            lambda function, tolerance: on_nodes(function, tolerance).planes()
        )
        low, high = float(height.min()), float(height.max())
        known = None
        if not np.isfinite([low, high]).all():
            known = np.isfinite(height)
            if not known.any():
                return np.full((2, grid.height, grid.width), _NOWHERE)
            low, high = float(height[known].min()), float(height[known].max())
        middle, reach = (low + high) / 2, max((high - low) / 2, _LEAST_RANGE_M)

        def expansion(lon_lat: FloatArray) -> FloatArray:
            """Return the image position at the middle height, and its change up to the highest."""
            below, level, above = (
                orientation.rpc.project(lon_lat, middle + step * reach) for step in (-1, 0, 1)
            )
            return np.hstack([level, (above - below) / 2, (above + below) / 2 - level])

        nodes = on_nodes(expansion, _TOLERANCE_PX)
        lost = self._lost(grid, height, (low, high))
        height -= middle
        height *= 1 / reach
        bent = np.nanmax(np.abs(nodes.values[..., 4:]), initial=0.0) > _TOLERANCE_PX
        px = np.empty((2, grid.height, grid.width))
        for axis, out in enumerate(px):
            slope = nodes.plane(2 + axis)
            if bent:
                slope = slope + height * nodes.plane(4 + axis)
            np.multiply(slope, height, out=out)
            out += nodes.plane(axis)
        if known is not None or lost is not None or not np.isfinite(px.sum()):
            nowhere = ~np.isfinite(px).all(axis=0)
            px[:, nowhere if lost is None else nowhere | lost] = _NOWHERE
        return px

    def _lost(
        self, grid: Grid, height: FloatArray, bounds: tuple[float, float]
    ) -> NDArray[np.bool_] | None:
        """Tell at which pixels the RPCs do not hold, shape (h, w); None: they do everywhere."""
        rpc, to_lon_lat = self.orientation.rpc, self.orientation.to_lon_lat
        outline = to_lon_lat(grid.pixel_to_map(grid.outline(3)))
        if all(rpc.is_valid(outline, bound).all() for bound in bounds):
            return None
        cols, rows = np.meshgrid(np.arange(grid.width), np.arange(grid.height))
        lon_lat = to_lon_lat(grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()])))
        return ~rpc.is_valid(lon_lat, height.ravel()).reshape(height.shape)


@dataclass(frozen=True)
class _Nodes:
    """Values at the centres of cells of step × step pixels, one cell beyond a grid each way.

    `values` have the shape (rows, cols, k).
    """

    grid: Grid
    step: int
    values: FloatArray

    def plane(self, k: int) -> FloatArray:
        """Return one of the values at all pixels, shape (height, width)."""
        rows, cols = (n * self.step for n in self.values.shape[:2])
        # Resizing takes nodes for centres of cells, as they are.
        whole = cv2.resize(np.ascontiguousarray(self.values[..., k]), (cols, rows))
        return np.asarray(
            whole[self.step : self.step + self.grid.height, self.step : self.step + self.grid.width]
        )

    def planes(self) -> list[FloatArray]:
        """Return all values at all pixels, each of the shape (height, width)."""
        return [self.plane(k) for k in range(self.values.shape[2])]


def _fine_enough(
    grid: Grid, function: Callable[[FloatArray], FloatArray], tolerance: float
) -> _Nodes:
    """Return a smooth function of map positions at nodes between which it can be interpolated.

    It is evaluated at a lattice that is halved until it is good enough halfway between nodes; NaN
    where the function is.

    Parameters
    ----------
    grid
        The pixels.
    function
        Takes map positions, (n, 2), to values, (n, k).
    tolerance
        Largest error.
    """
    step = _FIRST_STEP
    while True:
        nodes = _evaluate(grid, function, step, 0.5)
        unknown = np.isnan(nodes).any(axis=2)
        if step == 1 or unknown.all():
            break
        between = _evaluate(grid, function, step, 1.0)[:-1, :-1]
        mean = (nodes[:-1, :-1] + nodes[1:, :-1] + nodes[:-1, 1:] + nodes[1:, 1:]) / 4
        if not unknown.any() and np.abs(mean - between).max() < tolerance:
            break
        step //= 2
    return _Nodes(grid, step, nodes)


def _evaluate(
    grid: Grid, function: Callable[[FloatArray], FloatArray], step: int, phase: float
) -> FloatArray:
    """Return the function at a lattice that reaches beyond a grid by a cell, (rows, cols, k)."""
    rows, cols = (
        (np.arange(-1, -(-side // step) + 1) + phase) * step - 0.5
        for side in (grid.height, grid.width)
    )
    px = np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)
    return function(grid.pixel_to_map(px)).reshape(len(rows), len(cols), -1)
