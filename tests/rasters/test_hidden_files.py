"""What dead runs left is removed, and nothing else."""

from __future__ import annotations

import errno
import fcntl
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest

import groundtie
from groundtie.errors import OutputError
from groundtie.rasters import atomic, hidden_files
from groundtie.rasters.atomic import Outputs, scratch_folder

# Stages two files, tells so, and waits; the second argument is the folder.
RUN = """
import sys, time
from pathlib import Path
from groundtie.rasters.atomic import Outputs, scratch_file
with Outputs() as outputs:
    for name in ("image.tif", "points.csv"):
        outputs.stage(Path(sys.argv[1]) / name).write_text("half")
    staged = outputs.stage(Path(sys.argv[1]) / "folder.tif")
    kept = scratch_file(staged)
    folder = kept.__enter__()
    folder.mkdir()
    (folder / "inside").write_text("half")
    print("staged", flush=True)
    time.sleep(60)
"""


def start(folder: Path) -> subprocess.Popen[str]:
    """Start a run, and wait until it has staged its files."""
    command = [sys.executable, "-c", RUN, str(folder)]
    # Where the package is not installed, pytest alone has it on its path.
    environment = {**os.environ, "PYTHONPATH": str(Path(groundtie.__file__).parents[1])}
    run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert run.stdout is not None
    assert run.stdout.readline() == "staged\n"
    return run


def kill(run: subprocess.Popen[str]) -> None:
    run.send_signal(signal.SIGKILL)
    run.communicate()


def test_the_next_run_removes_what_a_dead_one_left(tmp_path: Path) -> None:
    kill(start(tmp_path))
    assert len(os.listdir(tmp_path)) == 4
    with Outputs() as outputs:
        outputs.stage(tmp_path / "other.csv").write_text("new")
    assert os.listdir(tmp_path) == ["other.csv"]


def test_a_run_that_fails_removes_it_too(tmp_path: Path) -> None:
    kill(start(tmp_path))

    def fail() -> None:
        with Outputs() as outputs:
            outputs.stage(tmp_path / "other.csv")
            raise OutputError("refused")

    with pytest.raises(OutputError):
        fail()
    assert os.listdir(tmp_path) == []


def test_a_live_run_keeps_its_files(tmp_path: Path) -> None:
    run = start(tmp_path)
    try:
        before = set(os.listdir(tmp_path))
        with Outputs() as outputs, Outputs() as others:
            outputs.stage(tmp_path / "a.csv").write_text("new")
            others.stage(tmp_path / "b.csv").write_text("new")
        assert set(os.listdir(tmp_path)) == before | {"a.csv", "b.csv"}
    finally:
        kill(run)


def test_users_files_with_alike_names_stay(tmp_path: Path) -> None:
    names = [".groundtie-notes.lock", ".a.groundtie-0123456789abcdef-new.tif", "groundtie-0.lock"]
    for name in names:
        (tmp_path / name).write_text("mine")
    with Outputs() as outputs:
        outputs.stage(tmp_path / "a.tif").write_text("new")
    assert sorted(os.listdir(tmp_path)) == sorted([*names, "a.tif"])


def test_a_lock_that_is_taken_for_a_dead_runs_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another run may find the file between its making and its locking."""
    fcntl = pytest.importorskip("fcntl")
    flock, stolen = fcntl.flock, []

    def steal(file: object, how: int) -> None:
        if not stolen:
            stolen.extend(tmp_path.glob(".groundtie-*.lock"))
            stolen[0].unlink()
        flock(file, how)

    monkeypatch.setattr(fcntl, "flock", steal)
    with Outputs() as outputs:
        outputs.stage(tmp_path / "a.tif").write_text("new")
        assert stolen[0].exists()
    assert os.listdir(tmp_path) == ["a.tif"]


def test_nothing_is_removed_from_a_disk_without_locks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fcntl = pytest.importorskip("fcntl")
    kill(start(tmp_path))
    left = set(os.listdir(tmp_path))

    def no_locks(file: object, how: int) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    with Outputs() as outputs:
        outputs.stage(tmp_path / "a.tif").write_text("new")
    assert set(os.listdir(tmp_path)) == left | {"a.tif"}


def test_scratch_folders_disappear(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(atomic.tempfile, "gettempdir", lambda: str(tmp_path))
    kill(start(tmp_path))
    with scratch_folder() as folder:
        (folder / "a.tif").write_text("needed")
        assert folder.parent == tmp_path
        assert all(name.startswith(".") for name in os.listdir(tmp_path))
        assert len(os.listdir(tmp_path)) == 2
    assert os.listdir(tmp_path) == []
    with pytest.raises(ZeroDivisionError), scratch_folder():
        _ = 1 / 0
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("mode", [0o644, 0o444])
def test_leftovers_are_removed_from_a_network_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    """NFS locks exclusively only what is open for writing."""
    kill(start(tmp_path))
    (lock,) = tmp_path.glob("*.lock")
    lock.chmod(mode)
    flock = fcntl.flock

    def nfs_flock(file: IO[bytes], operation: int) -> None:
        if fcntl.fcntl(file, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY and mode & 0o200:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        flock(file, operation)

    monkeypatch.setattr(hidden_files.fcntl, "flock", nfs_flock)
    hidden_files.remove_leftovers(tmp_path)
    assert os.listdir(tmp_path) == []
