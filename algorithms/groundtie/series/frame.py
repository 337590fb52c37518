"""The frame of a series, in which displacements of its dates are measured and composed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from affine import Affine

from ..geometry.models import Frame, PolynomialModel, monomials
from ..rasters.grid import (
    FloatArray,
    Grid,
    PointFunction,
    compose,
    linear_part,
    mesh,
    metres_per_unit_at,
    reproject,
)

# Parameters of a displacement: the shift, and its change along either axis, (x, y) each.
PARAMETERS = 6

# Samples of a move along each side of the square: a plane needs two; curvature averages out.
_SAMPLES = 5

# Mean squares of a displacement's terms over the frame: 1, u and v, which are uniform over ±1, with
# a variance of 1/3, and independent.
_OVER_FRAME = (1, 1 / 3, 1 / 3)

# Smaller differences are due to rounding: of grids' corners, or of the linear part of a shift, at
# the frame's border.
ROUNDING_PX = 1e-6


@dataclass(frozen=True)
class SeriesFrame:
    """A grid on the map, and a square on it in which positions are within ±1.

    A displacement is a vector of six numbers, in pixels of the grid: the shift at the centre, its
    change to the right border, and its change to the lower border; x before y.

    Parameters
    ----------
    grid
        The grid.
    centre_px
        Pixel position of the square's centre.
    half_px
        Half the square's side.
    """

    grid: Grid
    centre_px: tuple[float, float]
    half_px: float

    def to_json(self) -> dict[str, Any]:
        """Return the frame as JSON values."""
        return {
            **self.grid.to_json(),
            "centre_px": list(self.centre_px),
            "half_px": self.half_px,
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> SeriesFrame:
        """Return the frame that `to_json` described; errors as `Grid.from_json`."""
        half = float(values["half_px"])
        if not half > 0:
            raise ValueError("the frame has no size")
        col, row = map(float, values["centre_px"])
        return cls(Grid.from_json(values), (col, row), half)

    @classmethod
    def around(cls, hub: Grid, dates: Sequence[Grid]) -> SeriesFrame:
        """Return the frame of a series by the grids of its hub and of its dates.

        Its pixel size is the hub's, or the median of the dates' if that is coarser. Its square is
        that of the median date, so that a single date elsewhere does not move it.
        """
        factor = float(np.median([grid.pixel_size_m for grid in dates])) / hub.pixel_size_m
        grid = hub.scaled(max(factor, 1.0))
        boxes = [_box(grid, date) for date in dates]
        low, high = np.median([box for box in boxes if np.isfinite(box).all()], axis=0)
        centre = (low + high) / 2
        half = float((high - low).max() / 2)
        return cls(grid, (float(centre[0]), float(centre[1])), half)

    def is_of(self, hub: Grid) -> bool:
        """Return whether the frame is one around a hub of this grid, at any pixel size."""
        factor = self.grid.pixel_size[0] / hub.pixel_size[0]
        made = hub.scaled(max(factor, 1.0))
        corners = self.grid.map_to_pixel(made.pixel_to_map(made.outline(1)))
        is_there = np.allclose(corners, self.grid.outline(1), rtol=0, atol=ROUNDING_PX)
        return is_there and (made.crs, made.width) == (self.grid.crs, self.grid.width)

    @property
    def square(self) -> Frame:
        """The square's coordinates, as a frame on the map."""
        scale = Affine.scale(self.half_px)
        moved = Affine.translation(*self.centre_px)
        return Frame(compose(self.grid.centre_transform, moved, scale))

    def displacement_of(self, move: PointFunction) -> FloatArray:
        """Return the least-squares displacement, (6,), of a move of map positions."""
        side = np.linspace(-1, 1, _SAMPLES)
        uv, square = mesh(side, side), self.square
        moved = (square.enter(move(square.leave(uv))) - uv) * self.half_px
        return np.asarray(np.linalg.lstsq(monomials(uv, 1), moved, rcond=None)[0]).ravel()

    def matrix(self, displacement: FloatArray) -> FloatArray:
        """Return a displacement as a matrix of homogeneous positions of the square, (3, 3)."""
        shift, along_u, along_v = displacement.reshape(3, 2) / self.half_px
        matrix = np.eye(3)
        matrix[:2] += np.column_stack([along_u, along_v, shift])
        return matrix

    def of_matrix(self, matrix: FloatArray) -> FloatArray:
        """Return the displacement, (6,), of a matrix."""
        rise = matrix - np.eye(3)
        return np.asarray(rise[:2][:, [2, 0, 1]].T.ravel() * self.half_px)

    def model(self, displacement: FloatArray) -> PolynomialModel:
        """Return a displacement as a model of map positions."""
        coefficients = displacement.reshape(3, 2) / self.half_px
        if np.abs(displacement[2:]).max() < ROUNDING_PX:
            return PolynomialModel("translation", self.square, coefficients[:1])
        return PolynomialModel("affine", self.square, coefficients)

    @property
    def metres_per_unit(self) -> FloatArray:
        """Metres per map unit along x and y at the square's centre, shape (2,)."""
        return metres_per_unit_at(self.square.leave(np.zeros((1, 2))), self.grid.crs)[0]

    def sigma_m(self, covariance: FloatArray) -> float:
        """Return `sigma_px` in metres (in pixels without georeferencing)."""
        ground = self.metres_per_unit[:, None] * linear_part(self.grid.transform)
        return _deviation(ground @ _spread(covariance) @ ground.T)

    def moved_grid(self, grid: Grid, displacement: FloatArray) -> Grid:
        """Return a date's grid, shifted to undo a displacement at the frame's centre."""
        ground = self.square.leave(np.zeros((1, 2)))
        nominal = self.square.leave(displacement[None, :2] / self.half_px)
        there, here = (reproject(xy, self.grid.crs, grid.crs) for xy in (ground, nominal))
        return grid.shifted(*map(float, (there - here)[0]))


def rms_px(displacement: FloatArray) -> float:
    """Return the root mean square length of a displacement, (6,), over the frame."""
    squared = (displacement.reshape(3, 2) ** 2).sum(axis=1)
    return float(np.sqrt(squared @ _OVER_FRAME))


def sigma_px(covariance: FloatArray) -> float:
    """Return the standard deviation over the frame, both axes together, by a covariance (6, 6)."""
    return _deviation(_spread(covariance))


def _spread(covariance: FloatArray) -> FloatArray:
    """Return the mean covariance of positions over the frame, (2, 2), of a displacement's."""
    return np.asarray(np.einsum("iaib,i->ab", covariance.reshape(3, 2, 3, 2), _OVER_FRAME))


def _deviation(spread: FloatArray) -> float:
    return float(np.sqrt(max(np.trace(spread), 0.0)))


def _box(grid: Grid, date: Grid) -> FloatArray:
    """Return the corners of a date's bounding box in pixels of a grid, shape (2, 2)."""
    px = date.to_pixels_of(grid)(date.pixel_to_map(date.outline()))
    return np.array([px.min(axis=0), px.max(axis=0)])
