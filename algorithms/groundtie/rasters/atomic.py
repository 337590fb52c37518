"""Outputs that are whole or not there: written beside their final name, renamed when complete."""

from __future__ import annotations

import contextlib
import csv
import errno
import itertools
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..errors import GroundTieError, OutputError, raised_by
from ..raster_names import is_only_raster_of_its_name, own_world_files, rpc_files
from ..runs import has_written, run_tags, will_make
from .hidden_files import Claim, final_name, hidden_name, new_token, remove

# What GDAL and SQLite put beside a file, appended to its whole name.
SIDECARS = (".aux.xml", ".ovr", ".msk", "-wal", "-shm", "-journal")

_ROLE = re.compile(r"-new(\.[^.]*)?$")

# Of Linux and Windows, in bytes or characters.
LONGEST_NAME = 255

# The rest of a hidden name takes up to 40.
_LONGEST_IN_HIDDEN = LONGEST_NAME - 40

_FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))


class Outputs:
    """The output files of one job, which appear together when all of them are complete.

    Inside the `with` block they are written under hidden names in the folders of their final
    names. Leaving the block renames them, in the order in which they were staged; leaving it by an
    exception removes them. Sidecar files (`.aux.xml`) go along, just before their files; those of a
    file that is replaced (`.msk`, `-wal`, RPCs, world files, …) disappear. What runs that died left
    in these folders is removed.
    """

    def __init__(self) -> None:
        self._token = new_token()
        self._claims: dict[Path, Claim] = {}
        self._staged: dict[Path, Path] = {}
        self._aside: dict[Path, Path] = {}
        self._names = itertools.count()

    def __enter__(self) -> Outputs:
        return self

    def stage(self, path: str | os.PathLike[str]) -> Path:
        """Return the name under which to write the output `path` for now; its suffix is kept.

        Raises
        ------
        OutputError
            `path` is a folder, lies in none or in one that cannot be written to, has a name that
            is too long, or was staged already.
        """
        final = Path(os.path.abspath(path))
        if final in self._staged:
            raise OutputError(f"output is named twice: {path}")
        with writing(final):  # no system looks for a name that is too long
            is_folder = final.is_dir()
        if is_folder:
            raise OutputError(f"output is a folder, not a file: {path}")
        if not final.parent.is_dir():
            raise OutputError(f"the folder of the output does not exist: {final.parent}")
        staged = self._hidden(final, "new")
        self._staged[final] = staged
        return staged

    def staged(self, path: str | os.PathLike[str]) -> Path:
        """Return where an output that was staged lies until all are complete.

        Renaming it changes neither its size nor its time.
        """
        return self._staged[Path(os.path.abspath(path))]

    def withdraw(self, path: str | os.PathLike[str]) -> None:
        """Remove what was written of an output, and stage it no longer: the others stand."""
        staged = self._staged.pop(Path(os.path.abspath(path)))
        for present in (*_sidecars(staged), staged):
            remove(present)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self._commit()
        finally:
            # After a commit there are but the old files.
            for path in (*self._staged.values(), *self._aside.values()):
                for present in (*_sidecars(path), path):
                    remove(present)
            for claim in self._claims.values():
                claim.close()

    def _hidden(self, final: Path, role: str) -> Path:
        folder = final.parent
        if folder not in self._claims:
            with writing(final):
                self._claims[folder] = Claim(folder, self._token)
        fits = len(os.fsencode(final.name)) <= _LONGEST_IN_HIDDEN
        stem = final.stem if fits else f"output-{next(self._names)}"
        return folder / hidden_name(self._token, role, stem, final.suffix)

    def _commit(self) -> None:
        """Put all files in their places, one by one; if one cannot be, undo all.

        At no moment is a final name missing that was there: a file is replaced in one step. For
        this, all must be on the disk before the first is.
        """
        missing = [final for final, staged in self._staged.items() if not staged.exists()]
        if missing:
            raise OutputError(f"output was not written: {missing[0]}")
        for staged in self._staged.values():
            with writing(staged):
                for path in (*_sidecars(staged), staged):
                    _flush(path)
        made: list[Path] = []
        final = Path()
        try:
            for final, staged in self._staged.items():
                stale = self._stale(final)
                self._keep(final, *stale)
                # Before it is replaced: statistics or a mask of another file would be wrong.
                for sidecar in stale:
                    sidecar.unlink()
                for path in (*_sidecars(staged), staged):
                    place = _beside(final, path.name[len(staged.name) :])
                    is_new = not os.path.lexists(place) and place not in self._aside
                    os.replace(path, place)
                    made += [place] if is_new else []
                    has_written(place)
        except BaseException as error:
            self._undo(made)
            if isinstance(error, OSError):
                raise OutputError(f"cannot write {final}: {_reason(error)}") from error
            raise
        for folder in self._claims:
            # Not all systems open folders, nor do all disks need it.
            with contextlib.suppress(OSError):
                _flush(folder)

    def _keep(self, *files: Path) -> None:
        """Give files a second name, by which to undo that they are replaced."""
        for old in files:
            aside = self._hidden(old, "old")
            # Some disks know no second names: what is replaced there cannot be undone.
            with contextlib.suppress(OSError):
                os.link(old, aside)
                self._aside[old] = aside

    def _stale(self, final: Path) -> list[Path]:
        """Return what lies beside a file and would be wrong for another one of its name."""
        # GDAL takes what RPCs lie beside a raster for the raster's own, and world files, too.
        rpcs = [path for path in rpc_files(final) if path not in self._staged]
        is_own = bool(rpcs) and is_only_raster_of_its_name(final)
        return [*_sidecars(final), *(rpcs if is_own else ()), *own_world_files(final)]

    def _undo(self, made: list[Path]) -> None:
        for path in made:
            remove(path)
        for old, aside in self._aside.items():
            with contextlib.suppress(OSError):
                os.replace(aside, old)


