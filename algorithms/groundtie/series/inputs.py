"""The inputs of a series: files, folders, patterns, tables and STAC items."""

from __future__ import annotations

import datetime
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

from ..errors import ParameterError
from ..raster_names import file_name, identity, located, require_possible
from ..registration.user_masks import UserMask
from ..stac_items import (
    RASTER_SUFFIXES,
    StacItem,
    is_item,
    place_of_asset,
    raster_of_item,
    read_items,
    stated_time,
    time_of,
)
from ..tables import read_rows

_TABLE = (".csv",)

_COLUMNS = ("file", "name", "time", "mask", "mask_values")


@dataclass(frozen=True)
class Listed:
    """One date of a series, as the user named it.

    Parameters
    ----------
    name
        The file's stem, the STAC item's id, or the name in the table.
    raster
        The file, or GDAL's name of it.
    time
        Time of acquisition; None: unknown.
    mask
        Mask of the pixels that take part; None: all do.
    """

    name: str
    raster: Path | str
    time: datetime.datetime | None
    mask: UserMask | None = None

    def anywhere(self) -> Listed:
        """Return the date with absolute paths, for a process in another folder."""
        mask = self.mask
        if mask is not None:
            mask = replace(mask, mask=_absolute(mask.mask))
        return replace(self, raster=_absolute(self.raster), mask=mask)


def _absolute(path: Path | str) -> Path | str:
    return Path(os.path.abspath(path)) if isinstance(path, Path) else path


def list_dates(inputs: Sequence[Path | str], asset: str | None) -> tuple[Listed, ...]:
    """Return the dates of a series in the order of their times or, if one is unknown, as named.

    Parameters
    ----------
    inputs
        Files, URLs, folders of rasters, patterns, CSV tables with a column `file` (and `name`,
        `time`, `mask`, `mask_values`), and STAC items or item collections as JSON.
    asset
        The asset of STAC items whose name states none (`item.json#asset`); None: the only asset
        that is a raster.

    Raises
    ------
    ParameterError
        A named input does not exist, a table or an item cannot be understood, two dates have one
        name, one date has two names, or a name cannot be that of a file.
    """
    found: dict[object, Listed] = {}
    for given in inputs:
        for date in _listed(given, asset):
            _require_file_name(date)
            other = found.setdefault(identity(date.raster), date)
            if date.name not in (other.name, _own_name(date.raster)):
                raise ParameterError(
                    f"{date.raster} is called {other.name} and {date.name}; name it once"
                )
    # A mask that was found beside an image is no date, though its folder lists it.
    for mask in [date.mask for date in found.values() if date.mask is not None]:
        if mask.origin:
            found.pop(identity(mask.mask), None)
    names: dict[str, Listed] = {}
    for date in found.values():
        other = names.setdefault(date.name, date)
        if other is not date:
            raise ParameterError(
                f"two dates are called {date.name}: {other.raster} and {date.raster}; name them in "
                "a CSV table with the columns file and name"
            )
    dates = tuple(found.values())
    if any(date.time is None for date in dates):
        return dates
    return tuple(sorted(dates, key=lambda date: (date.time or datetime.datetime.min, date.name)))


def _listed(given: Path | str, asset: str | None) -> Iterable[Listed]:
    if isinstance(given, str):
        return _of_stac(given, asset) if is_item(given) else [_file(given)]
    files = _standing_for(given)
    if given.is_dir():
        if not files:
            endings = ", ".join(RASTER_SUFFIXES)
            raise ParameterError(f"the folder {given} holds no raster ({endings})")
        return map(_file, files)
    if _is_pattern(given):
        if files:
            return [date for file in files for date in _listed(file, asset)]
        raise ParameterError(f"no file matches {given}")
    if is_item(given):
        return _of_stac(given, asset)
    if not given.is_file():
        raise ParameterError(f"there is no file {given}")
    if given.suffix.lower() in _TABLE:
        return [_of_row(given, number, row) for number, row in enumerate(read_rows(given), start=1)]
    return [_file(given)]


def rasters_behind(given: Path) -> Iterator[Path | str]:
    """Yield the sources of a name's dates: its file, and the files and names that it stands for.

    A file that cannot be read stands for nothing: `list_dates` raises the error.
    """
    files = _standing_for(given)
    if files != [given]:
        for file in files:
            yield from rasters_behind(file)
        return
    yield given
    with suppress(OSError, ParameterError):
        yield from _named_in(given)


def _named_in(given: Path) -> Iterator[Path | str]:
    """Yield the files and names in a STAC item or a table of dates."""
    if is_item(given):
        for item in read_items(given)[0]:
            yield item.place
            for asset in item.assets.values():
                with suppress(ParameterError):
                    yield place_of_asset(asset, item.place)
    elif given.suffix.lower() in _TABLE:
        for row in read_rows(given):
            yield from (located(row[name], given) for name in ("file", "mask") if name in row)


def _standing_for(given: Path) -> list[Path]:
    """Return the files that a folder or a pattern stands for; any other name stands for itself."""
    if given.is_dir():
        return sorted(path for path in given.iterdir() if path.suffix.lower() in RASTER_SUFFIXES)
    return sorted(given.parent.glob(given.name)) if _is_pattern(given) else [given]


def would_stand_for(given: Path, file: Path) -> bool:
    """Return whether a folder or a pattern stands for a file (whole path) once it exists."""
    if given.is_dir():
        return file.parent == given.resolve() and file.suffix.lower() in RASTER_SUFFIXES
    is_there = _is_pattern(given) and file.parent == given.parent.resolve()
    return is_there and fnmatchcase(file.name, given.name)


def _is_pattern(given: Path) -> bool:
    return any(sign in given.name for sign in "*?[") and not given.exists()


def _require_file_name(date: Listed) -> None:
    """Raise an error for a name that no file in the output folder can have."""
    is_given = date.name != _own_name(date.raster)
    if is_given and (date.name in (".", "..") or any(sign in date.name for sign in "/\\\0")):
        raise ParameterError(f"{date.raster} is called {date.name!r}, which cannot name a file")
    require_possible("a date of the series", date.name)


def _own_name(raster: Path | str) -> str:
    return Path(file_name(raster)).stem


def _file(raster: Path | str) -> Listed:
    stem = _own_name(raster)
    return Listed(stem, raster, time_of(stem), UserMask.of(raster, None, None))


def _of_row(path: Path, number: int, row: Mapping[str, str]) -> Listed:
    if "file" not in row:
        raise ParameterError(f"{path}, row {number}: no file ({', '.join(_COLUMNS)})")
    date = _file(raster_of_item(located(row["file"], path)))
    time = _stated(row["time"], f"{path}, row {number}") if "time" in row else date.time
    given = located(row["mask"], path) if "mask" in row else None
    try:
        mask = UserMask.of(date.raster, given, row.get("mask_values"))
    except ParameterError as error:
        raise ParameterError(f"{path}, row {number}: {error}") from error
    return Listed(row.get("name", date.name), date.raster, time, mask)


def _stated(text: str, place: str) -> datetime.datetime:
    time = stated_time(text)
    if time is None:
        raise ParameterError(f"{place}: {text!r} is no time (ISO 8601)")
    return time


def _of_stac(given: Path | str, asset: str | None) -> list[Listed]:
    items, named = read_items(given)
    return [_of_item(item, named or asset) for item in items]


def _of_item(item: StacItem, asset: str | None) -> Listed:
    time = None if item.time is None else _stated(item.time, f"{item.place}, item {item.id}")
    raster = item.raster(asset)
    return Listed(item.id, raster, time, UserMask.of(raster, None, None))
