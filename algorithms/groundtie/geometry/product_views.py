"""Views from products' own metadata files beside the image.

Sentinel-1 (annotation), TerraSAR-X and ICEYE (XML), Capella (extended JSON), Umbra (metadata JSON),
and the XML and IMD files of Maxar. Azimuths are those of the sensor, or of the sun, seen from the
ground.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..rasters.grid import FLATTENING
from ..strict_json import read_json

RADAR, CAMERA = "radar", "camera"

# The sensor, and its angles by name.
Stated = tuple[str, Mapping[str, float]]

# Elements with the heading, the side of the look (None: right) and the incidence angle, by an
# element that only the metadata of that radar contain: Sentinel-1, TerraSAR-X, ICEYE.
_RADARS: Mapping[str, tuple[str, str | None, str]] = {
    ".//platformHeading": (".//platformHeading", None, ".//incidenceAngleMidSwath"),
    ".//productInfo/sceneInfo/headingAngle": (
        ".//headingAngle",
        ".//acquisitionInfo/lookDirection",
        ".//sceneCenterCoord/incidenceAngle",
    ),
    ".//incidence_center": (".//heading", ".//look_side", ".//incidence_center"),
}

# Elements of Maxar's metadata.
_MEANS = ("MEANSATAZ", "MEANSATEL", "MEANSUNAZ", "MEANSUNEL")
_IMD = re.compile(r"\b(mean(?:Sat|Sun)(?:Az|El))\s*=\s*(-?\d[\d.eE+-]*)", re.IGNORECASE)

# A larger file does not hold metadata.
_LARGEST_BYTES = 100_000_000


def metadata_beside(image: Path) -> Iterator[Path]:
    """Yield the files beside an image that may hold metadata, by the products' naming schemes."""
    # Names that are too long are none: `Path.is_file` would raise.
    yield from filter(os.path.isfile, _names_beside(image))


def _names_beside(image: Path) -> Iterator[Path]:
    folder, stem = image.parent, image.stem
    yield folder / f"{stem}_extended.json"  # Capella
    yield folder / f"{re.sub('_(GEC|SICD|MM)$', '', stem)}_METADATA.json"  # Umbra
    yield from (folder / f"{stem}{suffix}" for suffix in (".xml", ".XML", ".IMD"))
    yield folder.parent / "annotation" / f"{stem}.xml"  # Sentinel-1
    if folder.name == "IMAGEDATA":  # TerraSAR-X
        yield folder.parent / f"{folder.parent.name}.xml"


def read_product_view(path: Path) -> Stated | None:
    """Return the sensor and angles, by name, from a product's metadata; None if it has no view.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        The file is damaged, or lacks a required value.
    """
    if path.stat().st_size > _LARGEST_BYTES:
        raise ValueError("it is too large")
    try:
        if path.suffix.lower() == ".json":
            return _of_json(read_json(path))
        if path.suffix.lower() == ".imd":
            return _of_imd(path.read_text(encoding="utf-8-sig"))
        return _of_xml(ElementTree.parse(path).getroot())
    except ElementTree.ParseError as error:
        raise ValueError(str(error)) from error
    except (KeyError, IndexError, TypeError, AttributeError) as error:
        raise ValueError(f"it lacks {error}") from error


def _of_json(found: Any) -> Stated | None:
    if not isinstance(found, dict):
        return None
    if isinstance(found.get("collects"), list):
        return _umbra(found["collects"][0])
    if isinstance(found.get("collect"), dict):
        return _capella(found["collect"])
    return None


def _of_xml(root: ElementTree.Element) -> Stated | None:
    for own, (heading, side, incidence) in _RADARS.items():
        if root.find(own) is not None:
            heading_deg = _number(root, heading)
            look = "right" if side is None else _text(root, side)
            return RADAR, _from_track(heading_deg, look, _number(root, incidence))
    if root.find(".//IMD/IMAGE/MEANSATAZ") is not None:
        return _of_means({tag: _number(root, f".//IMAGE/{tag}") for tag in _MEANS})
    return None


def _of_imd(text: str) -> Stated:
    return _of_means({key.upper(): float(value) for key, value in _IMD.findall(text)})


def _umbra(collect: Mapping[str, Any]) -> Stated:
    """Return the view of a collect, whose azimuth already is from the ground to the satellite."""
    return RADAR, {
        "azimuth": float(collect["angleAzimuthDegrees"]) % 360,
        "incidence": float(collect["angleIncidenceDegrees"]),
    }


def _capella(collect: Mapping[str, Any]) -> Stated:
    """Return the view of a collect, from its centre to the middle one of the state vectors."""
    centre = collect["image"]["center_pixel"]
    states = collect["state"]["state_vectors"]
    azimuth = _azimuth_deg(centre["target_position"], states[len(states) // 2]["position"])
    return RADAR, {"azimuth": azimuth, "incidence": float(centre["incidence_angle"])}


def _azimuth_deg(ground: Any, sensor: Any) -> float:
    """Return the azimuth of a sensor seen from the ground, both in geocentric coordinates."""
    x, y, z = (float(value) for value in ground)
    east = np.array([-y, x, 0.0]) / np.hypot(x, y)
    # Geodetic latitude, that of the ellipsoid's normal, exact on the ellipsoid.
    latitude = np.arctan2(z, (1 - FLATTENING) ** 2 * np.hypot(x, y))
    longitude = np.arctan2(y, x)
    north = np.array(
        [
            -np.sin(latitude) * np.cos(longitude),
            -np.sin(latitude) * np.sin(longitude),
            np.cos(latitude),
        ]
    )
    away = np.asarray(sensor, float) - np.asarray(ground, float)
    return float(np.degrees(np.arctan2(away @ east, away @ north)) % 360)


def _from_track(heading_deg: float, side: str, incidence_deg: float) -> dict[str, float]:
    """Return the view of a radar that looks to one side, at right angles to its track."""
    if side.lower() not in ("left", "right"):
        raise ValueError(f"a radar does not look to the {side!r}")
    look = heading_deg + (90.0 if side.lower() == "right" else -90.0)
    return {"azimuth": (look + 180.0) % 360, "incidence": incidence_deg}


def _of_means(means: Mapping[str, float]) -> Stated:
    return CAMERA, {
        "azimuth": means["MEANSATAZ"] % 360,
        "incidence": 90.0 - means["MEANSATEL"],
        "sun-azimuth": means["MEANSUNAZ"] % 360,
        "sun-elevation": means["MEANSUNEL"],
    }


def _text(root: ElementTree.Element, path: str) -> str:
    found = root.findtext(path)
    if found is None:
        raise KeyError(path.rpartition("/")[2])
    return found.strip()


def _number(root: ElementTree.Element, path: str) -> float:
    return float(_text(root, path))
