"""The import contracts let data flow one way only, and know every module of the package."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("importlinter", reason="import-linter is not packaged by Debian")

ROOT = Path(__file__).resolve().parents[2]
LINT = "from importlinter.cli import lint_imports_command; lint_imports_command()"
PACKAGES = (
    *("tools", "simulation", "series", "registration", "report", "assessment", "studies"),
    *("sensor", "features", "matching"),
    *("similarity", "masks", "geometry", "rasters", "speckle"),
)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return a package with this project's layers and nothing in them."""
    package = tmp_path / "groundtie"
    for name in PACKAGES:
        (package / name).mkdir(parents=True)
        (package / name / "__init__.py").touch()
    for name in ("register", "coregister", "coregister_series", "match_sar_sar", "match_optical"):
        (package / "tools" / f"{name}.py").touch()
    for name in ("extract_gcps", "refine_rpc"):
        (package / "tools" / f"{name}.py").touch()
    for name in ("__init__", "cli", "steps", "errors", "progress", "version"):
        (package / f"{name}.py").touch()
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return package


def lint(package: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", LINT, "--no-cache"],
        cwd=package.parent,
        env={**os.environ, "PYTHONPATH": str(package.parent)},
        capture_output=True,
        text=True,
        check=False,
    )


def write(package: Path, name: str, *lines: str) -> None:
    (package / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_what_the_design_allows_passes(package: Path) -> None:
    write(package, "cli.py", "from .tools import run")
    write(
        package,
        "tools/run.py",
        "from .. import simulation, registration, matching, rasters, errors",
    )
    write(
        package, "registration/verdict.py", "from ..matching import x", "from ..similarity import y"
    )
    write(package, "similarity/surface.py", "from ..masks import x", "from ..geometry import y")
    write(package, "simulation/pair.py", "from ..geometry import x", "from ..rasters import y")
    write(package, "rasters/warp.py", "from ..geometry import x", "from ..progress import y")
    write(package, "progress.py", "from .errors import CancelledError")
    hint = (
        "from typing import TYPE_CHECKING",
        "if TYPE_CHECKING:",
        "    from .registration import x",
    )
    write(package, "errors.py", *hint)
    done = lint(package)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lower", "higher"),
    [
        ("rasters", "similarity"),
        ("geometry", "tools"),
        ("similarity", "matching"),
        ("registration", "tools"),
        ("tools", "cli"),
        ("registration", "simulation"),
        ("geometry", "simulation"),
        ("simulation", "similarity"),
        ("simulation", "registration"),
    ],
)
def test_what_it_does_not_allow_is_found(package: Path, lower: str, higher: str) -> None:
    write(package, f"{lower}/wrong.py", f"from .. import {higher}")
    done = lint(package)
    assert done.returncode == 1
    assert f"groundtie.{lower}.wrong -> groundtie.{higher}" in done.stdout


def test_errors_import_nothing(package: Path) -> None:
    write(package, "errors.py", "from . import progress")
    assert "groundtie.errors -> groundtie.progress" in lint(package).stdout


@pytest.mark.parametrize("module", ["qgis.core", "processing", "PyQt5.QtCore"])
@pytest.mark.slow
def test_qgis_is_kept_out(package: Path, module: str) -> None:
    write(package, "tools/wrong.py", f"def run():\n    import {module}")
    done = lint(package)
    assert done.returncode == 1
    assert f"groundtie is not allowed to import {module.partition('.')[0]}" in done.stdout


def test_a_module_without_a_layer_is_found(package: Path) -> None:
    write(package, "helpers.py", "")
    done = lint(package)
    assert done.returncode == 1
    assert "helpers" in done.stdout
