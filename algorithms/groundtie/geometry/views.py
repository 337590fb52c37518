"""Viewing geometry of an image: azimuth and incidence angle of the sensor, and the sun's position.

Views come from words, from the STAC item that providers put beside an image (view extension,
[STAC2021]), or from a product's own metadata (`product_views`).
"""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ParameterError
from ..kinds import is_view_file, views_in
from ..rasters.reading import open_raster
from ..strict_json import read_json
from .product_views import CAMERA, RADAR, metadata_beside, read_product_view

_LOG = logging.getLogger(__name__)

SENSORS = (RADAR, CAMERA)

_USAGE = (
    "give STAC items (.json), a product's metadata (.json, .xml, .imd), or words such as "
    f"'{RADAR} azimuth=280 incidence=35; {CAMERA} azimuth=250 incidence=12 sun-azimuth=155 "
    "sun-elevation=48'"
)
_WORD = re.compile(r"([a-z-]+)=(-?\d+(?:\.\d+)?)°?")

# The angles that a view can state, and the range of each.
_RANGES = {
    "azimuth": (-360.0, 360.0),
    "incidence": (0.0, 80.0),
    "sun-azimuth": (-360.0, 360.0),
    "sun-elevation": (1.0, 90.0),
}
# Distance of a satellite, 600 km high, from the Earth's centre in Earth radii. At 30° off nadir,
# a height of 500 or 770 km changes the incidence angle by up to 1°.
_ORBIT_RADII = 1 + 600 / 6371

# A radar that looks straight down has no range resolution on the ground.
_STEEPEST_RADAR_DEG = 5.0


@dataclass(frozen=True)
class View:
    """Viewing geometry of an image.

    Parameters
    ----------
    sensor
        One of `SENSORS`.
    azimuth_deg
        Azimuth of the sensor, seen from the ground, clockwise from the map's north.
    incidence_deg
        Angle between the line of sight and the vertical, on the ground.
    sun_azimuth_deg, sun_elevation_deg
        Azimuth of the sun, likewise, and its elevation above the horizon; None: unknown, or
        irrelevant.
    """

    sensor: str
    azimuth_deg: float
    incidence_deg: float
    sun_azimuth_deg: float | None = None
    sun_elevation_deg: float | None = None

    @classmethod
    def of(cls, image: Any, given: str | None) -> View | None:
        """Return the view of an image, as given or from the metadata beside the image.

        Parameters
        ----------
        image
            The image, as `open_raster` takes it.
        given
            The name of a STAC item or of a product's metadata file, or words; None: a file beside
            the image under the image's name, a STAC item first.

        Raises
        ------
        ParameterError
            The given file or words state no view.
        """
        if given is not None:
            return stated_view(given)
        if not isinstance(image, (str, Path)):
            return None
        if _is_item(beside := _item_beside(Path(image))):
            return read_view(beside)
        of_product = map(_product_view, metadata_beside(Path(image)))
        return next((view for view in of_product if view is not None), None)


def no_view(image: Any, name: str) -> ParameterError:
    """Return the error that the view of an image is not known.

    Raises
    ------
    RasterOpenError
        The image is not there at all.
    """
    with open_raster(image, allow_sensor_geometry=True):
        return ParameterError(
            f"the view of the {name} is not known: put its STAC item or its product's metadata "
            "beside it, or give views"
        )


def files_beside(image: Path) -> Iterator[Path]:
    """Yield the files beside an image that may state its view: STAC item, product's metadata."""
    if _is_item(item := _item_beside(image)):
        yield item
    yield from metadata_beside(image)


def _item_beside(image: Path) -> Path:
    return image.parent / f"{image.stem}.json"


def split_views(words: str | None) -> tuple[str | None, str | None]:
    """Return the words for the reference and for the input, from `reference; input`.

    Raises
    ------
    ParameterError
        More than two views are stated.
    """
    parts = [view or None for view in views_in(words)]
    if len(parts) > 2:
        raise ParameterError(f"{words!r} states {len(parts)} views; {_USAGE}")
    return parts[0], parts[1] if len(parts) > 1 else None


def stated_view(given: str) -> View:
    """Return the view that a named file, or words, state; `ParameterError` if they state none."""
    if not is_view_file(given):
        return parse_view(given)
    path = Path(given)
    try:
        stated = read_product_view(path)
    except (OSError, ValueError) as error:
        raise ParameterError(f"cannot read the view in {path}: {error}") from error
    return read_view(path) if stated is None else _view(*stated, str(path))


