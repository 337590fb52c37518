"""STAC items as inputs: JSON, local or over HTTP, with rasters as assets.

Items are read as plain JSON, of any version of STAC: the needed members have not changed since 1.0
(https://github.com/radiantearth/stac-spec).
"""

from __future__ import annotations

import datetime
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from .errors import ParameterError
from .raster_names import GEOTIFF, file_name, located
from .strict_json import parse_json

_DAY = re.compile(r"(?<!\d)((?:19|20)\d\d)[-_]?(0[1-9]|1[0-2])[-_]?(0[1-9]|[12]\d|3[01])(?!\d)")
_YEAR = re.compile(r"(?<!\d)((?:19|20)\d\d)(?!\d)")

# ISO 8601, with all separators between numbers or none.
_MONTH = re.compile(r"\d{4}(-\d\d)?", re.ASCII)
_TIME = re.compile(
    r"(?P<year>\d{4})(?P<dash>-?)(?P<month>\d\d)(?P=dash)(?P<day>\d\d)"
    r"([T ](?P<hour>\d\d)((?P<colon>:?)(?P<minute>\d\d)"
    r"((?P=colon)(?P<second>\d\d)([.,](?P<fraction>\d+))?)?)?"
    r"(Z|(?P<sign>[+-])(?P<ahead>[01]\d|2[0-3])(:?(?P<rest>[0-5]\d))?)?)?",
    re.ASCII | re.IGNORECASE,
)
_UNITS = ("year", "month", "day", "hour", "minute", "second")

SUFFIXES = (".json", ".geojson")

# Suffixes of files that are rasters, whatever type an item states.
RASTER_SUFFIXES = (*GEOTIFF, ".jp2", ".vrt", ".img")

# Timeout of a silent server.
SILENT_SECONDS = 30


@dataclass(frozen=True)
class StacItem:
    """An item of a catalogue.

    Parameters
    ----------
    id
        The item's id.
    time
        Time of acquisition as stated; None: not stated.
    assets
        The item's assets by name.
    place
        Place of the JSON.
    """

    id: str
    time: str | None
    assets: Mapping[str, Any]
    place: Path | str

    def raster(self, asset: str | None) -> Path | str:
        """Return an asset's file or GDAL's name of it; None takes the only one that is a raster.

        Raises
        ------
        ParameterError
            There is no such asset, or none or several are rasters.
        """
        rasters = [name for name, one in self.assets.items() if _is_raster(one)]
        if asset is None and len(rasters) != 1:
            raise ParameterError(
                f"{self.place}: the item {self.id} has {len(rasters)} rasters; name one of its "
                f"assets, as {file_name(self.place)}#NAME: {', '.join(sorted(self.assets))}"
            )
        name = rasters[0] if asset is None else asset
        if name not in self.assets:
            raise ParameterError(f"{self.place}: the item {self.id} has no asset {name}")
        return place_of_asset(self.assets[name], self.place)


def place_of_asset(asset: Mapping[str, Any], place: Path | str) -> Path | str:
    """Return the place of an asset of an item at `place`: a file, or GDAL's name of it.

    Catalogues state URLs. File names in them should be percent-encoded, but often are not.

    Raises
    ------
    ParameterError
        No file can have that name.
    """
    href = str(asset["href"])
    literal = located(href, place)
    if not isinstance(literal, Path):
        return literal
    decoded = located(unquote(href), place)
    return literal if os.path.exists(literal) and not os.path.exists(decoded) else decoded


def is_item(name: Path | str) -> bool:
    """Return whether a name is that of a JSON file, with an asset or without."""
    return Path(file_name(_split(name)[0])).suffix.lower() in SUFFIXES


def raster_of_item(name: Path | str) -> Path | str:
    """Return the raster of `item.json#asset`, or of `item.json` with one raster; other names as is.

    Raises
    ------
    ParameterError
        The item cannot be read, is one of several, or has no such asset.
    """
    if not is_item(name) or (isinstance(name, Path) and "#" not in name.name and not name.exists()):
        return name  # a missing file is no item
    items, asset = read_items(name)
    if len(items) != 1:
        raise ParameterError(f"{name} has {len(items)} STAC items; one is needed")
    return items[0].raster(asset)


