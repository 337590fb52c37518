"""Hidden files of runs, and which of them a run left behind that is no longer alive.

A run holds a lock (`flock`) on one hidden file of each folder in which it writes; the names of its
other hidden files carry the same token. The kernel gives a lock up when its process ends, however
that ends: unlike a process's number it is never that of somebody else later, and it holds between
containers that share a disk, and between computers where the network's disk passes locks on, as NFS
does. Where a disk knows no locks the dead cannot be told from the living: nothing is removed there.
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
    """Return what the names of a run's hidden files have in common, and no other run's have."""
    return secrets.token_hex(8)


def hidden_name(token: str, role: str, stem: str, suffix: str = "") -> str:
    """Return the name of a run's hidden file; `stem` and `suffix` are the final name's."""
    return f".{stem}.groundtie-{token}-{role}{suffix}"


def final_name(path: str | os.PathLike[str]) -> str:
    """Return the final name of a file that may be staged."""
    return _HIDDEN.sub(r"\1\2", os.fspath(path))


class Claim:
    """Keeps other runs from removing the hidden files of this one from a folder.

    Parameters
    ----------
    folder
        Where the files are. Leftovers of dead runs are removed from it first.
    token
        What their names have in common.

    Raises
    ------
    OSError
        Nothing can be written to the folder.
    """

    def __init__(self, folder: Path, token: str) -> None:
        remove_leftovers(folder)
        self._path = folder / f".groundtie-{token}.lock"
        self._file = _locked(self._path)

    def close(self) -> None:
        """Remove the lock: there are no hidden files any more."""
        if sys.platform == "win32":
            self._file.close()  # Windows removes no file that is open
        with contextlib.suppress(OSError):
            self._path.unlink()
        self._file.close()


def remove_leftovers(folder: Path) -> None:
    """Remove hidden files and folders of runs that died; what cannot be removed stays."""
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            found = _LOCK.fullmatch(name)
            if found:
                _remove_if_dead(folder, name, found[1])


def remove(path: Path) -> None:
    """Remove a file, or a folder with all that it holds, if it is there and can be removed."""
    # A file that is still open elsewhere must not hide why a job failed.
    with contextlib.suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()


def _locked(path: Path) -> IO[bytes]:
    """Make a file, and lock it."""
    while True:
        file = path.open("xb")
        if sys.platform == "win32":
            return file  # nobody can remove it while it is open
        with contextlib.suppress(OSError):  # a disk without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        if os.fstat(file.fileno()).st_nlink:
            return file
        file.close()  # another run took it for a dead one's, before it was locked


def _remove_if_dead(folder: Path, lock: str, token: str) -> None:
    with contextlib.suppress(OSError):
        if sys.platform == "win32":
            (folder / lock).unlink()  # fails while its run has it open
            _remove_all(folder, token)
            return
        with _opened(folder / lock) as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # fails while its run lives
            _remove_all(folder, token)
            # Last: who dies before leaves it to the next one.
            (folder / lock).unlink()


def _opened(path: Path) -> IO[bytes]:
    """Open a lock of another run; NFS locks exclusively only what is open for writing."""
    try:
        return path.open("r+b")
    except PermissionError:  # of somebody else: other disks lock it, too
        return path.open("rb")


def _remove_all(folder: Path, token: str) -> None:
    for path in folder.glob(f".*.groundtie-{token}-*"):
        remove(path)
