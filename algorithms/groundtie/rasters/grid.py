"""Grids: the positions of a raster's pixels on the map.

This is the only module that converts between the corner-based geotransforms of files (GDAL,
rasterio, QGIS: the first pixel's corner is at 0) and the centre-based pixel coordinates used
everywhere else (the first pixel's centre is at 0).
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce
from typing import Any

import numpy as np
import rasterio.warp
from affine import Affine
from numpy.typing import ArrayLike, NDArray
from rasterio.crs import CRS
from rasterio.errors import CRSError

from ..errors import GeoreferencingError, raised_by

FloatArray = NDArray[np.float64]

# From positions, shape (n, 2), to values at them, (n, k): mostly to other positions.
PointFunction = Callable[[FloatArray], FloatArray]

# Longitude and latitude.
LON_LAT = CRS.from_epsg(4326)

# Lower limit for the shrinking of units towards a pole, where their length is 0.
_LEAST_SHRINK = 1e-6

# The name of a datum and its parameters of the transformation to WGS 84, in WKT 1.
_DATUM = re.compile(r'DATUM\["[^"]*"|TOWGS84\[[^]]*\]')

# The ellipsoid of WGS 84: equatorial radius, flattening, and square of the eccentricity.
_RADIUS_M, FLATTENING = 6_378_137.0, 1 / 298.257223563
_ECCENTRICITY2 = FLATTENING * (2 - FLATTENING)

# The scale of survey maps differs from 1 by less than this, and their unit is taken at face value.
# The scale of UTM ranges from 0.9996 at a zone's middle to 1.001 at its borders, 3° away: (3°)² / 2
# is 0.0014. National grids deviate as much, or a few times as much in a large country.
_SURVEY_SCALE = 0.01

# Step over which the length of a map's units is measured.
_STEP_M = 1000.0

# Units of maps, in metres, lie between the inverse of this and this.
_LARGEST_UNIT_M = 1e6

# Accuracy of positions that are projected, or interpolated between projected ones.
POSITION_ERROR_PX = 1e-3

# GDAL counts the pixels of a side with signed 32 bits.
MOST_PX = 2**31 - 1

# Geotransform of images without georeferencing: map positions are then pixel coordinates.
PIXEL_COORDINATES = Affine.translation(-0.5, -0.5)


@dataclass(frozen=True)
class Grid:
    """Pixels on the map.

    Parameters
    ----------
    transform
        Corner-based geotransform, as in raster files.
    crs
        Coordinate reference system; None for local coordinates and pixel coordinates.
    width, height
        Size in pixels.
    is_on_pixels
        Whether the map consists of the pixels of a raster without georeferencing, and this grid has
        different pixels on it.
    """

    transform: Affine
    crs: CRS | None
    width: int
    height: int
    is_on_pixels: bool = field(default=False, compare=False, kw_only=True)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width, self.height

    @cached_property
    def centre_transform(self) -> Affine:
        """Transform of pixel positions, counted from the first pixel's centre, to the map."""
        return compose(self.transform, Affine.translation(0.5, 0.5))

    def pixel_to_map(self, px: ArrayLike) -> FloatArray:
        """Return the map positions, shape (n, 2), of the pixel positions `px` (col, row)."""
        return apply_affine(self.centre_transform, px)

    def map_to_pixel(self, xy: ArrayLike) -> FloatArray:
        """Return the pixel positions (col, row), shape (n, 2), of the map positions `xy`."""
        return apply_affine(~self.centre_transform, xy)

    def to_pixels_of(self, other: Grid) -> PointFunction:
        """Return the function from positions on this grid's map to the pixels of another grid."""
        return lambda xy: other.map_to_pixel(other.to_own_map(xy, self.crs))

    def to_own_map(self, xy: FloatArray, crs: CRS | None) -> FloatArray:
        """Return positions of another CRS, shape (n, 2), on this grid's map, as `reproject`.

        Longitudes are brought to within half a turn of the grid's middle, whether the grid counts
        from -180°, from 0° or beyond the antimeridian.
        """
        middle = self.pixel_to_map([self.centre_px])[0, 0]
        return near_longitude(reproject(xy, crs, self.crs), middle, self.crs)

    def contains(self, px: ArrayLike) -> NDArray[np.bool_]:
        """Return for each pixel position, shape (n, 2), whether it lies on a pixel of this grid."""
        px = np.asarray(px, float)
        size = np.array(self.size)
        return np.asarray(np.all((px >= -0.5) & (px <= size - 0.5), axis=-1))

    def covers(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """Return for each position on the map, shape (n, 2), whether a pixel lies there."""
        return self.contains(self.map_to_pixel(xy))

    @cached_property
    def is_georeferenced(self) -> bool:
        """Whether map positions are more than pixel coordinates."""
        is_on_pixels = self.is_on_pixels or self.transform == PIXEL_COORDINATES
        return self.crs is not None or not is_on_pixels

    @property
    def geotransform(self) -> Affine | None:
        """Geotransform for a raster on this grid; None if its own pixels are the map."""
        return None if self.transform == PIXEL_COORDINATES else self.transform

    @cached_property
    def pixel_size(self) -> tuple[float, float]:
        """Width and height of a pixel in map units."""
        t = self.transform
        return float(np.hypot(t.a, t.d)), float(np.hypot(t.b, t.e))

    @cached_property
    def metres_per_unit(self) -> tuple[float, float]:
        """Metres per map unit along x and y at the grid's centre (1 without a CRS).

        On a map that is sheared there, y is measured at right angles to x, so that areas are right.
        """
        x, y = metres_per_unit_at(self.pixel_to_map([self.centre_px]), self.crs)[0]
        return float(x), float(y)

    @cached_property
    def east_north(self) -> FloatArray:
        """Map units of a metre to the east, and to the north, at the grid's centre, shape (2, 2).

        On a map without longitudes, and outside of the projection's domain, they lie along x and y.
        """
        unit_m = np.array(self.metres_per_unit)
        along_axes = np.diag(1 / unit_m)
        if self.crs is None or self.crs.is_geographic:
            return along_axes
        centre = reproject(self.pixel_to_map([self.centre_px]), self.crs, LON_LAT)
        half = np.diag(_STEP_M / 2 / _metres_per_degree(centre[0, 1]))
        ends = reproject(np.concatenate([centre + half, centre - half]), LON_LAT, self.crs)
        if not np.isfinite(ends).all():
            return along_axes
        metres = (ends[:2] - ends[2:]) * unit_m
        return np.asarray(metres / np.linalg.norm(metres, axis=1, keepdims=True) / unit_m)

    @cached_property
    def pixel_size_m(self) -> float:
        """Side of a square with a pixel's area, in metres (in pixels without georeferencing)."""
        area = abs(self.transform.determinant) * self.metres_per_unit[0] * self.metres_per_unit[1]
        return float(np.sqrt(area))

    @cached_property
    def pixel_sides_m(self) -> tuple[float, float]:
        """Width and height of a pixel, in metres (in pixels without georeferencing)."""
        t, (x, y) = self.transform, self.metres_per_unit
        return float(np.hypot(t.a * x, t.d * y)), float(np.hypot(t.b * x, t.e * y))

    @property
    def metres_per_pixel(self) -> float | None:
        """Length of a pixel's longer side in metres, so that errors are not understated.

        None without georeferencing.
        """
        return max(self.pixel_sides_m) if self.is_georeferenced else None

    @property
    def centre_px(self) -> tuple[float, float]:
        """Pixel position (col, row) of the centre."""
        return (self.width - 1) / 2, (self.height - 1) / 2

    def scaled(self, factor: float) -> Grid:
        """Return the grid of whole pixels `factor` times as large, from the same corner."""
        if factor == 1:
            return self
        width, height = (max(int(side / factor + 1e-6), 1) for side in self.size)
        return self.on_same_map(compose(self.transform, Affine.scale(factor)), width, height)

    def window(self, col: int, row: int, width: int, height: int) -> Grid:
        """Return a part of this grid that starts at a pixel; it may reach beyond its borders."""
        place = compose(self.transform, Affine.translation(col, row))
        return self.on_same_map(place, width, height)

    def widened(self, margin_px: int) -> Grid:
        """Return this grid with a margin on each side."""
        both = 2 * margin_px
        return self.window(-margin_px, -margin_px, self.width + both, self.height + both)

    def shifted(self, dx: float, dy: float) -> Grid:
        """Return this grid moved by map units."""
        place = compose(Affine.translation(dx, dy), self.transform)
        return self.on_same_map(place, *self.size)

    def on_same_map(self, transform: Affine, width: int, height: int) -> Grid:
        """Return a grid of other pixels on the same map."""
        return Grid(transform, self.crs, width, height, is_on_pixels=not self.is_georeferenced)

    def on_own_pixels(self) -> Grid:
        """Return these pixels as their own map, without georeferencing."""
        return Grid(PIXEL_COORDINATES, None, *self.size)

    def outline(self, points_per_side: int = 21) -> FloatArray:
        """Return pixel positions along the outer border, shape (4 n, 2), in order."""
        along = np.linspace(0, 1, points_per_side, endpoint=False)
        x = np.concatenate([along, np.ones_like(along), 1 - along, np.zeros_like(along)])
        # Rows vary along a side as columns do along the previous side.
        unit = np.column_stack([x, np.roll(x, points_per_side)])
        return np.asarray(unit * self.size - 0.5)

    def to_json(self) -> dict[str, Any]:
        """Return the grid as values that JSON can carry."""
        return {
            "crs": crs_to_text(self.crs),
            "geotransform": list(self.transform.to_gdal()),
            "width": self.width,
            "height": self.height,
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Grid:
        """Return the grid that `to_json` described.

        Raises
        ------
        KeyError, TypeError, ValueError, CRSError
            The values do not describe a grid.
        """
        transform = Affine.from_gdal(*map(float, values["geotransform"]))
        width, height = int(values["width"]), int(values["height"])
        if not (1 <= width < MOST_PX and 1 <= height < MOST_PX) or not is_invertible(transform):
            raise ValueError("the grid is none of a raster")
        return Grid(transform, crs_from_text(values["crs"]), width, height)

    def places(self, count: int = 9) -> FloatArray:
        """Return pixel positions all over the grid, `count` a side, shape (count², 2)."""
        return mesh(*(np.linspace(0, side - 1, count) for side in self.size))


def mesh(cols: ArrayLike, rows: ArrayLike) -> FloatArray:
    """Return the positions (col, row) of all columns in all rows, shape (n, 2), row by row."""
    return np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)


def finite(points: FloatArray) -> FloatArray:
    """Return the finite positions of `points`, shape (n, 2)."""
    return points[np.isfinite(points).all(axis=1)]


def is_invertible(transform: Affine) -> bool:
    """Return whether a transform takes different positions to different, finite ones."""
    if not np.isfinite(transform[:6]).all() or transform.is_degenerate:
        return False
    return bool(np.isfinite((~transform)[:6]).all())


def require_map(crs: CRS | None) -> CRS | None:
    """Return a CRS if it is the CRS of a map, projected or geographic, or None.

    Raises
    ------
    GeoreferencingError
        The CRS is local (engineering), geocentric or vertical, without a relation to a map. Or its
        unit is not a unit of length, or the CRS cannot be written to a file.
    """
    if crs is None:
        return None
    try:
        text = crs.to_wkt()
    except CRSError as error:
        raise GeoreferencingError(f"a CRS cannot be written: {error}") from error
    if crs.is_geographic:
        return crs
    if crs.is_projected:
        unit, metres = crs.linear_units_factor
        if not 1 / _LARGEST_UNIT_M <= metres <= _LARGEST_UNIT_M:
            raise GeoreferencingError(f"a CRS has a unit ({unit[:40]}) of {metres:g} m")
        return crs
    raise GeoreferencingError(
        f"a CRS is neither projected nor geographic ({text[:40]}…); give it the CRS of its "
        "map, or none (gdal_edit.py -a_srs)"
    )


def full_turn(crs: CRS | None) -> float | None:
    """Return a full turn of longitude in map units; None if the map has no longitudes."""
    if crs is None or not crs.is_geographic:
        return None
    return 360 / _degrees_per_unit(crs)


def near_longitude(xy: FloatArray, longitude: FloatArray | float, crs: CRS | None) -> FloatArray:
    """Return positions, shape (n, 2), shifted by full turns to within half a turn of a longitude.

    Parameters
    ----------
    xy
        The positions; on a map without longitudes they stay unchanged.
    longitude
        One longitude for all positions, or one for each, shape (n, 1).
    crs
        CRS of the map.
    """
    turn = full_turn(crs)
    if turn is None:
        return xy
    # Positions outside of a projection's domain are infinite.
    with np.errstate(invalid="ignore"):
        turns = np.nan_to_num(np.rint((xy[:, :1] - longitude) / turn), posinf=0, neginf=0)
    return np.asarray(xy - turns * [turn, 0]) if turns.any() else xy


def _metres_per_degree(latitude_deg: ArrayLike) -> FloatArray:
    """Return the lengths of a degree of longitude and of a degree of latitude, on the ellipsoid.

    The shape is that of the latitudes, and 2.
    """
    # Positions outside of a projection's domain are infinite.
    with np.errstate(invalid="ignore"):
        sine, cosine = (f(np.deg2rad(latitude_deg)) for f in (np.sin, np.cos))
    # Radii of curvature of the prime vertical and of the meridian.
    across = _RADIUS_M / np.sqrt(1 - _ECCENTRICITY2 * sine**2)
    along = across * (1 - _ECCENTRICITY2) / (1 - _ECCENTRICITY2 * sine**2)
    return math.radians(1) * np.stack([across * np.maximum(cosine, _LEAST_SHRINK), along], axis=-1)


def _degrees_per_unit(crs: CRS) -> float:
    """Return the unit of a geographic CRS in degrees."""
    # WKT holds it with 15 digits.
    return round(float(np.rad2deg(crs.units_factor[1])), 12)


def _scale_on_the_ground(xy: FloatArray, unit_m: float, crs: CRS) -> FloatArray:
    """Return the ratios of ground length to nominal length of a projected map's units, (n, 2).

    The ratios hold at positions, along x and at right angles to x; 1 outside of the projection's
    domain.
    """
    along = np.array([[-0.5, 0], [0, -0.5], [0.5, 0], [0, 0.5]]) * (_STEP_M / unit_m)
    around = (xy[:, None] + along).reshape(-1, 2)
    places = _earth_centred(reproject(around, crs, LON_LAT)).reshape(-1, 2, 2, 3)
    with np.errstate(invalid="ignore"):
        x, y = np.moveaxis((places[:, 1] - places[:, 0]) / _STEP_M, 1, 0)
        width = np.maximum(np.linalg.norm(x, axis=1), _LEAST_SHRINK)
        height = np.linalg.norm(np.cross(x, y), axis=1) / width
    scale = np.column_stack([width, np.maximum(height, _LEAST_SHRINK)])
    return np.where(np.isfinite(scale).all(axis=1, keepdims=True), scale, 1.0)


def _earth_centred(lon_lat: FloatArray) -> FloatArray:
    """Return geocentric coordinates, (n, 3), of longitudes and latitudes in degrees, (n, 2).

    Distances in them are not affected by poles or the antimeridian.
    """
    # Positions outside of a projection's domain are infinite.
    with np.errstate(invalid="ignore"):
        lon, lat = np.deg2rad(lon_lat).T
        # Radius of curvature of the prime vertical
        radius = _RADIUS_M / np.sqrt(1 - _ECCENTRICITY2 * np.sin(lat) ** 2)
        across, up = radius * np.cos(lat), radius * (1 - _ECCENTRICITY2) * np.sin(lat)
        return np.column_stack([across * np.cos(lon), across * np.sin(lon), up])


def metres_per_unit_at(xy: ArrayLike, crs: CRS | None) -> FloatArray:
    """Return the metres per map unit along x and y at positions, both (n, 2); 1 without a CRS."""
    places = np.asarray(xy, float).reshape(-1, 2)
    if crs is None:
        return np.ones_like(places)
    if crs.is_geographic:
        degrees = _degrees_per_unit(crs)
        return degrees * _metres_per_degree(places[:, 1] * degrees)
    unit_m = float(crs.linear_units_factor[1])
    scale = _scale_on_the_ground(places, unit_m, crs)
    if 'PROJECTION["Mercator' not in crs.to_wkt():
        is_for_surveys = (np.abs(scale - 1) <= _SURVEY_SCALE).all(axis=1, keepdims=True)
        scale = np.where(is_for_surveys, 1.0, scale)
    return scale * unit_m


def require_both_or_none(one: CRS | None, other: CRS | None, names: str) -> None:
    """Raise `GeoreferencingError` if only one of two maps, named in `names`, has a CRS."""
    if (one is None) != (other is None):
        raise GeoreferencingError(f"only one of {names} has a CRS")


# The product is `*` in affine 2; affine 3 has `@` and warns of `*`.
_product = operator.matmul if hasattr(Affine, "__matmul__") else operator.mul


def epsg_of(crs: CRS) -> int | None:
    """Return the EPSG code of exactly this CRS; None if it has none."""
    code = crs.to_epsg()
    return code if code is not None and _is_same(CRS.from_epsg(code), crs) else None


def crs_name(crs: CRS) -> str:
    """Return a short text that identifies exactly this CRS: its code, else its WKT."""
    # GDAL may return the nearest code, whose datum differs from an unknown datum or from one with
    # custom parameters.
    name = str(crs.to_string())
    return name if _is_same(CRS.from_user_input(name), crs) else str(crs.to_wkt())


def _is_same(one: CRS, other: CRS) -> bool:
    # For rasterio before 1.4, CRSs with the same nearest code are equal.
    datum, others = (_DATUM.findall(crs.to_wkt()) for crs in (one, other))
    return bool(one == other) and datum == others


def crs_to_text(crs: CRS | None) -> str | None:
    """Return a CRS as text that files can carry."""
    return None if crs is None else str(crs.to_wkt())


def crs_from_text(text: str | None) -> CRS | None:
    """Return the CRS that `crs_to_text` described; errors as `require_map`, and `CRSError`."""
    return None if text is None else require_map(CRS.from_wkt(text))


def compose(*transforms: Affine) -> Affine:
    """Return the affine transform that applies the last of `transforms` first."""
    return reduce(_product, transforms)


def linear_part(transform: Affine) -> FloatArray:
    """Return the matrix of an affine transform without its shift, shape (2, 2)."""
    return np.array([[transform.a, transform.b], [transform.d, transform.e]])


def apply_affine(transform: Affine, points: ArrayLike) -> FloatArray:
    """Return `points`, shape (n, 2), moved by an affine transform."""
    x, y = np.asarray(points, float).reshape(-1, 2).T
    t = transform
    # Positions outside of a projection's domain are infinite.
    with np.errstate(invalid="ignore"):
        return np.column_stack([t.a * x + t.b * y + t.c, t.d * x + t.e * y + t.f])


def reproject(xy: FloatArray, source: CRS | None, target: CRS | None) -> FloatArray:
    """Return positions, shape (n, 2), in another CRS; without a CRS they stay unchanged.

    Positions outside of a projection's domain become infinite.
    """
    if source is None or target is None or source == target:
        return xy
    try:
        moved = rasterio.warp.transform(source, target, xy[:, 0], xy[:, 1])
    except Exception as error:
        if not raised_by(error, "rasterio"):
            raise
        # One position outside the domain fails them all: bisect to find it.
        if len(xy) == 1:
            return np.full((1, 2), np.inf)
        half = len(xy) // 2
        parts = [reproject(part, source, target) for part in (xy[:half], xy[half:])]
        return np.concatenate(parts)
    return np.column_stack(moved[:2])
