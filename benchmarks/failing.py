"""Jobs that write files, in child processes that are killed or meet a full disk."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import signal
import subprocess
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from groundtie.errors import OutputError
from groundtie.rasters import tiff_file

# No job takes more than seconds on an idle machine; a busy one may be twenty times slower.
_TIME_LIMIT_S = 300

# Exit codes of a child: everything written, refused with a message, or an exception (a bug).
_DONE, _TOLD, _BUG = 0, 2, 1

Work = Callable[[Path], None]


@dataclass(frozen=True)
class End:
    """How a child ended.

    Parameters
    ----------
    how
        "done", "told" (one line of message), "killed" (by the parent), "bug", "crash" or "hang".
    text
        Output of the child: the line, or a traceback, and whatever libraries wrote past Python.
    """

    how: str
    text: str


def in_child(work: Callable[[], None], kill_expected: bool = False) -> End:
    """Do work in a forked child, and return how it ended."""
    heard, said = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os._exit(_run(work, said))
        finally:
            os._exit(_BUG)
    os.close(said)
    os.set_blocking(heard, False)
    with open(heard, "rb", buffering=0) as stream:
        status, text = _wait(child, stream)
    if status is None:
        return End("hang", text)
    if os.WIFSIGNALED(status):
        killed = kill_expected and os.WTERMSIG(status) == signal.SIGKILL
        return End("killed" if killed else "crash", f"signal {os.WTERMSIG(status)}; {text}")
    how = {_DONE: "done", _TOLD: "told"}.get(os.WEXITSTATUS(status), "bug")
    return End("bug" if how == "told" and "\n" in text else how, text)


def _run(work: Callable[[], None], said: int) -> int:
    for descriptor in (1, 2):
        os.dup2(said, descriptor)
    faulthandler.enable()
    try:
        work()
    except OutputError as error:
        os.write(2, error.one_line().encode())
        return _TOLD
    except BaseException:
        os.write(2, traceback.format_exc().encode())
        return _BUG
    return _DONE


def _wait(child: int, stream: IO[bytes]) -> tuple[int | None, str]:
    """Return the status of a child (None if it took too long), and its output."""
    parts, found, status = [], 0, 0
    end = time.monotonic() + _TIME_LIMIT_S
    while not found:
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
        found, status = os.waitpid(child, os.WNOHANG)
        parts.append(stream.read(1 << 20) or b"")
        time.sleep(0.005)
    text = b"".join(parts).decode(errors="replace").strip()
    return None if time.monotonic() > end else status, text


class Steps:
    """Counts the steps of a job that change the disk, and kills the process at one of them.

    A step creates, writes, flushes, links, renames or removes a file. A killed write leaves half
    of its content.
    """

    def __init__(self, kill_at: int | None = None) -> None:
        self.count, self._kill_at, self._owner = 0, kill_at, os.getpid()

    @contextlib.contextmanager
    def watched(self) -> Iterator[Steps]:
        """Watch the steps of this process."""
        kept: list[tuple[Any, str, Any]] = []
        for owner, name in ((os, "replace"), (os, "link"), (os, "fsync"), (Path, "unlink")):
            kept.append((owner, name, getattr(owner, name)))
            setattr(owner, name, self._before(getattr(owner, name)))
        for owner, name in ((Path, "write_text"), (Path, "write_bytes"), (tiff_file, "_write")):
            kept.append((owner, name, getattr(owner, name)))
            setattr(owner, name, self._by_half(getattr(owner, name)))
        try:
            yield self
        finally:
            for owner, name, original in kept:
                setattr(owner, name, original)

    def _is_last(self) -> bool:
        self.count += 1
        return self._kill_at == self.count

    def _before(self, change: Callable[..., Any]) -> Callable[..., Any]:
        def changed(*args: Any, **more: Any) -> Any:
            if self._is_last():
                os.kill(os.getpid(), signal.SIGKILL)
            return change(*args, **more)

        return changed

    def _by_half(self, write: Callable[..., Any]) -> Callable[..., Any]:
        def written(file: Any, content: Any, *args: Any, **more: Any) -> Any:
            if self._is_last():
                write(file, content[: len(content) // 2], *args, **more)
                os.kill(os.getpid(), signal.SIGKILL)
            return write(file, content, *args, **more)

        return written


@contextlib.contextmanager
def disk(folder: Path, size: int) -> Iterator[Path]:
    """Mount a disk of a number of bytes.

    Raises
    ------
    PermissionError
        Mounting is not allowed here.
    """
    folder.mkdir(exist_ok=True)
    options = f"size={size}"
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise PermissionError(f"a disk cannot be mounted: {error}") from error
    if done.returncode:
        raise PermissionError(f"a disk cannot be mounted: {done.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def make_read_only(folder: Path) -> None:
    """Make a disk read-only for everybody."""
    subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)


def hidden(folder: Path) -> list[str]:
    """Return the names of hidden files."""
    return sorted(name for name in os.listdir(folder) if name.startswith(".") or "tmp" in name)
