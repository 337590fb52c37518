"""Conversion of heights to metres, for rasters with a scale, offset or another unit."""

from __future__ import annotations

import re

import numpy as np
from rasterio.crs import CRS

from ..errors import RasterContentError
from .reading import FloatImage, RasterSource

_FOOT_M = 0.3048
_SURVEY_FOOT_M = 1200 / 3937

# By name, in lower case and letters only.
_UNITS_M = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("cm", "centimetre", "centimetres", "centimeter", "centimeters"), 0.01),
    **dict.fromkeys(("dm", "decimetre", "decimetres", "decimeter", "decimeters"), 0.1),
    **dict.fromkeys(("mm", "millimetre", "millimetres", "millimeter", "millimeters"), 0.001),
    **dict.fromkeys(("km", "kilometre", "kilometres", "kilometer", "kilometers"), 1000.0),
    **{
        name.format(foot): metres
        for foot in ("ft", "foot", "feet")
        for metres, names in (
            (_FOOT_M, ("{}", "international{}", "{}international")),
            (_SURVEY_FOOT_M, ("us{}", "{}us", "ussurvey{}", "{}ussurvey", "survey{}")),
        )
        for name in names
    },
}

# The unit of a vertical CRS, in WKT 1 or 2, follows its datum, which has no unit.
_VERTICAL_UNIT = re.compile(
    r'VERT(?:_CS|CRS)\[.*?UNIT\["[^"]*",\s*(\d[\d.eE+-]*)', re.DOTALL | re.IGNORECASE
)


def in_metres(values: FloatImage, source: RasterSource, band: int = 1) -> FloatImage:
    """Return heights in metres from the stored values of a band.

    Raises
    ------
    RasterContentError
        The band's unit is unknown.
    """
    stated = source.bands[band - 1]
    unit_m = _unit_m(stated.unit, source)
    if (stated.scale, stated.offset, unit_m) == (1.0, 0.0, 1.0):
        return values
    return np.asarray(values * (stated.scale * unit_m) + stated.offset * unit_m, np.float32)


def _unit_m(name: str | None, source: RasterSource) -> float:
    """Return a unit in metres: the band's, else that of the vertical CRS, else metres."""
    if not name:
        return _vertical_unit_m(source.grid.crs)
    known = _UNITS_M.get("".join(filter(str.isalpha, name)).lower())
    if known is None:
        raise RasterContentError(
            f"{source.path} has heights in a unit that is not known ({name[:40]}): state m or ft "
            "(gdal_edit.py -units)"
        )
    return known


def _vertical_unit_m(crs: CRS | None) -> float:
    found = None if crs is None else _VERTICAL_UNIT.search(crs.to_wkt())
    return 1.0 if found is None else float(found[1])
