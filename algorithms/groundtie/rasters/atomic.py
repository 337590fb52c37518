"""Outputs that are whole or not there: written beside their final name, renamed when complete."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType

from ..errors import GroundTieError, OutputError, raised_by

# What GDAL and SQLite put beside a file, appended to its whole name.
SIDECARS = (".aux.xml", ".ovr", ".msk", "-wal", "-shm", "-journal")

_HIDDEN = re.compile(r"\.([^/\\]*)\.groundtie-[0-9a-f]{8}-new(\.[^/\\]*)?$")


class Outputs:
    """The output files of one job, which appear together when all of them are complete.

    Inside the `with` block they are written under hidden names in the folders of their final
    names. Leaving the block renames them; leaving it by an exception removes them. Sidecar files
    (`.aux.xml`, `-wal`, …) go along, and those of a file that is replaced disappear with it.
    """

    def __init__(self) -> None:
        self._token = secrets.token_hex(4)
        self._staged: dict[Path, Path] = {}

    def __enter__(self) -> Outputs:
        return self

    def stage(self, path: str | os.PathLike[str]) -> Path:
        """Return the name under which to write the output `path` for now; its suffix is kept.

        Raises
        ------
        OutputError
            `path` is a folder, lies in none, or was staged already.
        """
        final = Path(os.path.abspath(path))
        if final in self._staged:
            raise OutputError(f"output is named twice: {path}")
        if final.is_dir():
            raise OutputError(f"output is a folder, not a file: {path}")
        if not final.parent.is_dir():
            raise OutputError(f"the folder of the output does not exist: {final.parent}")
        self._staged[final] = final.with_name(self._hidden(final, "new"))
        return self._staged[final]

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self._commit()
        finally:
            # After a commit nothing carries the temporary names any more.
            _remove(self._staged.values())

    def _hidden(self, final: Path, role: str) -> str:
        # `_HIDDEN` finds the final name in this one.
        return f".{final.stem}.groundtie-{self._token}-{role}{final.suffix}"

    def _commit(self) -> None:
        """Move old files aside and new ones in their place; if one cannot be moved, undo all."""
        missing = [final for final, staged in self._staged.items() if not staged.exists()]
        if missing:
            raise OutputError(f"output was not written: {missing[0]}")
        aside = {final: final.with_name(self._hidden(final, "old")) for final in self._staged}
        moved: list[tuple[Path, Path]] = []
        final = Path()
        try:
            for final, staged in self._staged.items():
                for source, target in ((final, aside[final]), (staged, final)):
                    for present in _with_sidecars(source):
                        destination = target.with_name(
                            target.name + present.name[len(source.name) :]
                        )
                        os.replace(present, destination)
                        moved.append((present, destination))
        except OSError as error:
            for present, destination in reversed(moved):
                os.replace(destination, present)
            raise OutputError(f"cannot write {final}: {_reason(error)}") from error
        _remove(aside.values())


@contextlib.contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what goes wrong while `path` is written into `OutputError`, with the name and reason.

    Parameters
    ----------
    path
        The output; for one that is staged the message gives its final name.
    """
    try:
        yield
    except GroundTieError:
        raise
    except Exception as error:
        if not (isinstance(error, OSError) or raised_by(error, "rasterio")):
            raise
        raise OutputError(f"cannot write {_final_name(path)}: {_reason(error)}") from error


def _final_name(path: str | os.PathLike[str]) -> str:
    return _HIDDEN.sub(r"\1\2", os.fspath(path))


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:
        return "the disk is full"
    # rasterio points to the exception before: that one states what happened.
    cause = error.__cause__ or error
    return getattr(cause, "strerror", None) or str(cause) or type(cause).__name__


def _with_sidecars(path: Path) -> list[Path]:
    names = [path, *(path.with_name(path.name + suffix) for suffix in SIDECARS)]
    return [name for name in names if os.path.lexists(name)]


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        for present in _with_sidecars(path):
            # A file that is still open elsewhere must not hide why the job failed.
            with contextlib.suppress(OSError):
                present.unlink()
