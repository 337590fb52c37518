"""An image located by RPCs and heights: map position ↔ image position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike
from rasterio.crs import CRS

from ..errors import GeoreferencingError, NoOverlapError
from ..geometry.terrain_model import LEAST_SLOPE
from ..rasters.grid import (
    LON_LAT,
    FloatArray,
    Grid,
    PointFunction,
    crs_name,
    finite,
    near_longitude,
    reproject,
)
from ..rasters.reading import RasterSource
from .heights import ConstantHeight, Heights, terrain_heights
from .rpc import RPC, VALID_RANGE, image_places
from .smooth_map import smooth_map

# Precision of heights at which lines of sight intersect the terrain, in metres.
_PRECISION_M = 1e-4

# Most steps of the intersection; lines of sight that need more meet no ground.
_STEPS = 60

# Largest error of longitudes and latitudes from map positions: 0.1 mm.
_TOLERANCE_DEG = 1e-9

# Margin of the map around the image that can be projected into it, as a share of the image's side.
_AROUND = 0.5

# Samples along each side of an image: shares of its ground are right to 1 %.
_NODES = 64


@dataclass(frozen=True)
class Orientation:
    """The relation of an image to the ground.

    Parameters
    ----------
    rpc
        The sensor model.
    heights
        Heights of the ground above the ellipsoid.
    crs
        CRS of the map.
    to_lon_lat
        From map positions to longitude and latitude, shapes (n, 2).
    known_share
        Share of the image whose heights are the terrain model's own values.
    filled_share
        Share of the image whose heights are filled into voids from their rims.
    domain
        Least width, in the map's unit, of the area around the image that `to_lon_lat` is made for.
    """

    rpc: RPC
    heights: Heights
    crs: CRS
    to_lon_lat: PointFunction
    known_share: float = 1.0
    filled_share: float = 0.0
    domain: float = np.inf

    def to_px(self, xy: ArrayLike) -> FloatArray:
        """Return the image positions (col, row), shape (n, 2), of map positions.

        NaN where the height is not known or the RPCs are not valid.
        """
        lon_lat = self.to_lon_lat(np.asarray(xy, float))
        height = self.heights.at(lon_lat)
        px = self.rpc.project(lon_lat, height)
        px[~self.rpc.is_valid(lon_lat, height)] = np.nan
        return px

    def heights_at(self, xy: ArrayLike) -> FloatArray:
        """Return the heights above the ellipsoid, shape (n,), of map positions."""
        return self.heights.at(self.to_lon_lat(np.asarray(xy, float)))

    def to_map(self, px: ArrayLike) -> FloatArray:
        """Return the map positions, shape (n, 2), of image positions.

        NaN where the line of sight does not meet the ground.
        """
        xy = _on_map(self._ground(np.asarray(px, float)), self.rpc, self.crs)
        return np.where(np.isfinite(xy), xy, np.nan)

    def to_nominal_map(self, px: ArrayLike) -> FloatArray:
        """Return `to_map`, but at a typical height where lines of sight meet no known ground."""
        px = np.asarray(px, float)
        xy = self.to_map(px)
        lost = ~np.isfinite(xy).all(axis=1)
        if lost.any():
            xy[lost] = self.to_level_map(px[lost])
        return np.where(np.isfinite(xy), xy, np.nan)

    def to_level_map(self, px: ArrayLike) -> FloatArray:
        """Return the map positions, shape (n, 2), of image positions at a typical height."""
        level = self.rpc.localise(px, self.heights.typical_m)
        return _on_map(level, self.rpc, self.crs)

    def _ground(self, px: FloatArray) -> FloatArray:
        """Return longitude and latitude, (n, 2), of image positions; NaN where there is no ground.

        The height at which the line of sight meets the ground is found by the secant method. On the
        way there, the line may pass over unknown ground.
        """
        heights = self.heights.continued

        def above_line(height: FloatArray) -> tuple[FloatArray, FloatArray]:
            """Return positions of lines of sight at heights, and the ground's heights above."""
            lon_lat = self.rpc.localise(px, height)
            return lon_lat, heights.at(lon_lat) - height

        height = np.full(len(px), self.heights.typical_m)
        lon_lat, above = above_line(height)
        previous, previous_above, height = height, above, height + above
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                lon_lat, above = above_line(height)
                if np.nanmax(np.abs(above), initial=0.0) < _PRECISION_M:
                    break
                slope = (above - previous_above) / (height - previous)
                # Steep slopes towards the sensor (layover) make the plain step overshoot.
                step = np.where(
                    np.isfinite(slope) & (slope < -LEAST_SLOPE), -above / slope, above / 2
                )
                step = np.where(np.abs(above) < _PRECISION_M, 0.0, step)
                previous, previous_above, height = height, above, height + step
        met = (np.abs(above) < _PRECISION_M) & np.isfinite(self.heights.at(lon_lat))
        return np.where(met[:, None], lon_lat, np.nan)


