"""Ground control in the formats of other programs: orthority, GDAL, ENVI."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rasterio.crs import CRS

from ..errors import GroundTieError, TransformFileError
from ..geometry.point_tables import require_places
from ..geometry.tie_points import TiePoints
from ..raster_names import GEOTIFF
from ..rasters.grid import LON_LAT, FloatArray
from ..rasters.handles import FileHandles
from ..strict_json import read_json
from ..wording import reason_of

# Rasters with GDAL's GCPs in their tags.
RASTERS = (*GEOTIFF, ".vrt")
ENVI = ".pts"
SUFFIXES = (*RASTERS, ENVI)

# Position of the first pixel's centre: its corner is at 0 in GDAL, at 1 in ENVI.
GDAL_FIRST, _ENVI_FIRST = 0.5, 1.5

# Column of heights above the ellipsoid; NaN where unknown.
HEIGHT = "height_m"


def read_others(path: Path, image: str) -> TiePoints | None:
    """Read ground control of another program; None if the file has one of our own formats.

    The points have the column `HEIGHT`, but no sigmas.

    Parameters
    ----------
    path
        GeoJSON of orthority, a raster with GCPs in its tags (also a VRT), or ENVI's `.pts`.
    image
        Name of the image: orthority's files may hold points of several images.

    Raises
    ------
    TransformFileError
        The file cannot be read or understood.
    """
    read = _READERS.get(path.suffix.lower())
    if read is None:
        return None
    try:
        points = read(path, image)
        if points is not None:
            require_places(points.reference_xy)
            require_places(points.input_px)
        return points
    except (
        GroundTieError,
        OSError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
    ) as error:
        reason = reason_of(error)
        raise TransformFileError(f"cannot read the ground control {path}: {reason}") from error


def _points(xy: FloatArray, px: FloatArray, height_m: FloatArray, crs: CRS) -> TiePoints:
    return replace(TiePoints.unmeasured(xy, px, crs), more={HEIGHT: height_m})


def _read_orthority(path: Path, image: str) -> TiePoints | None:
    """Read points in WGS 84 with their pixel in the property `ji` (column and row)."""
    collection = read_json(path)
    features = collection.get("features", []) if isinstance(collection, dict) else []
    points = [feature for feature in features if "ji" in (feature.get("properties") or {})]
    if not points:
        return None
    names = {_stem(point) for point in points}
    if len(names) > 1:
        points = [point for point in points if _stem(point) == Path(image).stem]
        if not points:
            raise ValueError(f"it has points of {', '.join(sorted(names))}, none of {image}")
    coordinates = [point["geometry"]["coordinates"] for point in points]
    height = [place[2] if len(place) > 2 else np.nan for place in coordinates]
    return _points(
        np.array([place[:2] for place in coordinates], float).reshape(-1, 2),
        np.array([point["properties"]["ji"] for point in points], float).reshape(-1, 2),
        np.array(height, float),
        LON_LAT,
    )


def _stem(feature: dict[str, Any]) -> str:
    return Path(str(feature["properties"].get("filename") or "")).stem


def _read_gdal(path: Path, image: str) -> TiePoints:
    """Read the GCPs of a raster; heights that are all 0 are unknown."""
    with FileHandles(str(path)).borrow() as dataset:
        points, crs = dataset.gcps
    if not points:
        raise ValueError("the raster has no GCPs")
    if crs is None:
        raise ValueError("its GCPs have no CRS")
    height = np.array([point.z or 0.0 for point in points], float)
    return _points(
        np.array([[point.x, point.y] for point in points], float),
        np.array([[point.col, point.row] for point in points], float) - GDAL_FIRST,
        height if height.any() else np.full(len(points), np.nan),
        crs,
    )


def _read_envi(path: Path, image: str) -> TiePoints:
    """Read map and image positions, in four columns; comments begin with a semicolon."""
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    comments = [line for line in lines if line.lstrip().startswith(";")]
    rows = [line.split() for line in lines if line.strip() and not line.lstrip().startswith(";")]
    if not rows or any(len(row) < 4 for row in rows):
        raise ValueError("it must hold lines of map x, y and image x, y")
    numbers = np.array([row[:4] for row in rows], float)
    crs = _envi_crs(" ".join(comments))
    return _points(numbers[:, :2], numbers[:, 2:] - _ENVI_FIRST, np.full(len(rows), np.nan), crs)


def _envi_crs(comments: str) -> CRS:
    """Return the CRS of a projection info, on WGS 84: a UTM zone, or longitude and latitude."""
    found = re.search(r"projection info\s*=\s*\{([^}]*)\}", comments, re.IGNORECASE)
    words = [] if found is None else [word.strip().lower() for word in found[1].split(",")]
    units = [word for word in words if re.match(r"units\s*=", word)]
    if any(not re.search(r"=\s*(meters|degrees)$", word) for word in units):
        raise ValueError(f"its {units[0]} must be Meters or Degrees")
    if "wgs-84" in words and words[0] == "utm" and words[1].isdigit():
        base = 32700 if "south" in words else 32600
        return CRS.from_epsg(base + int(words[1]))
    if "wgs-84" in words and words[0].startswith("geographic"):
        return LON_LAT
    raise ValueError("its projection info is none of UTM or Geographic Lat/Lon on WGS-84")


_READERS: dict[str, Callable[[Path, str], TiePoints | None]] = {
    ".geojson": _read_orthority,
    ".json": _read_orthority,
    ENVI: _read_envi,
    **dict.fromkeys(RASTERS, _read_gdal),
}
