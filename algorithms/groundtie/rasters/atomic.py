"""Atomic outputs: written beside their final name, and renamed when complete."""

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

# Suffixes of the files that GDAL and SQLite put beside a file, appended to its whole name.
SIDECARS = (".aux.xml", ".ovr", ".msk", "-wal", "-shm", "-journal")

_ROLE = re.compile(r"-new(\.[^.]*)?$")

# Limit of Linux and Windows, in bytes or characters.
LONGEST_NAME = 255

# The other parts of a hidden name take up to 40.
_LONGEST_IN_HIDDEN = LONGEST_NAME - 40

_FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))


class Outputs:
    """The output files of one job, which appear together when all of them are complete.

    Inside the `with` block they are written under hidden names in the folders of their final names.
    Leaving the block renames them, in the order in which they were staged; leaving it by an
    exception removes them. Sidecar files (`.aux.xml`) are renamed just before their files. Those of
    a replaced file (`.msk`, `-wal`, RPCs, world files, …) are removed, as are leftovers of dead
    runs in these folders.
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
        """Return the temporary name under which to write the output `path`, with the same suffix.

        Raises
        ------
        OutputError
            `path` is a folder, its folder does not exist or cannot be written to, its name is too
            long, or it was staged already.
        """
        final = Path(os.path.abspath(path))
        if final in self._staged:
            raise OutputError(f"output is named twice: {path}")
        with writing(final):  # looking up a name that is too long fails
            is_folder = final.is_dir()
        if is_folder:
            raise OutputError(f"output is a folder, not a file: {path}")
        if not final.parent.is_dir():
            raise OutputError(f"the folder of the output does not exist: {final.parent}")
        staged = self._hidden(final, "new")
        self._staged[final] = staged
        return staged

    def staged(self, path: str | os.PathLike[str]) -> Path:
        """Return the temporary path of a staged output.

        The final renaming changes neither size nor time.
        """
        return self._staged[Path(os.path.abspath(path))]

    def withdraw(self, path: str | os.PathLike[str]) -> None:
        """Remove a staged output and its file; the other outputs remain."""
        staged = self._staged.pop(Path(os.path.abspath(path)))
        for present in (*_sidecars(staged), staged):
            remove(present)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self._commit()
        finally:
            # After a commit, only the second names of replaced files are left.
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
        # The end of a long stem is kept, as `.cog` decides the kind of file.
        stem = final.stem if fits else f"output-{next(self._names)}{final.stem[-len('.cog') :]}"
        return folder / hidden_name(self._token, role, stem, final.suffix)

    def _commit(self) -> None:
        """Move all files to their places, one by one; if one fails, undo all.

        A file is replaced in one step, so that an existing final name is never missing. All files
        must therefore be on the disk before the first one is moved.
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
                # Before the file is replaced: statistics or a mask of the old file would be wrong.
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
            # Not all systems can open folders, and not all disks need this.
            with contextlib.suppress(OSError):
                _flush(folder)

    def _keep(self, *files: Path) -> None:
        """Give files a second name, from which they can be restored."""
        for old in files:
            aside = self._hidden(old, "old")
            # Some disks lack hard links: replaced files cannot be restored there.
            with contextlib.suppress(OSError):
                os.link(old, aside)
                self._aside[old] = aside

    def _stale(self, final: Path) -> list[Path]:
        """Return the files beside a file that would be wrong for its replacement."""
        # GDAL takes RPCs and world files beside a raster for the raster's own.
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
    """Turn errors while `path` is written into `OutputError`, with the name and reason.

    Parameters
    ----------
    path
        The output; for a staged output, the message gives its final name.
    needed
        Size of the output in bytes, if known.
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
    """Write values, and the id of the call that produces them (see `runs`), as strict JSON.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    text = json.dumps({**values, **run_tags()}, indent=indent, allow_nan=False, ensure_ascii=False)
    with writing(path):
        path.write_text(text, encoding="utf-8")


def append_json(path: Path, values: Mapping[str, Any]) -> None:
    """Append values as a line of strict JSON, at once: a run that is killed later has kept it.

    A line that was cut off before costs itself alone.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    line = json.dumps(values, allow_nan=False) + "\n"
    with writing(path), path.open("ab+") as file:
        if file.seek(0, os.SEEK_END) > 0:
            file.seek(-1, os.SEEK_END)
            line = line if file.read() == b"\n" else "\n" + line
        file.write(line.encode())


def make_folder(folder: Path) -> None:
    """Make a folder and its parents if they do not exist; errors as `writing`.

    If it is still empty when the call of the tool ends, it is removed (see `runs`).
    """
    will_make(folder)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)


def write_csv(path: Path, columns: Iterable[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write rows, given by column name, as a CSV table.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    with writing(path), path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(columns), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def write_figure(path: Path, figure: Any, dpi: int) -> None:
    """Write a figure of matplotlib as a PNG, without the name of what wrote it.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    with writing(path):
        figure.savefig(path, format="png", dpi=dpi, metadata={"Software": None})


@contextlib.contextmanager
def scratch_file(path: Path) -> Iterator[Path]:
    """Yield the name of a temporary file beside a staged output, and remove the file afterwards."""
    # The same token as the output, so that the file of a killed job is a leftover, too.
    scratch = path.with_name(_ROLE.sub(r"-tmp\1", path.name))
    if scratch == path:
        scratch = path.with_name(hidden_name(new_token(), "tmp", path.stem, path.suffix))
    try:
        yield scratch
    finally:
        remove(scratch)


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make a private folder among the system's temporary ones, and remove it afterwards.

    Raises
    ------
    OutputError
        The folder cannot be made.
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


def no_space(path: str | os.PathLike[str], needed: float | None) -> OutputError:
    """Return the error that a disk is full.

    Parameters
    ----------
    path
        The file being written, complete or not.
    needed
        Its complete size in bytes, if known.
    """
    final = Path(final_name(path))
    free = free_bytes(path)
    sizes = f"{_size(free)} free"
    if needed is not None:
        sizes = f"{_size(needed)} needed, {sizes}"
    return OutputError(f"no space left on {final.parent}: {sizes} (writing {final.name})")


def free_bytes(path: str | os.PathLike[str]) -> int:
    """Return the largest possible size of a file, which may already exist in part."""
    path = Path(path)
    taken = path.stat().st_size if path.exists() else 0
    usage = shutil.disk_usage(path.parent)
    # Some network disks do not report their size.
    return usage.free + taken if usage.total else sys.maxsize


def _size(count: float) -> str:
    unit, in_units = next(
        (found for found in (("kB", count / 1e3), ("MB", count / 1e6)) if found[1] < 999.5),
        ("GB", count / 1e9),
    )
    return f"{in_units:.3g} {unit}" if in_units < 999.5 else f"{in_units:.0f} {unit}"


def _reason(error: Exception) -> str:
    # rasterio chains its exception to the one with the actual reason.
    cause = error.__cause__ or error
    return getattr(cause, "strerror", None) or str(cause) or type(cause).__name__


def _sidecars(path: Path) -> list[Path]:
    names = [_beside(path, suffix) for suffix in SIDECARS]
    return [name for name in names if os.path.lexists(name)]


def _beside(path: Path, suffix: str) -> Path:
    return path.with_name(path.name + suffix)


def _flush(path: Path) -> None:
    """Wait until a file, or the entries of a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
