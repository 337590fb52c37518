"""Hidden files of runs, and the removal of those that dead runs left behind.

A run holds a lock (`flock`) on one hidden file of each folder in which it writes. The names of its
other hidden files carry the same token. The kernel releases a lock when its process ends, for any
reason. Unlike a process number, a lock is never reused. It works between containers that share a
disk, and between computers if the network disk passes locks on, as NFS does. On a disk without
locks, dead and living runs cannot be distinguished, and nothing is removed.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import sys
from pathlib import Path
from typing import IO

if sys.platform != "win32":
    import fcntl

_HIDDEN = re.compile(r"\.([^/\\]*)\.groundtie-[0-9a-f]{16}-[a-z]+(\.[^/\\]*)?$")
_LOCK = re.compile(r"\.groundtie-([0-9a-f]{16})\.lock")


def new_token() -> str:
    """Return a token that is common to the names of a run's hidden files, and unique to the run."""
    return secrets.token_hex(8)


def hidden_name(token: str, role: str, stem: str, suffix: str = "") -> str:
    """Return the name of a run's hidden file, given stem and suffix of the final name."""
    return f".{stem}.groundtie-{token}-{role}{suffix}"


def final_name(path: str | os.PathLike[str]) -> str:
    """Return the final name of a file that may be staged."""
    return _HIDDEN.sub(r"\1\2", os.fspath(path))


class Claim:
    """A lock that keeps other runs from removing this run's hidden files from a folder.

    Parameters
    ----------
    folder
        Folder of the files. Leftovers of dead runs are removed from it first.
    token
        Token in the names of the files.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """

    def __init__(self, folder: Path, token: str) -> None:
        remove_leftovers(folder)
        self._path = folder / f".groundtie-{token}.lock"
        self._file = _locked(self._path)

    def close(self) -> None:
        """Remove the lock, when there are no hidden files left."""
        if sys.platform == "win32":
            self._file.close()  # Windows cannot remove an open file
        with contextlib.suppress(OSError):
            self._path.unlink()
        self._file.close()


def remove_leftovers(folder: Path) -> None:
    """Remove hidden files and folders of dead runs, as far as possible."""
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            found = _LOCK.fullmatch(name)
            if found:
                _remove_if_dead(folder, name, found[1])


def remove(path: Path) -> None:
    """Remove a file, or a folder with its contents, if it exists and can be removed."""
    # A file still open elsewhere must not mask the error that a job failed with.
    with contextlib.suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


def _locked(path: Path) -> IO[bytes]:
    """Make a file and lock it."""
    while True:
        file = path.open("xb")
        if sys.platform == "win32":
            return file  # an open file cannot be removed
        with contextlib.suppress(OSError):  # a disk without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        if os.fstat(file.fileno()).st_nlink:
            return file
        file.close()  # before it was locked, another run removed it as a dead run's


def _remove_if_dead(folder: Path, lock: str, token: str) -> None:
    with contextlib.suppress(OSError):
        if sys.platform == "win32":
            (folder / lock).unlink()  # fails while the run has it open
            _remove_all(folder, token)
            return
        with _opened(folder / lock) as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # fails while the run is alive
            _remove_all(folder, token)
            # Last, so that the next run continues if this one dies before.
            (folder / lock).unlink()


def _opened(path: Path) -> IO[bytes]:
    """Open a lock of another run, for writing, as NFS requires for exclusive locks."""
    try:
        return path.open("r+b")
    except PermissionError:  # of another user; other disks can lock it open for reading
        return path.open("rb")


def _remove_all(folder: Path, token: str) -> None:
    for path in folder.glob(f".*.groundtie-{token}-*"):
        remove(path)
