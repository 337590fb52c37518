"""Terrain models that a tool is given: beside the images, or as the reference."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..errors import ParameterError
from ..geometry.terrain import Terrain
from ..geometry.views import split_views
from ..matching.surface_fit import AUTO
from ..rasters.pair import ImagePair
from ..rasters.rendered import LIGHTS, RADAR, SUN, Light

# Where it may stand, the likeliest first. Satellites fly nearly from pole to pole: a radar looks
# east or west, which differ in the sign of contrast above all; so do opposite azimuths of the sun.
# Measured with `benchmarks/run.py --only mountains`: 15° off costs little.
_AZIMUTHS_DEG = {RADAR: (270.0, 90.0), SUN: (150.0, 120.0, 180.0, 90.0, 30.0, 60.0)}

# What a view begins with that is that of a terrain model.
_TERRAIN = "terrain"

_WORDS = re.compile(rf"{_TERRAIN}[\s,]+({'|'.join(LIGHTS)})(?:[\s,]+azimuth=(\d+(?:\.\d+)?)°?)?")


def asked_terrain(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the terrain models of a specification by the values of a tool's parameters.

    Raises
    ------
    ParameterError
        They do not go together.
    """
    dem, input_dem = given.get("dem"), given.get("input_dem")
    if input_dem is not None and dem is None:
        raise ParameterError("the input's terrain model (input_dem) goes with another one (dem)")
    model = given.get("model", AUTO)
    if dem is not None and model != AUTO:
        raise ParameterError(f"a terrain model (dem) goes with model {AUTO}, not {model}")
    return {"dem": dem, "input_dem": input_dem}


def open_terrain(pair: ImagePair, dem: Any, input_dem: Any | None) -> Terrain:
    """Return heights where a pair may show something.

    Parameters
    ----------
    pair
        The images.
    dem, input_dem
        The ground's heights, and those that the input was made with; None: one height.

    Raises
    ------
    GeoreferencingError, NoOverlapError, RasterContentError
        They are not known where the images overlap.
    """
    corners = pair.surroundings.pixel_to_map(pair.surroundings.outline())
    left, bottom = corners.min(axis=0).tolist()
    right, top = corners.max(axis=0).tolist()
    crs = pair.grid.crs
    terrain = Terrain.open(dem, input_dem, crs, (left, bottom, right, top))
    terrain.require_cover(pair.grid, pair.input.source.grid, crs)
    return terrain


def asked_lights(given: Mapping[str, Any]) -> tuple[Light, ...]:
    """Return in which lights a reference that is a terrain model may be rendered.

    Parameters
    ----------
    given
        The values of a tool's parameters. The reference's view is `terrain sun azimuth=155`, or
        without azimuth, which is then to be tried; else the reference is an image.

    Raises
    ------
    ParameterError
        The words state no light.
    """
    words = (split_views(given.get("views"))[0] or "").lower()
    if not words.startswith(_TERRAIN):
        return ()
    found = _WORDS.fullmatch(words)
    if found is None or float(found[2] or 0) > 360:
        raise ParameterError(
            f"{words!r} states no light: give '{_TERRAIN} {SUN}' or '{_TERRAIN} {RADAR}', and its "
            f"azimuth in degrees if known, as '{_TERRAIN} {SUN} azimuth=155'"
        )
    kind = found[1]
    azimuths = _AZIMUTHS_DEG[kind] if found[2] is None else (float(found[2]),)
    return tuple(Light(kind, azimuth) for azimuth in azimuths)


def asked_light(given: Mapping[str, Any]) -> Light | None:
    """Return the light of a single try; a radar stands in the west by default.

    Raises
    ------
    ParameterError
        The words state none, or not where the sun stands.
    """
    lights = asked_lights(given)
    if len(lights) > 1 and lights[0].kind == SUN:
        raise ParameterError(
            f"'{_TERRAIN} {SUN}' needs its azimuth, as '{_TERRAIN} {SUN} azimuth=155': the tool "
            "register tries some"
        )
    return lights[0] if lights else None
