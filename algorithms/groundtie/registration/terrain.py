"""Terrain models that a tool is given: beside the images, or as the reference."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import ParameterError
from ..matching.surface_fit import AUTO
from ..rasters.rendered import SUN, Light

# Satellites fly nearly from pole to pole: a radar looks east or west, which differ in the sign of
# contrast above all.
RADAR_AZIMUTHS_DEG = (270.0, 90.0)


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


def asked_light(given: Mapping[str, Any]) -> Light | None:
    """Return in which light a reference that is a terrain model is rendered; None: it is none.

    Raises
    ------
    ParameterError
        Nobody said where the light comes from.
    """
    kind, azimuth_deg = given.get("light"), given.get("light_azimuth")
    if kind is None:
        if azimuth_deg is not None:
            raise ParameterError("light_azimuth goes with light: the reference is a terrain model")
        return None
    if azimuth_deg is None and kind == SUN:
        raise ParameterError(
            "light sun needs its azimuth (light_azimuth): the tool register tries some"
        )
    return Light(kind, RADAR_AZIMUTHS_DEG[0] if azimuth_deg is None else azimuth_deg)
