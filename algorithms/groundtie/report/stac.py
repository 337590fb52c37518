"""A registered raster as a STAC item, whose fields are added to those of the report's JSON."""

from __future__ import annotations

import os
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ..geometry.transform import Transform
from ..raster_names import GEOTIFF, file_name
from ..rasters.grid import LON_LAT, Grid, epsg_of, near_longitude, reproject
from ..rasters.reading import RasterSource
from ..rasters.writing import COG_SUFFIXES
from ..registration.verdict import Verdict
from ..stac_items import stated_time, time_of

VERSION = "1.0.0"
EXTENSIONS = (
    "https://stac-extensions.github.io/projection/v1.0.0/schema.json",
    "https://stac-extensions.github.io/accuracy/v1.0.0/schema.json",
)

_TIFF = "image/tiff; application=geotiff"


def stac_item(
    source: RasterSource,
    output: Path,
    grid: Grid,
    folder: Path,
    quality: Mapping[str, Any],
    time: datetime | None = None,
) -> dict[str, Any]:
    """Return the members of a STAC item of a registered raster.

    Empty if there can be none: without a CRS, without a time of acquisition, and across the
    antimeridian.

    Parameters
    ----------
    source
        The input, whose metadata or name state its time.
    output, grid
        The registered raster.
    folder
        Folder of the JSON.
    quality
        Properties on the registration's accuracy; see `quality_of`.
    time
        Time of acquisition; None: as `source` states it.
    """
    time = time or stated_time(source.tags.get("IMAGERY", {}).get("ACQUISITIONDATETIME", ""))
    time = time or time_of(file_name(source.path))
    if time is None or grid.crs is None:
        return {}
    # Many points: straight borders on the map are curved in longitude and latitude.
    seen = reproject(grid.pixel_to_map(grid.outline()), grid.crs, LON_LAT)
    places = near_longitude(seen, 0.0, LON_LAT)
    longitudes = [seen[:, 0], places[:, 0]]
    # A footprint of more than half a turn crosses the antimeridian, which divides it in two.
    if not np.isfinite(places).all() or np.ptp(longitudes, axis=1).max() > 180:
        return {}
    # GeoJSON's outer rings run counterclockwise (RFC 7946, section 3.1.6).
    x, y = (places - places.mean(axis=0)).T
    is_clockwise = x @ np.roll(y, -1) < y @ np.roll(x, -1)
    ring = places[:: -1 if is_clockwise else 1].tolist()
    return {
        "type": "Feature",
        "stac_version": VERSION,
        "stac_extensions": list(EXTENSIONS),
        "id": _name_without_suffix(output),
        "geometry": {"type": "Polygon", "coordinates": [[*ring, ring[0]]]},
        "bbox": [*places.min(axis=0).tolist(), *places.max(axis=0).tolist()],
        "properties": {
            "datetime": f"{time.isoformat()}Z",
            **_projection(grid),
            **quality,
        },
        "links": [],
        "assets": {"data": _asset(output, folder)},
    }


def quality_of(verdict: Verdict, transform: Transform) -> dict[str, Any]:
    """Return the properties on the accuracy of one registration."""
    return {
        "accuracy:geometric_rmse": verdict.check_rmse_m,
        "groundtie:ce90_m": verdict.ce90_m,
        "groundtie:points": verdict.points,
        "groundtie:model": transform.model.kind,
    }


def _projection(grid: Grid) -> dict[str, Any]:
    assert grid.crs is not None
    corners = grid.pixel_to_map(grid.outline(1))
    code = epsg_of(grid.crs)
    return {
        "proj:epsg": code,
        **({} if code is not None else {"proj:wkt2": grid.crs.to_wkt(version="WKT2_2019")}),
        "proj:shape": [grid.height, grid.width],
        "proj:transform": list(grid.transform[:6]),
        "proj:bbox": [*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()],
    }


def _name_without_suffix(output: Path) -> str:
    name = output.name
    longest = next((end for end in COG_SUFFIXES if name.lower().endswith(end)), output.suffix)
    return name[: len(name) - len(longest)]


def _asset(output: Path, folder: Path) -> dict[str, Any]:
    try:
        href = Path(os.path.relpath(output, folder)).as_posix()
    except ValueError:  # another disk of Windows
        href = output.resolve().as_posix()
    # A URL, relative or not: a # in a name would begin a fragment.
    asset: dict[str, Any] = {"href": quote(os.fsencode(href), safe="/:"), "roles": ["data"]}
    if output.name.lower().endswith(COG_SUFFIXES):
        return asset | {"type": f"{_TIFF}; profile=cloud-optimized"}
    # Readers know no media type of other formats.
    is_tiff = output.suffix.lower() in GEOTIFF
    return asset | {"type": _TIFF} if is_tiff else asset