def read_items(name: Path | str) -> tuple[list[StacItem], str | None]:
    """Return the items of a JSON file, and the asset that its name names after a #.

    Raises
    ------
    ParameterError
        The file cannot be read, or is no STAC item or item collection.
    """
    place, asset = _split(name)
    try:
        content = parse_json(_read(place))
    except (OSError, ValueError) as error:
        raise ParameterError(f"cannot read the STAC file {place}: {error}") from error
    stated = content if isinstance(content, dict) else {}
    items = [stated] if stated.get("type") == "Feature" else stated.get("features")
    if not isinstance(items, list):
        raise ParameterError(f"{place} is no STAC item or item collection")
    try:
        return [_item(place, item) for item in items], asset
    except KeyError as error:
        raise ParameterError(f"{place} is no STAC item: {error} is missing") from error
    except (TypeError, AttributeError) as error:
        raise ParameterError(f"{place} is no STAC item: {error}") from error


def _item(place: Path | str, item: Mapping[str, Any]) -> StacItem:
    time = (item.get("properties") or {}).get("datetime")
    assets = {str(name): {"href": one["href"], **one} for name, one in item["assets"].items()}
    return StacItem(str(item["id"]), None if time is None else str(time), assets, place)


def _split(name: Path | str) -> tuple[Path | str, str | None]:
    """Return a name without the asset after its #, and the asset."""
    text, mark, asset = str(name).rpartition("#")
    if not mark or (isinstance(name, Path) and name.exists()):
        return name, None
    return (Path(text) if isinstance(name, Path) else text), asset


def _read(place: Path | str) -> bytes:
    if isinstance(place, Path):
        return place.read_bytes()
    url = place.removeprefix("/vsicurl/")
    if not url.startswith(("http://", "https://")):
        raise ValueError("STAC items are read from disk and by http only")
    return _download(url)


def _download(url: str) -> bytes:
    """Return the content of a URL.

    Raises
    ------
    OSError
        The URL cannot be read.
    """
    # These take longer to import than a file to read, and all tools import this module.
    import http.client
    import urllib.error
    import urllib.request

    try:
        with urllib.request.urlopen(url, timeout=SILENT_SECONDS) as answer:
            return bytes(answer.read())
    except urllib.error.HTTPError as error:
        error.close()
        raise
    except http.client.HTTPException as error:
        raise OSError(error) from error


def _is_raster(asset: Mapping[str, Any]) -> bool:
    kind, href = str(asset.get("type") or ""), str(asset["href"])
    is_image = kind.startswith("image/") and kind not in ("image/png", "image/jpeg")
    return is_image or (not kind and Path(file_name(href)).suffix.lower() in RASTER_SUFFIXES)


def stated_time(text: str) -> datetime.datetime | None:
    """Return the time, in UTC, of a text in ISO 8601, at least a year; None: it is no time.

    Python's own parser is not used, because its versions accept different texts.
    """
    text = text.strip()
    if _MONTH.fullmatch(text):
        text = f"{text}-01-01"[: len("2020-01-01")]
    found = _TIME.fullmatch(text)
    if found is None:
        return None
    year, month, day, hour, minute, second = (int(found[unit] or 0) for unit in _UNITS)
    microsecond = int((found["fraction"] or "0")[:6].ljust(6, "0"))
    ahead = datetime.timedelta(hours=int(found["ahead"] or 0), minutes=int(found["rest"] or 0))
    try:
        time = datetime.datetime(year, month, day, hour, minute, second, microsecond)
        return time + ahead if found["sign"] == "-" else time - ahead
    except (ValueError, OverflowError):  # 30 February, 25:00; before the year 1
        return None


def time_of(name: str) -> datetime.datetime | None:
    """Return the time in a file's name: the whole name, or a day or a year in it."""
    day = _DAY.search(name)
    if day is None:
        year = _YEAR.search(name)
        return None if year is None else datetime.datetime(int(year.group(1)), 1, 1)
    # Before the time of day, most names have another separator than ISO 8601.
    stated = stated_time(name) or stated_time(name.replace("_", "T", 1))
    try:
        return stated or datetime.datetime(*map(int, day.groups()))  # type: ignore[arg-type]
    except ValueError:  # 30 February
        return None
