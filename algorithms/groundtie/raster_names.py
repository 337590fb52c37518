"""Names of rasters: files on disk, GDAL's own names, and files on other machines.

Only this module distinguishes them: code that takes a raster asks it before making a path.
"""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Hashable
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from .errors import ParameterError
from .runs import file_facts, unknown_facts

# GDAL's own names, such as /vsizip/a.zip/b.tif or HDF5:"a.h5"://b; C:\\… is a path.
_GDAL_NAME = re.compile(r"/vsi|[A-Za-z][\w+.-]+:")

# GDAL's prefixes of files in an archive, which may lie in another archive; the path follows.
_IN_ARCHIVE = re.compile(r"((?:/vsi(?:zip|tar|gzip|7z|rar)/)+)(.*)", re.S)

# Separators between the parts of other names, as NETCDF:"a.nc":band; C:\\… is one part.
_PARTS = re.compile(r"[\"{},]|(?<!\b[A-Za-z]):")

# Separators of options, as /vsicached?chunk_size=1000&file=a.tif and vrt://a.tif?bands=1.
_OPTIONS = re.compile(r"[?&=]")

# pathlib makes one slash of two.
_URL = re.compile(r"(/vsicurl/)?(https?|ftp|s3|gs|az|abfss?|oss|file):/{1,2}(?=[^/]|/[^/])", re.I)

# GDAL's virtual file systems that read each kind of URL.
_FILE_SYSTEMS = {
    "http": "/vsicurl/http://",
    "https": "/vsicurl/https://",
    "ftp": "/vsicurl/ftp://",
    "s3": "/vsis3/",
    "gs": "/vsigs/",
    "az": "/vsiaz/",
    "abfs": "/vsiadls/",
    "abfss": "/vsiadls/",
    "oss": "/vsioss/",
}

# File systems that read over a network, also inside of others, as /vsizip//vsicurl/….
_REMOTE = re.compile(
    r"/vsi(curl|s3|gs|az|adls|oss|swift|webhdfs|hdfs)(_streaming)?[/?]|\b(https?|ftp)://", re.I
)

# Suffixes of a GeoTIFF.
GEOTIFF = (".tif", ".tiff")

# Endings of RPC files beside a raster, in place of its suffix, in any case; GDAL takes the first.
_RPC_ENDINGS = (".rpb", "_rpc.txt")

# Suffixes of rasters that may have RPC files.
_WITH_RPCS = (*GEOTIFF, ".ntf", ".nitf", ".jp2", ".j2k", ".img", ".pix", ".til", ".vrt")

# Endings of files by which GDAL places a GeoTIFF without georeferencing, in place of its suffix and
# in any case.
_WORLD_ENDINGS = (".tfw", ".tifw", ".tiffw", ".wld", ".tab")

# Suffixes of files that never have world files: tables, reports and stored transforms. Others may.
_WITHOUT_WORLD_FILES = (".csv", ".json", ".geojson", ".gpkg", ".html", ".txt", ".xml", ".rpb")

# Statement in the table of a raster, but not of a vector layer, which has the same ending.
_TABLE_OF_RASTER = re.compile(rb'^\s*type\s+"?raster\b', re.I | re.M)

# The kind of a text file is stated within this much of its beginning.
SEARCHED_BYTES = 10_000


def raster_name(value: str | os.PathLike[str], folder: Path | None = None) -> Path | str:
    """Return the meaning of a name: a `Path` of a file, or GDAL's own name as text.

    URLs become GDAL's names, also URLs that pathlib has shortened: `https://…` is read by
    `/vsicurl/`, `s3://…` by `/vsis3/`, and so on. A file of exactly that name takes precedence.
    Relative names begin at `folder`, by default the working directory.
    """
    text = os.fspath(value)
    if os.path.lexists(text if folder is None else folder / text):
        return Path(text)
    if url := _URL.match(text):
        kind, rest = url[2].lower(), text[url.end() :]
        return f"{_FILE_SYSTEMS[kind]}{rest}" if kind != "file" else Path(f"/{rest.lstrip('/')}")
    # A `Path` is a file, except that GDAL's virtual file systems look like one.
    is_text = isinstance(value, str) and is_gdal_name(text)
    return text if is_text or text.startswith("/vsi") else Path(text)


def is_utf8(text: str) -> bool:
    """Return whether a text can be UTF-8: JSON and file names may hold half a character."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def require_possible(what: str, name: str) -> None:
    """Raise an error for a name that no file can have, or that no table of results can hold.

    Parameters
    ----------
    what
        The owner of the name, with which the message begins.
    name
        The name.

    Raises
    ------
    ParameterError
        The text cannot be a name.
    """
    if not is_utf8(name):
        raise ParameterError(f"{what} has a name that is not UTF-8: {name!a}")
    if "\0" in name:
        raise ParameterError(f"{what} has a name that no file has: {name!a}")


def located(name: str, beside: Path | str) -> Path | str:
    """Return the meaning of a name in a file, relative to that file's location.

    Raises
    ------
    ParameterError
        No file can have that name.
    """
    require_possible(f"what {beside} names", name)
    found = raster_name(name, beside.parent if isinstance(beside, Path) else None)
    if isinstance(found, str):
        return found
    if isinstance(beside, Path):
        return beside.parent / found
    system, mark, path = beside.rpartition("://")
    folder = path.partition("?")[0].rpartition("/")[0]
    # From the server's root if the name begins with a slash.
    start = folder.partition("/")[0] if mark and name.startswith("/") else folder
    return f"{system}{mark}{posixpath.normpath(f'{start}/{name}')}"


def is_gdal_name(text: str) -> bool:
    """Return whether a text is one of GDAL's own names, unless there is a file of that name."""
    return _GDAL_NAME.match(text) is not None


