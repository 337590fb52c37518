"""Heights above the ellipsoid: constant, or from a raster whose vertical datum is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..errors import GeoreferencingError, NoOverlapError, RasterContentError
from ..rasters.grid import (
    LON_LAT,
    POSITION_ERROR_PX,
    FloatArray,
    Grid,
    PointFunction,
    full_turn,
    near_longitude,
)
from ..rasters.height_surfaces import RasterSurface, SurfacePiece, surface_around
from ..rasters.lattice import Lattice
from ..rasters.reading import FloatImage, RasterSource
from .smooth_map import smooth_map

# Takes a smooth function of longitude and latitude, (n, 2) → (n, k), and the largest tolerated
# error; returns the function's values for all pixels of a grid.
OnNodes = Callable[[PointFunction, float], Lattice]

# Largest error of interpolation between nodes, in metres.
_TOLERANCE_M = 1e-3

# Largest gap of global grids where their first and last columns meet, in pixels.
_WHOLE_PX = 1.0


@dataclass(frozen=True)
class ConstantHeight:
    """The same height everywhere, in metres above the ellipsoid."""

    height_m: float

    @property
    def typical_m(self) -> float:
        """A height of the region."""
        return self.height_m

    @property
    def continued(self) -> ConstantHeight:
        """These heights, which are known everywhere."""
        return self

    def is_measured(self, lon_lat: FloatArray) -> NDArray[np.bool_]:
        """Return that the height is known everywhere, shape (n,)."""
        return np.ones(len(lon_lat), bool)

    def at(self, lon_lat: FloatArray) -> FloatArray:
        """Return heights in metres, shape (n,)."""
        return np.full(len(lon_lat), self.height_m)

    def on_grid(self, grid: Grid, on_nodes: OnNodes) -> HeightsOnGrid | None:
        """Return the height at all pixels of a grid."""
        return _ConstantOnGrid(self.height_m, grid)


@dataclass(frozen=True)
class _ConstantOnGrid:
    height_m: float
    grid: Grid
    side_px: ClassVar[float] = 0.0

    @property
    def bounds_m(self) -> tuple[float, float]:
        """The height, twice."""
        return self.height_m, self.height_m

    def lines(self, rows: slice) -> FloatImage:
        """Return the height at the pixels of some rows."""
        lines = len(range(self.grid.height)[rows])
        return np.full((lines, self.grid.width), self.height_m, np.float32)


@dataclass(frozen=True)
class TerrainHeights:
    """Heights of a terrain model.

    Parameters
    ----------
    terrain
        The model.
    geoid
        Geoid that the model's heights count from, as heights above the ellipsoid; None: they count
        from the ellipsoid.
    """

    terrain: RasterSurface
    geoid: RasterSurface | None = None

    @property
    def typical_m(self) -> float:
        """A height of the region: the median of the terrain model plus that of the geoid."""
        geoid = 0.0 if self.geoid is None else float(np.median(self.geoid.filled))
        return float(np.median(self.terrain.filled)) + geoid

    @property
    def continued(self) -> TerrainHeights:
        """These heights, where they are not known those of the nearest rim of the terrain model."""
        return replace(self, terrain=replace(self.terrain, fills_open=True, margin_px=np.inf))

    def is_measured(self, lon_lat: FloatArray) -> NDArray[np.bool_]:
        """Return where heights are the terrain model's own, not filled into voids, shape (n,)."""
        return self.terrain.is_measured(lon_lat) & np.isfinite(self.at(lon_lat))

    def at(self, lon_lat: FloatArray) -> FloatArray:
        """Return heights in metres, shape (n,), at longitudes and latitudes; NaN if unknown."""
        heights = self.terrain.at(lon_lat)
        if self.geoid is not None:
            heights = heights + _undulation_m(self.geoid, lon_lat)
        return heights

    def on_grid(self, grid: Grid, on_nodes: OnNodes) -> HeightsOnGrid | None:
        """Return the heights at all pixels of a grid; None if no height is known."""
        place = on_nodes(self.terrain.to_px, POSITION_ERROR_PX)
        geoid = None
        if self.geoid is not None:
            surface = self.geoid
            geoid = on_nodes(lambda lon_lat: _undulation_m(surface, lon_lat)[:, None], _TOLERANCE_M)
        known = place.values[:, np.isfinite(place.values).all(axis=0)].T
        if not len(known) or (geoid is not None and np.isnan(geoid.values).all()):
            return None
        return _TerrainOnGrid(self, known, place, geoid)


