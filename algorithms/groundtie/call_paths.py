"""The paths of one call: no file that it reads or writes is overwritten by another."""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from .errors import OutputError, SameFileError
from .kinds import (
    REPORT_FORMAT,
    FileOut,
    FolderOut,
    InputKind,
    Kind,
    RastersIn,
    Views,
    WrittenKind,
    shown_name,
)
from .raster_names import identity, local_files, rpc_files
from .strict_json import read_json
from .vrt_sources import sources_of


def check_different(rasters: Mapping[str, Any]) -> None:
    """Raise `SameFileError` if two of these checked rasters, by name, are the same."""
    taken: dict[Hashable, str] = {}
    for name, raster in rasters.items():
        other = taken.setdefault(_identity(raster), name)
        if other != name:
            raise SameFileError(f"{name} is the same raster as {other}: {shown_name(raster)}")


def check_paths(values: Iterable[tuple[str, Kind, Any]]) -> None:
    """Check the paths of one call against each other and against the disk.

    Parameters
    ----------
    values
        Name, kind and checked value of every parameter.

    Raises
    ------
    SameFileError
        An output, or a file that is written with it, is an input, a source of a virtual raster
        among the inputs, or another output.
    OutputError
        An output's folder is missing or cannot be written to, a folder is a file, or another file
        is in the place of a report's numbers.
    """
    taken: dict[Hashable, str] = {}
    outputs: list[tuple[str, WrittenKind, Path]] = []
    for name, kind, value in values:
        for read in map(_identity, inputs_of(kind, value)):
            taken[read] = name
            for file in _files_of(read):
                taken.setdefault(file, name)
                for source in sources_of(file):
                    taken.setdefault(source, f"a source of {name}")
        if isinstance(kind, WrittenKind) and value is not None:
            outputs.append((name, kind, value))
    made = {path.resolve() for _, kind, path in outputs if isinstance(kind, FolderOut)}
    for name, kind, path in outputs:
        if isinstance(kind, FolderOut):
            if path.is_file():
                raise OutputError(f"{name} is a file, not a folder: {path}")
            continue
        other = taken.setdefault(path.resolve(), name)
        if other != name:
            raise SameFileError(f"{name} is the same file as {other}: {path}")
        _check_place(name, path, made)
        for rpcs in rpc_files(path):
            if rpcs.resolve() in taken:
                owner = taken[rpcs.resolve()]
                raise SameFileError(
                    f"GDAL would take {rpcs}, which is {owner}, for RPCs of {name}: give {name} "
                    "another name"
                )
    for name, kind, path in outputs:
        for more in kind.also_written(path):
            own = f"a file of {name}"
            other = taken.setdefault(more.resolve(), own)
            if other != own:
                raise SameFileError(
                    f"{name} would also write {more}, which is {other}: give {name} another name"
                )
            if isinstance(kind, FileOut):
                check_numbers(name, more)


def check_numbers(name: str, path: Path) -> None:
    """Raise `OutputError` if the numbers of the report `name` would replace something else.

    Such a file may be read without being named, as the STAC item of an image.
    """
    if path.exists() and _format(path) != REPORT_FORMAT:
        raise OutputError(
            f"{name} would also write {path}, which is something else: remove it, or give {name} "
            "another name"
        )


def inputs_of(kind: Kind, value: Any) -> tuple[Any, ...]:
    """Return the inputs that the checked value of a parameter names."""
    if isinstance(kind, Views):
        return kind.files_named(value)
    if value is None or not isinstance(kind, (InputKind, RastersIn)):
        return ()
    return value if isinstance(kind, RastersIn) else (value,)


def _check_place(name: str, path: Path, made: set[Path]) -> None:
    """Raise `OutputError` if a file cannot be written; some folders are `made` by the call."""
    folder = path.resolve().parent
    if path.is_dir():
        raise OutputError(f"{name} is a folder, not a file: {path}")
    if folder in made and not folder.exists():
        return
    if not folder.is_dir():
        raise OutputError(f"the folder of {name} does not exist: {folder}")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"the folder of {name} cannot be written to: {folder}")


def _identity(raster: Any) -> Hashable:
    """Return a key that is equal for two names of one raster."""
    if isinstance(raster, (str, Path)):
        return identity(raster)
    # An open dataset is identified by its file.
    return getattr(raster, "identity", None) or Path(raster.name).resolve()


def _files_of(read: Hashable) -> list[Path]:
    """Return the files of a raster by its `_identity`; GDAL's names refer to some."""
    if isinstance(read, str):
        return [file.resolve() for file in local_files(read)]
    return [read] if isinstance(read, Path) else []


def _format(path: Path) -> Any:
    """Return the format that a JSON file states; None if it states none."""
    with suppress(OSError, ValueError):
        held = read_json(path)
        return held.get("format") if isinstance(held, dict) else None
    return None