@contextlib.contextmanager
def writing(path: str | os.PathLike[str], needed: int | None = None) -> Iterator[None]:
    """Turn what goes wrong while `path` is written into `OutputError`, with the name and reason.

    Parameters
    ----------
    path
        The output; for one that is staged the message gives its final name.
    needed
        Its size in bytes, where that is known.
    """
    try:
        yield
    except GroundTieError:
        raise
    except Exception as error:
        if not (isinstance(error, OSError) or raised_by(error, "rasterio")):
            raise
        if isinstance(error, OSError) and error.errno in _FULL:
            raise no_space(path, needed) from error
        raise OutputError(f"cannot write {final_name(path)}: {_reason(error)}") from error


def write_json(path: Path, values: Mapping[str, Any], indent: int | None = 1) -> None:
    """Write values, and the id of the call that makes them (see `runs`), as strict JSON.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    text = json.dumps({**values, **run_tags()}, indent=indent, allow_nan=False, ensure_ascii=False)
    with writing(path):
        path.write_text(text, encoding="utf-8")


def make_folder(folder: Path) -> None:
    """Make a folder, and those that it lies in, if it is not there; errors as `writing`.

    If it is still empty when the call of the tool ends, it is removed (see `runs`).
    """
    will_make(folder)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)


def write_csv(path: Path, columns: Iterable[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write rows, by the names of their columns, as a CSV table.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    with writing(path), path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(columns), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


@contextlib.contextmanager
def scratch_file(path: Path) -> Iterator[Path]:
    """Give the name of a file beside a staged output that its job alone needs, and remove it."""
    # The same token: should the job be killed, this file is a leftover, too.
    scratch = path.with_name(_ROLE.sub(r"-tmp\1", path.name))
    if scratch == path:
        scratch = path.with_name(hidden_name(new_token(), "tmp", path.stem, path.suffix))
    try:
        yield scratch
    finally:
        remove(scratch)


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make a folder for files that nobody else needs, among the system's temporary ones.

    Raises
    ------
    OutputError
        There is no place for it.
    """
    parent, token = Path(tempfile.gettempdir()), new_token()
    folder = parent / hidden_name(token, "tmp", "scratch")
    with writing(folder):
        claim = Claim(parent, token)
    try:
        with writing(folder):
            folder.mkdir(mode=0o700)
        yield folder
    finally:
        remove(folder)
        claim.close()


def no_space(path: str | os.PathLike[str], needed: float | None = None) -> OutputError:
    """Return the error that a disk is full.

    Parameters
    ----------
    path
        What is written, complete or not.
    needed
        How many bytes it would have, if that is known.
    """
    final = Path(final_name(path))
    free = free_bytes(path)
    sizes = f"{_size(free)} free"
    if needed is not None:
        sizes = f"{_size(needed)} needed, {sizes}"
    return OutputError(f"no space left on {final.parent}: {sizes} (writing {final.name})")


def free_bytes(path: str | os.PathLike[str]) -> int:
    """Return how large a file may become, which may be there in part."""
    path = Path(path)
    taken = path.stat().st_size if path.exists() else 0
    usage = shutil.disk_usage(path.parent)
    # Some network disks do not tell.
    return usage.free + taken if usage.total else sys.maxsize


def _size(count: float) -> str:
    unit, in_units = next(
        (found for found in (("kB", count / 1e3), ("MB", count / 1e6)) if found[1] < 999.5),
        ("GB", count / 1e9),
    )
    return f"{in_units:.3g} {unit}" if in_units < 999.5 else f"{in_units:.0f} {unit}"


def _reason(error: Exception) -> str:
    # rasterio points to the exception before: that one states what happened.
    cause = error.__cause__ or error
    return getattr(cause, "strerror", None) or str(cause) or type(cause).__name__


def _sidecars(path: Path) -> list[Path]:
    names = [_beside(path, suffix) for suffix in SIDECARS]
    return [name for name in names if os.path.lexists(name)]


def _beside(path: Path, suffix: str) -> Path:
    return path.with_name(path.name + suffix)


def _flush(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
