"""The files that a call reads: those that its inputs stand for, and those beside them."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from ..call_paths import inputs_of
from ..declaration import Tool
from ..geometry.views import files_beside
from ..kinds import Kind, RastersIn
from ..masks.beside import mask_beside
from ..raster_names import facts_behind, local_files
from ..runs import file_facts
from ..series.inputs import rasters_behind
from ..vrt_sources import sources_of

# Files that GDAL reads beside another have its name, with an ending added or replaced. GDAL itself
# is not asked: it would open each file in this process, which a file that crashes it would end. The
# endings differ between drivers and missions, so that all count except these: tools write them, and
# no driver takes them for a part of an image.
_OF_NO_RASTER = (".csv", ".json", ".geojson", ".gpkg", ".html")

# Suffixes of the stem, for RPCs and metadata of several missions.
_MORE = ("", "_rpc", "_metadata")

# Replacements of IMG in the names of Airbus and ALOS, for files that all tiles share.
_OF_PRODUCT = ("dim", "rpc", "hdr")
_TILE = re.compile(r"_r\d+c\d+$")

# Returns the names in a folder, by their stems in lower case.
Listed = Callable[[Path], Mapping[str, Collection[str]]]


def names_in(folder: Path) -> dict[str, list[str]]:
    """Return the names in a folder, by their stems in lower case; none if it cannot be listed."""
    found: dict[str, list[str]] = {}
    with suppress(OSError):
        for name in sorted(os.listdir(folder)):
            found.setdefault(Path(name).stem.lower(), []).append(name)
    return found


def files_read(kind: Kind, value: Any) -> Iterator[Path]:
    """Return the files, or folders of one raster, that a parameter's checked value stands for."""
    return chain.from_iterable(map(_files_of, _names_read(kind, value)))


def _files_of(name: Path | str) -> Collection[Path]:
    return (name,) if isinstance(name, Path) else local_files(name)


def _names_read(kind: Kind, value: Any) -> Iterator[Path | str]:
    """Yield the files and GDAL's names that a parameter's checked value stands for."""
    for given in inputs_of(kind, value):
        is_several = isinstance(given, Path) and isinstance(kind, RastersIn)
        yield from rasters_behind(given) if is_several else (given,)


def facts_read(
    tool: Tool, values: Mapping[str, Any], written: Collection[Path], listed: Listed
) -> list[tuple[Any, ...]]:
    """Return place, size and time of all files that a call reads, as facts for its key.

    A file on a server counts by its name. A file that is not found never counts as unchanged.

    Parameters
    ----------
    tool, values
        The call.
    written
        Files that the call writes: they may lie beside its inputs, but are not read.
    listed
        `names_in`, perhaps with a cache: calls read many files of few folders.
    """
    own = {os.path.abspath(path) for path in written}
    facts: list[tuple[Any, ...]] = []
    for parameter in tool.parameters:
        # Listed once, because tables and STAC items are read for it.
        names = list(_names_read(parameter.kind, values[parameter.name]))
        of_gdal = (name for name in names if isinstance(name, str))
        found = list(chain.from_iterable(map(facts_behind, of_gdal)))
        for path in chain.from_iterable(map(_files_of, names)):
            inside = sorted(path.rglob("*")) if path.is_dir() else ()
            found += map(_facts, chain([path], inside, _beside(path, listed)))
            found += chain.from_iterable(map(facts_behind, sources_of(path)))
        facts += [(parameter.name, *one) for one in found if one[0] not in own]
    return facts


def _facts(path: Path) -> tuple[Any, ...]:
    """Return the absolute path, and size in bytes and time in nanoseconds of a file."""
    place = os.path.abspath(path)
    # A folder's own size and time do not describe the files in it.
    return (place,) if path.is_dir() else file_facts(place)


def _beside(path: Path, listed: Listed) -> Iterator[Path]:
    """Yield the existing files beside a file that belong to it by their names."""
    there = listed(path.parent)
    names = chain.from_iterable(there.get(stem, ()) for stem in _stems_beside(path))
    for name in names:
        if name != path.name and not name.lower().endswith(_OF_NO_RASTER):
            yield path.with_name(name)
    if (mask := mask_beside(path)) is not None:
        yield mask[0]
    yield from files_beside(path)


def _stems_beside(path: Path) -> list[str]:
    """Return the stems, in lower case, of files that belong to a file."""
    name, stem = path.name.lower(), path.stem.lower()
    stems = [name, f"{name}.aux", *(stem + more for more in _MORE)]
    if stem.startswith(("img_", "img-")):
        parts = dict.fromkeys((stem[3:], _TILE.sub("", stem[3:])))
        stems += [kind + rest for kind in _OF_PRODUCT for rest in parts]
    return list(dict.fromkeys(stems))
