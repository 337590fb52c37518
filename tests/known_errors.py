"""Transforms that are off by a known shift, places, and errors with known statistics."""

from __future__ import annotations

import math

import numpy as np
from affine import Affine
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid

GRID = utm_grid(400, 300)
PLAIN = Grid(PIXEL_COORDINATES, None, 400, 300)
LONLAT = CRS.from_epsg(4326)
DEGREES = Grid(Affine(1e-4, 0, 9.0, 0, -1e-4, 45.15), LONLAT, 400, 300)


def shifted(dx: float, dy: float, grid: Grid = GRID, crs: CRS | None = UTM) -> Transform:
    """Return the transform of an input that claims to lie off by map units."""
    model = PolynomialModel("translation", Frame(Affine.identity()), np.array([[dx, dy]]))
    return Transform(model, crs, grid)


def places(count: int = 40, grid: Grid = GRID) -> np.ndarray:
    size = [grid.width - 1, grid.height - 1]
    return grid.pixel_to_map(np.random.default_rng(0).uniform([0, 0], size, (count, 2)))


def normal_errors(count: int, sigma: float) -> np.ndarray:
    """Return errors whose lengths are the quantiles of a circular normal distribution."""
    share = (np.arange(count) + 0.5) / count
    radius = sigma * np.sqrt(-2 * np.log(1 - share))
    angle = np.arange(count) * math.pi * (3 - math.sqrt(5))
    return radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
