"""A missing folder of real pairs or a missing QGIS is said aloud, and fails where it must."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TESTS = """
import pytest

def test_reads(real_data):
    assert (real_data / "cases.json").is_file()

@pytest.mark.real_data
def test_marked():
    pass

def test_free():
    pass
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Return a project with this project's conftest, three tests and one QGIS test."""
    root = tmp_path / "project"
    (root / "tests/qgis").mkdir(parents=True)
    shutil.copy(ROOT / "pyproject.toml", root)
    shutil.copy(ROOT / "tests/conftest.py", root / "tests")
    (root / "tests/test_some.py").write_text(TESTS, encoding="utf-8")
    qgis_test = "import qgis.core\n\ndef test_qgis():\n    pass\n"
    (root / "tests/qgis/test_qgis.py").write_text(qgis_test, encoding="utf-8")
    return root


def run(project: Path, *args: str, **variables: str) -> subprocess.CompletedProcess[str]:
    unset = ("CI", "GROUNDTIE_DATA", "GROUNDTIE_REQUIRE_QGIS", "PYTHONPATH")
    environment = {name: value for name, value in os.environ.items() if name not in unset}
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *args],
        cwd=project,
        env={**environment, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", **variables},
        capture_output=True,
        text=True,
        check=False,
    )


def hide_qgis(folder: Path) -> str:
    """Return a PYTHONPATH on which a package `qgis` without `qgis.core` goes first."""
    (folder / "hidden/qgis").mkdir(parents=True)
    (folder / "hidden/qgis/__init__.py").write_text("", encoding="utf-8")
    return str(folder / "hidden")


def fake_qgis(folder: Path) -> str:
    (folder / "fake/qgis").mkdir(parents=True)
    for name in ("__init__.py", "core.py"):
        (folder / "fake/qgis" / name).write_text("", encoding="utf-8")
    return str(folder / "fake")


@pytest.mark.slow
def test_missing_data_skips_and_says_so(project: Path) -> None:
    done = run(project, "tests/test_some.py")
    assert done.returncode == 0, done.stdout
    assert "1 passed, 2 skipped" in done.stdout
    assert "NOT TESTED: real image pairs" in done.stdout
    assert "2 tests skipped: no folder" in done.stdout


@pytest.mark.slow
def test_module_skipped_as_a_whole_is_another_matter(project: Path) -> None:
    module = 'import pytest\npytest.skip("no such package", allow_module_level=True)\n'
    (project / "tests/test_other.py").write_text(module, encoding="utf-8")
    done = run(project, "tests/test_some.py", "tests/test_other.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 tests skipped: no folder" in done.stdout


@pytest.mark.slow
def test_missing_data_fails_in_ci(project: Path) -> None:
    done = run(project, "tests/test_some.py", CI="true")
    assert done.returncode == 1
    assert "1 passed, 2 errors" in done.stdout
    assert "CI=true needs the real image pairs" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("named", [True, False])
def test_data_are_found(project: Path, named: bool) -> None:
    data = project / "data" if named else project.parent / "shared/data"
    data.mkdir(parents=True)
    (data / "cases.json").write_text("[]", encoding="utf-8")
    variables = {"GROUNDTIE_DATA": str(data)} if named else {}
    done = run(project, "tests/test_some.py", CI="true", **variables)
    assert "3 passed" in done.stdout
    assert "real image pairs" not in done.stdout


@pytest.mark.slow
def test_tests_with_real_data_can_be_left_out(project: Path) -> None:
    done = run(project, "-m", "not real_data", "tests/test_some.py", CI="true")
    assert "1 passed, 2 deselected" in done.stdout


@pytest.mark.slow
def test_missing_qgis_is_said(project: Path, tmp_path: Path) -> None:
    done = run(project, PYTHONPATH=hide_qgis(tmp_path))
    assert done.returncode == 0, done.stdout
    assert "NOT TESTED: QGIS" in done.stdout


@pytest.mark.slow
def test_the_folder_of_qgis_tests_does_not_pass_for_qgis(project: Path) -> None:
    """Here `qgis` is found only as tests/qgis, where this Python has no QGIS of its own."""
    code = "import importlib.util as u, sys; sys.exit(u.find_spec('qgis') is not None)"
    if subprocess.run([sys.executable, "-c", code], cwd=project, check=False).returncode:
        pytest.skip("this Python has QGIS")
    done = run(project)
    assert done.returncode == 0, done.stdout
    assert "NOT TESTED: QGIS" in done.stdout


@pytest.mark.slow
def test_required_qgis_is_an_error(project: Path, tmp_path: Path) -> None:
    done = run(project, PYTHONPATH=hide_qgis(tmp_path), GROUNDTIE_REQUIRE_QGIS="1")
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "GROUNDTIE_REQUIRE_QGIS=1" in done.stderr


@pytest.mark.slow
def test_qgis_tests_run_where_there_is_qgis(project: Path, tmp_path: Path) -> None:
    done = run(project, PYTHONPATH=fake_qgis(tmp_path), GROUNDTIE_REQUIRE_QGIS="1")
    assert done.returncode == 0, done.stdout
    assert "2 passed, 2 skipped" in done.stdout
    assert "NOT TESTED: QGIS" not in done.stdout