def is_remote(name: Path | str) -> bool:
    """Return whether a raster is read over a network."""
    return isinstance(name, str) and _REMOTE.search(name) is not None


def in_archive(name: str) -> tuple[str, str]:
    """Return GDAL's prefix of the archives that a raster lies in, and the path that follows.

    The prefix is empty for a raster outside of archives.
    """
    found = _IN_ARCHIVE.fullmatch(name)
    return (found[1], found[2]) if found else ("", name)


def parts_of(name: str) -> list[str]:
    """Return the parts of a name of GDAL's, such as `NETCDF:"a.nc":band`; one part is the file."""
    return _PARTS.split(name)


def local_files(name: str, folder: Path | str = "") -> list[Path]:
    """Return the files on disk that a raster's name refers to: itself, archives, containers.

    There are none for rasters read over a network, for folders, and for missing files.

    Parameters
    ----------
    name
        The name, as GDAL takes it.
    folder
        Folder at which relative names begin; by default the working directory.
    """
    if is_remote(name):
        return []
    # Also the whole name and the whole parts: they may be paths although they look like others.
    parts = (name, *parts_of(name))
    pieces = (*parts, *(piece for part in parts for piece in _OPTIONS.split(part)))
    paths = (in_archive(piece.removeprefix("//"))[1] for piece in pieces)  # of vrt://a.tif
    places = (Path(os.path.abspath(os.path.join(folder, path))) for path in paths if path)
    found = (file_on_the_way_to(place) for place in places)
    return list(dict.fromkeys(file for file in found if file is not None))


def file_on_the_way_to(path: Path) -> Path | None:
    """Return the path, or the first path above it, that is a file, such as an archive."""
    return next((one for one in (path, *path.parents) if os.path.isfile(one)), None)


def facts_behind(name: Path | str) -> list[tuple[Any, ...]]:
    """Return place, size and time of the files that a raster's name refers to.

    A raster read over a network counts by its name. Without any file otherwise, the facts are
    unique, so that the raster never counts as unchanged.
    """
    if is_remote(name):
        return [(str(name),)]
    files = local_files(name) if isinstance(name, str) else [name]
    return [file_facts(file) for file in files if os.path.isfile(file)] or [unknown_facts(name)]


def file_name(name: Any) -> str:
    """Return the last part of a name, without the query of a URL."""
    text = os.fspath(name)
    if is_remote(text):
        return PurePosixPath(urlsplit(text).path).name
    return Path(text).name


def rpc_files(path: Path, more: Path | None = None) -> list[Path]:
    """Return the files beside a raster that GDAL prefers to RPCs in its tags, in that order.

    There are none for a path that is no raster's. `more` is a file that is yet to be written.
    """
    if path.suffix.lower() not in _WITH_RPCS:
        return []
    wanted = _rpc_names(path)
    names = set(_names_beside(path))
    if more is not None and _lies_beside(more, path):
        names.add(more.name)
    found = [name for name in names if name.lower() in wanted]
    return [path.with_name(n) for n in sorted(found, key=lambda n: (wanted.index(n.lower()), n))]


def is_rpc_file_of(path: Path, raster: Path) -> bool:
    """Return whether a file lies beside a raster and has the name of its RPC file."""
    return _lies_beside(path, raster) and path.name.lower() in _rpc_names(raster)


def is_only_raster_of_its_name(path: Path) -> bool:
    """Return whether no other raster in the folder has the same RPC files."""
    return _suffixes_beside(path).isdisjoint(_WITH_RPCS)


def own_world_files(path: Path) -> list[Path]:
    """Return the world files and tables beside a GeoTIFF that belong to no other file.

    GDAL takes them for its georeferencing if it has none. Other paths have none.
    """
    if path.suffix.lower() not in GEOTIFF:
        return []
    if _suffixes_beside(path) - {*_WORLD_ENDINGS, *_WITHOUT_WORLD_FILES}:
        return []
    wanted = [path.stem.lower() + ending for ending in _WORLD_ENDINGS]
    found = [path.with_name(name) for name in _names_beside(path) if name.lower() in wanted]
    return [one for one in found if one.suffix.lower() != ".tab" or _is_of_raster(one, path)]


def _is_of_raster(table: Path, raster: Path) -> bool:
    try:
        with table.open("rb") as file:
            text = file.read(SEARCHED_BYTES)
    except OSError:
        return False
    is_named = os.fsencode(raster.name).lower() in text.lower()
    return is_named and _TABLE_OF_RASTER.search(text) is not None


def _suffixes_beside(path: Path) -> set[str]:
    """Return the endings, in lower case, of other files with the same stem."""
    others = (Path(name) for name in _names_beside(path) if name != path.name)
    return {other.suffix.lower() for other in others if other.stem.lower() == path.stem.lower()}


def _rpc_names(raster: Path) -> list[str]:
    return [raster.stem.lower() + ending for ending in _RPC_ENDINGS]


def _lies_beside(path: Path, other: Path) -> bool:
    return path.parent.resolve() == other.parent.resolve()


def _names_beside(path: Path) -> list[str]:
    try:
        return os.listdir(path.parent)
    except OSError:
        return []


def identity(name: Path | str) -> Hashable:
    """Return a key that is equal for two names of one raster."""
    found = raster_name(name)
    return found.resolve() if isinstance(found, Path) else found