@dataclass(frozen=True)
class SensorGrid(Grid):
    """The pixels of an image that is located by its orientation.

    All pixels have a map position, as in any grid, at a typical height where the ground's is not
    known; map positions of unknown height have no pixel. The geotransform is an approximation, good
    for pixel sizes.

    Parameters
    ----------
    orientation
        The image's orientation.
    """

    orientation: Orientation

    def pixel_to_map(self, px: ArrayLike) -> FloatArray:
        return self.orientation.to_nominal_map(np.asarray(px, float).reshape(-1, 2))

    def map_to_pixel(self, xy: ArrayLike) -> FloatArray:
        return self.orientation.to_px(np.asarray(xy, float).reshape(-1, 2))


def orient(
    source: RasterSource,
    rpc: RPC,
    crs: CRS,
    dem: RasterSource | None,
    geoid: RasterSource | None = None,
    height_m: float | None = None,
) -> Orientation:
    """Return the orientation of an image.

    Parameters
    ----------
    source
        The image.
    rpc
        Its sensor model.
    crs
        CRS of the map.
    dem
        A terrain model; None: the height is the same everywhere.
    geoid
        Geoid that the model's heights count from; None: the ellipsoid (see `terrain_heights`).
    height_m
        Height above the ellipsoid without a terrain model; None: the RPCs' height offset.

    Raises
    ------
    NoOverlapError
        The terrain model covers nothing of the image, or the image lies outside of the map's CRS.
    GeoreferencingError, RasterContentError
        See `terrain_heights`.
    """
    size = source.grid.size
    extremes = np.vstack([seen_at(rpc, size, height) for height in rpc.heights_m(VALID_RANGE)])
    heights: Heights
    if dem is None:
        heights = ConstantHeight(rpc.offset[2] if height_m is None else height_m)
    else:
        heights = terrain_heights(dem, geoid, extremes)
    seen = seen_at(rpc, size, heights.typical_m)
    known = float(np.isfinite(heights.at(seen)).mean())
    measured = float(heights.is_measured(seen).mean())
    if dem is not None and known == 0:
        raise NoOverlapError(f"{dem.path} covers nothing of the area of {source.path}")
    xy = _on_map(np.vstack([extremes, seen]), rpc, crs)
    if not np.isfinite(xy).all():
        raise NoOverlapError(f"{source.path} lies outside of the domain of {crs_name(crs)}")
    around = _AROUND * (xy.max(axis=0) - xy.min(axis=0))

    def exact(places: FloatArray) -> FloatArray:
        return near_longitude(reproject(places, crs, LON_LAT), rpc.offset[0], LON_LAT)

    low, high = xy.min(axis=0) - around, xy.max(axis=0) + around
    fast = smooth_map(exact, low, high, _TOLERANCE_DEG)
    x = float(np.median(xy[:, 0]))
    return Orientation(
        rpc,
        heights,
        crs,
        lambda places: fast(near_longitude(places, x, crs)),
        measured,
        known - measured,
        float((high - low).min()),
    )


def _on_map(lon_lat: FloatArray, rpc: RPC, crs: CRS) -> FloatArray:
    """Return map positions, (n, 2), of longitudes and latitudes of RPCs.

    If the map has longitudes, they continue across the antimeridian as those of the RPCs.
    """
    x = reproject(np.array([rpc.offset[:2]]), LON_LAT, crs)[0, 0]
    return near_longitude(reproject(lon_lat, LON_LAT, crs), x, crs)


def seen_at(rpc: RPC, size: tuple[int, int], height_m: float) -> FloatArray:
    """Return longitudes and latitudes all over an image, (n, 2), at a height; none is NaN.

    Raises
    ------
    GeoreferencingError
        The RPCs lead no pixel to the ground: they belong to another image.
    """
    seen = finite(rpc.localise(*image_places(size, [height_m], _NODES)))
    if not len(seen):
        raise GeoreferencingError("the RPCs lead no pixel of the image to the ground")
    return seen


def sensor_grid(source: RasterSource, orientation: Orientation) -> SensorGrid:
    """Return the grid of an image that is located by its orientation."""
    width, height = source.grid.size
    corners = np.array([[0, 0], [width, 0], [0, height]], float) - 0.5
    ground = orientation.rpc.localise(corners, orientation.heights.typical_m)
    origin, right, down = _on_map(ground, orientation.rpc, orientation.crs)
    along, across = (right - origin) / width, (down - origin) / height
    transform = Affine(along[0], across[0], origin[0], along[1], across[1], origin[1])
    return SensorGrid(transform, orientation.crs, width, height, orientation)
