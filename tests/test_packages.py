"""The list of packages is that of pyproject.toml, and knows what each is needed for."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from own_processes import ENVIRONMENT

from groundtie.packages import PACKAGES, interpreter, needed_for, use_one_thread
from groundtie.tools import NAMES

PYPROJECT = Path(__file__).resolve().parents[1] / "pyproject.toml"


def test_it_is_what_pyproject_declares() -> None:
    tomllib = pytest.importorskip("tomllib", reason="reading pyproject.toml needs Python 3.11")
    project = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]
    declared = dict.fromkeys(project["dependencies"], "")
    for extra, requirements in project["optional-dependencies"].items():
        if extra != "dev":
            declared |= dict.fromkeys(requirements, extra)
    assert {package.requirement: package.extra for package in PACKAGES} == declared


def test_what_needs_a_package_exists() -> None:
    for package in PACKAGES:
        assert set(package.tools) <= set(NAMES)
        assert all(re.fullmatch(r"\.[a-z]+", ending) for ending in package.files)
        assert not package.extra or package.use


def test_calls_need_what_their_tool_and_their_files_need() -> None:
    def names(tool: str, *files: str) -> list[str]:
        return [package.name for package in needed_for(tool, map(Path, files))]

    assert names("coregister", "o.tif") == []
    assert names("coregister", "o.tif", "p.GPKG", "r.html") == ["fiona", "jinja2", "matplotlib"]
    assert names("train_feature_classifier") == ["scikit-learn"]
    by_all = {package.name for package in PACKAGES if package.needed_by_all}
    assert {"numpy", "rasterio"} <= by_all
    assert "click" not in by_all


def test_what_is_not_here_is_not_found(monkeypatch: pytest.MonkeyPatch) -> None:
    needed = [package for package in PACKAGES if package.needed_by_all]
    assert all(package.found() for package in needed)
    monkeypatch.setitem(sys.modules, "cv2", None)
    absent = [package.name for package in needed if not package.found()]
    assert absent == ["opencv-python-headless"]


def test_libraries_work_in_the_calling_thread_unless_stated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    use_one_thread()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
    assert os.environ["MKL_NUM_THREADS"] == "3"


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processors are allotted in Linux")
def test_no_more_threads_than_processors_that_are_allotted() -> None:
    """As by `taskset`, Slurm or a container: the machine may have more."""
    script = (
        "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
        "from groundtie.context import threads\n"
        "from groundtie.packages import processors\n"
        "with threads() as context: print(context.workers, processors())\n"
    )
    command = [sys.executable, "-c", script]
    run = subprocess.run(command, env=ENVIRONMENT, check=True, capture_output=True, text=True)
    assert run.stdout.split() == ["1", "1"]


@pytest.mark.parametrize("place", ["bin/python3", "python.exe"])
def test_within_qgis_the_interpreter_is_beside_it(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    running = interpreter()
    assert running is not None
    assert running.name.startswith("python")
    python = tmp_path / "apps" / "Python312" / place
    python.parent.mkdir(parents=True)
    python.touch()
    monkeypatch.setattr(sys, "executable", str(tmp_path / "bin" / "qgis-bin.exe"))
    monkeypatch.setattr(sys, "exec_prefix", str(tmp_path / "apps" / "Python312"))
    assert interpreter() == python
