"""The masks and the specification that the parameters of a registering tool ask for."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..errors import ParameterError
from ..geometry.views import RADAR, View, no_view, parse_view, split_views
from ..kinds import AUTO
from ..masks.used import NONE
from ..rasters.rendered import LIGHTS, SUN, Light
from .registered_output import grid_of_output, model_for_grid
from .specification import BOTH, Specification, StatedSurface
from .user_masks import UserMask

# Values of parameters that not all tools have.
USUAL: Mapping[str, Any] = {
    "output_grid": "reference",
    "surface_model": None,
    "views": None,
}

# Azimuths of the sun or radar to try, the likeliest first. Satellites fly nearly from pole to pole,
# so a radar looks east or west. The two differ mainly in the sign of contrast, as do opposite
# azimuths of the sun. Measured with `benchmarks/run.py --only mountains`: 15° off costs little.
_AZIMUTHS_DEG = {RADAR: (270.0, 90.0), SUN: (150.0, 120.0, 180.0, 90.0, 30.0, 60.0)}

# First words of the view of a reference that holds heights.
_TERRAIN, _SURFACE = "terrain", "surface"

# Separator between the values of the reference's mask and those of the other image's.
_BETWEEN = ";"

_WORDS = re.compile(rf"{_TERRAIN}[\s,]+({'|'.join(LIGHTS)})(?:[\s,]+azimuth=(\d+(?:\.\d+)?)°?)?")


def asked_masks(given: Mapping[str, Any], image: str) -> tuple[UserMask | None, UserMask | None]:
    """Return the masks of the reference and of `image`, by the values of a tool's parameters."""
    names = ("reference", image)
    masks = [given[f"{name}_mask"] for name in names]
    values = _values_of_each(given["mask_values"], masks)
    reference, other = (
        UserMask.of(given[name], mask, text)
        for name, mask, text in zip(names, masks, values, strict=True)
    )
    return reference, other


def _values_of_each(values: str | None, masks: Sequence[Any]) -> tuple[str | None, str | None]:
    """Return the values of two masks that take no part; a single text is for each mask given."""
    if values is None:
        return None, None
    texts = [part.strip() or None for part in values.split(_BETWEEN)]
    if len(texts) > len(masks):
        raise ParameterError(f"there are two masks, not {len(texts)}, as in {values!r}")
    if len(texts) == 1:
        is_for_all = texts[0] == NONE or all(mask is None for mask in masks)
        texts = [texts[0] if is_for_all or mask is not None else None for mask in masks]
    return texts[0], texts[1]


def asked_surface(given: Mapping[str, Any], image: str) -> StatedSurface | None:
    """Return the elevated objects that a tool's parameters state; None: none are stated.

    Raises
    ------
    ParameterError
        A view is missing or cannot be understood, or has no surface model to go with.
    """
    model = given["surface_model"]
    words = split_views(given["views"])
    if model is None:
        if words[1] is not None or (words[0] is not None and not asked_rendering(given)):
            raise ParameterError(
                "views go with a surface model (surface_model), or state that the reference holds "
                f"heights: '{_TERRAIN} {SUN} azimuth=155', '{_TERRAIN} {RADAR}' or '{_SURFACE} "
                f"{RADAR} azimuth=280 incidence=35'"
            )
        return None
    names = ("reference", image)
    views = [View.of(given[name], word) for name, word in zip(names, words, strict=True)]
    for name, view in zip(names, views, strict=True):
        if view is None:
            raise no_view(given[name], name)
    reference, other = (view for view in views if view is not None)
    return StatedSurface(model, (reference, other))


def specified(preset: Specification, parameters: Mapping[str, Any]) -> Specification:
    """Return a preset with the parameters that a tool was called with."""
    return replace(
        searched(preset, {**USUAL, **parameters}, "input"),
        **asked_terrain(parameters),
        **asked_rendering(parameters),
        model=model_for_grid(
            parameters["model"], grid_of_output(parameters["output"], parameters["output_grid"])
        ),
        rotation_deg=parameters["search_rotation"],
    )


def searched(preset: Specification, given: Mapping[str, Any], image: str) -> Specification:
    """Return a preset with the limits and the surface model that a tool was given."""
    surface, radar = asked_surface(given, image), preset.radar
    return replace(
        preset,
        surface=surface,
        radar=surface.radar if surface is not None and radar == AUTO else radar,
        max_error_px=given["max_error"],
        search_radius_m=given["search_radius"],
        matching_pixel_size_m=given["matching_pixel_size"],
    )


def asked_terrain(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the terrain models of a specification by the values of a tool's parameters.

    Raises
    ------
    ParameterError
        The parameters do not go together.
    """
    dem, input_dem = given.get("dem"), given.get("input_dem")
    if input_dem is not None and dem is None:
        raise ParameterError("the input's terrain model (input_dem) goes with another one (dem)")
    if given.get("dem_datum") is not None and dem is None:
        raise ParameterError("a vertical datum (dem_datum) goes with a terrain model (dem)")
    model = given.get("model", AUTO)
    if dem is not None and model != AUTO:
        raise ParameterError(f"a terrain model (dem) goes with model {AUTO}, not {model}")
    return {"dem": dem, "input_dem": input_dem}


def asked_rendering(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a specification's fields that render a reference of heights; {}: it is an image.

    They are for a single try, with the radar in the west by default.

    Raises
    ------
    ParameterError
        The words state no view, or not the position of the sun or the radar.
    """
    view = asked_surface_view(given)
    if view is not None:
        return {"surface_view": view, "radar": BOTH}
    lights = asked_lights(given)
    if len(lights) > 1 and lights[0].kind == SUN:
        raise ParameterError(
            f"'{_TERRAIN} {SUN}' needs its azimuth, as '{_TERRAIN} {SUN} azimuth=155': the tool "
            "register tries some"
        )
    return {"light": lights[0]} if lights else {}


def asked_surface_view(given: Mapping[str, Any]) -> View | None:
    """Return the view to render a surface model from; None: the reference is no surface model.

    Parameters
    ----------
    given
        The values of a tool's parameters. The reference's view is `surface radar azimuth=280
        incidence=35`, or without the numbers, if the input's metadata state them.

    Raises
    ------
    ParameterError
        The words state no view of a radar.
    """
    words = (split_views(given.get("views"))[0] or "").lower()
    if not words.startswith(_SURFACE):
        return None
    stated = words.removeprefix(_SURFACE).strip(" ,")
    view = View.of(given.get("input"), None) if stated == RADAR else parse_view(stated)
    if view is None or view.sensor != RADAR:
        raise ParameterError(
            f"{words!r} states no radar's view: give '{_SURFACE} {RADAR} azimuth=280 incidence=35'"
        )
    return view


def asked_lights(given: Mapping[str, Any]) -> tuple[Light, ...]:
    """Return the lights in which a terrain model may be rendered; (): the reference is none.

    Parameters
    ----------
    given
        The values of a tool's parameters. The reference's view is `terrain sun azimuth=155`, or
        without azimuth, and then several are tried.

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