def parse_view(text: str) -> View:
    """Return the view that words state: `radar azimuth=280 incidence=35`.

    Raises
    ------
    ParameterError
        The words state no view.
    """
    sensor, *words = text.replace(",", " ").lower().split() or [""]
    found = [_WORD.fullmatch(word) for word in words]
    if sensor not in SENSORS or None in found:
        raise ParameterError(f"{text!r} states no view: {_USAGE}")
    values = {match[1]: float(match[2]) for match in found if match}
    if len(values) < len(words):
        raise ParameterError(f"{text!r} states an angle twice: {_USAGE}")
    return _view(sensor, values, repr(text))


def read_view(path: Path) -> View:
    """Return the view that a STAC item states.

    `view:azimuth` is the azimuth of the line of sight from the sensor to the ground. An item with
    any property of the SAR extension is of a radar. If only the angle off nadir is given, the
    incidence angle is computed from it; the Earth's curvature makes it larger.

    Raises
    ------
    ParameterError
        The file cannot be read, is no STAC item, or states no view.
    """
    try:
        properties = read_json(path)["properties"]
        values = {
            "azimuth": properties["view:azimuth"] + 180.0,
            "incidence": properties.get("view:incidence_angle"),
            "sun-azimuth": properties.get("view:sun_azimuth"),
            "sun-elevation": properties.get("view:sun_elevation"),
        }
        sensor = RADAR if any(key.startswith("sar:") for key in properties) else CAMERA
        off_nadir = properties.get("view:off_nadir")
        if values["incidence"] is None and off_nadir is not None:
            values["incidence"] = _incidence_deg(float(off_nadir))
        given = {name: float(value) for name, value in values.items() if value is not None}
    except (OSError, ValueError) as error:
        raise ParameterError(f"cannot read the view in {path}: {error}") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise ParameterError(f"{path} is no STAC item with view:azimuth: {_USAGE}") from error
    # The sun does not matter to a radar.
    wanted = given if sensor == CAMERA else {k: given[k] for k in given if "sun" not in k}
    return _view(sensor, {**wanted, "azimuth": wanted["azimuth"] % 360}, str(path))


def _incidence_deg(off_nadir_deg: float) -> float:
    """Return the incidence angle on the ground of a satellite's line of sight off nadir."""
    return math.degrees(math.asin(min(_ORBIT_RADII * math.sin(math.radians(off_nadir_deg)), 1.0)))


def _product_view(path: Path) -> View | None:
    """Return the view in a file beside an image; None if the file is not metadata with a view."""
    try:
        stated = read_product_view(path)
    except (OSError, ValueError) as error:
        _LOG.info("%s states no view: %s", path, error)
        return None
    return None if stated is None else _view(*stated, str(path))


def _view(sensor: str, values: Mapping[str, float], origin: str) -> View:
    for name, value in values.items():
        if name not in _RANGES:
            raise ParameterError(f"{origin}: there is no {name}; {_USAGE}")
        low, high = _RANGES[name]
        if name == "incidence" and sensor == RADAR:
            low = _STEEPEST_RADAR_DEG
        if not low <= value <= high:
            raise ParameterError(f"{origin}: {name} must be {low:g} to {high:g} °, not {value:g}")
    missing = [name for name in ("azimuth", "incidence") if name not in values]
    if ("sun-azimuth" in values) != ("sun-elevation" in values):
        missing += [name for name in ("sun-azimuth", "sun-elevation") if name not in values]
    if missing:
        raise ParameterError(f"{origin} does not state {' and '.join(missing)}: {_USAGE}")
    return View(
        sensor,
        values["azimuth"],
        values["incidence"],
        values.get("sun-azimuth"),
        values.get("sun-elevation"),
    )


def _is_item(path: Path) -> bool:
    """Whether a file is a STAC item with a view; reports and transforms are JSON files, too."""
    try:
        found = read_json(path)
    except (OSError, ValueError):
        return False
    properties = found.get("properties") if isinstance(found, dict) else None
    return isinstance(properties, dict) and "view:azimuth" in properties


def direction(azimuth_deg: float) -> tuple[float, float]:
    """Return the step (east, north) of length 1 towards an azimuth."""
    azimuth = math.radians(azimuth_deg)
    return math.sin(azimuth), math.cos(azimuth)
