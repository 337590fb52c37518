"""Acquisition metadata of products: STAC items with the view extension [STAC2021]."""

from __future__ import annotations

from typing import Any

from ..rasters.grid import LON_LAT, Grid, reproject
from .optical import OpticalOptions
from .sar import SarOptions

_VIEW = "https://stac-extensions.github.io/view/v1.0.0/schema.json"
_SAR = "https://stac-extensions.github.io/sar/v1.0.0/schema.json"
_SAT = "https://stac-extensions.github.io/sat/v1.0.0/schema.json"

# An item must have a date; for a simulated place, the date is invented, too.
_DATE = "2020-06-01T10:00:00Z"


def sar_item(file: str, grid: Grid, sar: SarOptions) -> dict[str, Any]:
    """Return the STAC item of a radar image on a grid."""
    properties = {
        "view:azimuth": (sar.azimuth_deg + 180) % 360,
        "view:incidence_angle": sar.incidence_deg,
        "sar:instrument_mode": "spotlight",
        "sar:frequency_band": "X",
        "sar:polarizations": ["VV"],
        "sar:product_type": "GTC",
        "sar:observation_direction": "right",
        "sat:orbit_state": sar.orbit,
    }
    return _item(file, grid, properties, [_VIEW, _SAR, _SAT])


def optical_item(file: str, grid: Grid, optical: OpticalOptions) -> dict[str, Any]:
    """Return the STAC item of a camera image that covers a grid."""
    properties = {
        "view:azimuth": (optical.view_azimuth_deg + 180) % 360,
        "view:off_nadir": optical.off_nadir_deg,
        "view:incidence_angle": optical.off_nadir_deg,
        "view:sun_azimuth": optical.sun_azimuth_deg,
        "view:sun_elevation": optical.sun_elevation_deg,
    }
    return _item(file, grid, properties, [_VIEW])


def _item(
    file: str, grid: Grid, properties: dict[str, Any], extensions: list[str]
) -> dict[str, Any]:
    assert grid.crs is not None
    right, bottom = grid.width - 0.5, grid.height - 0.5
    corners = [[-0.5, -0.5], [-0.5, bottom], [right, bottom], [right, -0.5], [-0.5, -0.5]]
    ring = reproject(grid.pixel_to_map(corners), grid.crs, LON_LAT)
    return {
        "type": "Feature",
        "stac_version": "1.0.0",
        "stac_extensions": extensions,
        "id": file.rpartition(".")[0],
        "geometry": {"type": "Polygon", "coordinates": [ring.tolist()]},
        "bbox": [*ring.min(axis=0).tolist(), *ring.max(axis=0).tolist()],
        "properties": {"datetime": _DATE, **properties},
        "links": [],
        "assets": {"image": {"href": f"./{file}"}},
    }
