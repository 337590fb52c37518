"""Image positions of all pixels of a map grid, as fast as heights can be looked up.

A sensor model is smooth in position and height; terrain is not. The model is therefore evaluated on
a lattice of pixels at three heights that enclose the terrain, and interpolated to the height of
each pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import POSITION_ERROR_PX, FloatArray, Grid, PointFunction, mesh
from ..rasters.lattice import NOWHERE, Lattice, lattice, row_strips
from ..rasters.reading import FloatImage
from .orientation import Orientation

# Least distance between the three heights, in metres.
_LEAST_RANGE_M = 10.0

# Most pixels a side of a terrain model held in memory: it may be much finer than the image.
_LARGEST_PX = 4096


@dataclass(frozen=True)
class DenseOrientation:
    """An orientation as a function to warp rasters by: see `lattice.DenseMap`."""

    orientation: Orientation

    def __call__(self, xy: FloatArray) -> FloatArray:
        """Return image positions, shape (n, 2), of map positions."""
        return self.orientation.to_px(xy)

    def coordinates(self, grid: Grid) -> FloatArray:
        """Return the image column and row of every pixel of a grid, shape (2, height, width)."""
        orientation = self.orientation
        px = np.empty((2, grid.height, grid.width))

        def on_nodes(function: PointFunction, tolerance: float) -> Lattice:
            domain_px = orientation.domain / max(grid.pixel_size)
            return lattice(
                grid, lambda xy: function(orientation.to_lon_lat(xy)), tolerance, domain_px
            )

        heights = orientation.heights.on_grid(grid, on_nodes)
        if heights is None:
            px.fill(NOWHERE)
            return px
        if heights.side_px > _LARGEST_PX and grid.height > 1:
            half = grid.height // 2
            for first, lines in ((0, half), (half, grid.height - half)):
                part = grid.window(0, first, grid.width, lines)
                px[:, first : first + lines] = self.coordinates(part)
            return px
        low, high = heights.bounds_m
        middle, reach = (low + high) / 2, max((high - low) / 2, _LEAST_RANGE_M)

        def expansion(lon_lat: FloatArray) -> FloatArray:
            """Return a, b and c of `_Parabolas`, each a column and a row, shape (n, 6)."""
            below, level, above = (
                orientation.rpc.project(lon_lat, middle + step * reach) for step in (-1, 0, 1)
            )
            return np.hstack([level, (above - below) / 2, (above + below) / 2 - level])

        parabolas = _Parabolas.at_nodes(on_nodes(expansion, POSITION_ERROR_PX))
        everywhere = self._holds_everywhere(grid, (low, high))
        for rows in row_strips(grid.height, grid.width):
            height = heights.lines(rows)
            seen = parabolas.at((height - np.float32(middle)) * np.float32(1 / reach), rows)
            np.add(seen, parabolas.origin[:, None, None], out=px[:, rows])
            lost = ~np.asarray(np.isfinite(seen[0] + seen[1]))
            if not everywhere:
                lost |= self._lost(grid, height, rows)
            if lost.any():
                px[:, rows][:, lost] = NOWHERE
        return px

    def _holds_everywhere(self, grid: Grid, bounds_m: tuple[float, float]) -> bool:
        """Return whether the RPCs are valid at all pixels of a grid and heights within bounds."""
        outline = self.orientation.to_lon_lat(grid.pixel_to_map(grid.outline(3)))
        return all(self.orientation.rpc.is_valid(outline, bound).all() for bound in bounds_m)

    def _lost(self, grid: Grid, height: FloatImage, rows: slice) -> NDArray[np.bool_]:
        """Return a mask of the pixels of some rows at which the RPCs are not valid."""
        xy = grid.pixel_to_map(mesh(np.arange(grid.width), np.arange(grid.height)[rows]))
        lon_lat = self.orientation.to_lon_lat(xy)
        return ~self.orientation.rpc.is_valid(lon_lat, height.ravel()).reshape(height.shape)


@dataclass(frozen=True)
class _Parabolas:
    """Image positions as parabolas a + b t + c t² of the height, t from -1 to 1.

    Single precision suffices for differences within a grid.

    Parameters
    ----------
    origin
        Column and row that are subtracted from a, shape (2,).
    terms
        a, b and, unless it is negligible, c; each a column and a row.
    """

    origin: FloatArray
    terms: Lattice

    @classmethod
    def at_nodes(cls, nodes: Lattice) -> _Parabolas:
        """Return the parabolas of a lattice of a, b and c, each a column and a row."""
        known = nodes.values[:2, np.isfinite(nodes.values).all(axis=0)]
        origin = known.mean(axis=1) if known.size else np.zeros(2)
        bent = np.nanmax(np.abs(nodes.values[4:]), initial=0.0) > POSITION_ERROR_PX
        kept = replace(nodes, values=nodes.values[: 6 if bent else 4])
        return cls(origin, kept.minus(np.append(origin, np.zeros(len(kept.values) - 2))))

    def at(self, t: FloatImage, rows: slice) -> FloatImage:
        """Return positions relative to the origin, (2, rows, width), at heights t of some rows."""
        coefficients = self.terms.lines(rows).reshape(-1, 2, *t.shape)
        value = coefficients[-1]
        for lower in coefficients[-2::-1]:
            value = value * t
            value += lower
        return np.asarray(value)