@dataclass(frozen=True)
class _TerrainOnGrid:
    """Heights of a terrain model at all pixels of a grid.

    Parameters
    ----------
    heights
        The model.
    corners
        Positions in the model that enclose the grid, shape (n, 2).
    place
        Columns and rows of the grid's pixels in the model.
    geoid
        Heights of the geoid.
    """

    heights: TerrainHeights
    corners: FloatArray
    place: Lattice
    geoid: Lattice | None

    @property
    def side_px(self) -> float:
        """Number of the model's pixels along the grid's longer side."""
        return float(np.ptp(self.corners, axis=0).max())

    @cached_property
    def _piece(self) -> SurfacePiece:
        return self.heights.terrain.piece(self.corners)

    @cached_property
    def _local(self) -> Lattice:
        return self.place.minus(self._piece.corner)

    @property
    def bounds_m(self) -> tuple[float, float]:
        """Bounds that no height exceeds."""
        image = self._piece.image
        geoid = np.zeros(1) if self.geoid is None else self.geoid.values
        low, high = float(np.nanmin(geoid)), float(np.nanmax(geoid))
        # Bounds of 0 do no harm to a piece without heights: all its pixels are unknown.
        lowest, highest = np.nan_to_num([np.fmin.reduce(image, None), np.fmax.reduce(image, None)])
        return float(lowest) + low, float(highest) + high

    def lines(self, rows: slice) -> FloatImage:
        """Return heights in metres at the pixels of some rows; NaN if unknown."""
        height = self._piece.at(self._local.lines(rows))
        if self.geoid is not None:
            height += self.geoid.lines(rows)[0]
        return height


Heights = ConstantHeight | TerrainHeights
HeightsOnGrid = _ConstantOnGrid | _TerrainOnGrid


def terrain_heights(
    dem: RasterSource, geoid: RasterSource | None, lon_lat: FloatArray
) -> TerrainHeights:
    """Return the heights of a terrain model over a region.

    Parameters
    ----------
    dem
        The terrain model, in any CRS. Voids are filled from their rims, unless they are open to the
        region's edge.
    geoid
        Heights of the geoid that the model's heights count from; None: they count from the
        ellipsoid.
    lon_lat
        Positions that enclose the region, shape (n, 2).

    Raises
    ------
    GeoreferencingError, NoOverlapError, RasterContentError
        One of the rasters has no CRS, does not cover the region, or holds no value there.
    """
    terrain = surface_over(dem, lon_lat)
    if geoid is None:
        return TerrainHeights(terrain)
    try:
        return TerrainHeights(terrain, replace(surface_over(geoid, lon_lat), margin_px=_WHOLE_PX))
    except (GeoreferencingError, NoOverlapError, RasterContentError) as error:
        raise type(error)(f"the geoid cannot be used: {error}") from error


def _undulation_m(geoid: RasterSurface, lon_lat: FloatArray) -> FloatArray:
    """Return the heights of a geoid, shape (n,); global ones continue from the last column."""
    values = geoid.at(lon_lat)
    grid = geoid.source.grid
    turn = full_turn(grid.crs)
    if turn is None:
        return values
    col = geoid.to_px(lon_lat)[:, 0]
    beyond = col - np.clip(col, 0, grid.width - 1)
    gap = np.flatnonzero(np.isfinite(values) & (beyond != 0))
    if gap.size:
        # The gap is as wide as a pixel; its other side is the column at the grid's other end.
        share = np.abs(beyond[gap])
        step_deg = np.sign(beyond[gap]) * (1 - share) * grid.pixel_size[0] * 360 / turn
        across = geoid.at(lon_lat[gap] + np.outer(step_deg, [1.0, 0.0]))
        values[gap] += np.where(np.isfinite(across), share * (across - values[gap]), 0.0)
    return values


def require_crs(source: RasterSource) -> CRS:
    """Return a raster's CRS, which relates it to the longitudes and latitudes of RPCs.

    Raises
    ------
    GeoreferencingError
        The raster has no CRS.
    """
    if source.grid.crs is None:
        raise GeoreferencingError(f"{source.path} has no CRS")
    return source.grid.crs


def surface_over(source: RasterSource, lon_lat: FloatArray) -> RasterSurface:
    """Return the surface of a raster over a region.

    Parameters
    ----------
    source
        The raster.
    lon_lat
        Positions that enclose the region, shape (n, 2).

    Raises
    ------
    GeoreferencingError
        The raster has no CRS.
    NoOverlapError, RasterContentError
        See `surface_around`.
    """
    require_crs(source)
    grid = source.grid
    corner, opposite = lon_lat.min(axis=0), lon_lat.max(axis=0)
    middle = (corner + opposite)[0] / 2

    def exact(places: FloatArray) -> FloatArray:
        xy = grid.to_own_map(places, LON_LAT)
        return grid.map_to_pixel(np.where(np.isfinite(xy), xy, np.nan))

    surface = surface_around(source, exact, lon_lat, fill_open=False)
    around = 0.05 * (opposite - corner) + 1e-4
    fast = smooth_map(exact, corner - around, opposite + around, POSITION_ERROR_PX)

    def to_px(places: FloatArray) -> FloatArray:
        places = near_longitude(places, middle, LON_LAT)
        px = fast(places)
        # Ground control may lie beyond the region, above all if the RPCs are wrong.
        beyond = np.isnan(px[:, 0]) & np.isfinite(places).all(axis=1)
        if beyond.any():
            px[beyond] = exact(places[beyond])
        return px

    return replace(surface, to_px=to_px)
