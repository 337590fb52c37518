"""*Install what is missing*: what pip is asked for, and that QGIS's own packages stay first."""

from __future__ import annotations

import importlib.util
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest


@pytest.fixture
def folder(plugin: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path / "packages"
    for name in ("groundtie_test_package",):
        sys.modules.pop(name, None)


def test_the_folder_is_of_this_python_alone(plugin: Any) -> None:
    from groundtie_qgis.installing import packages_folder

    major, minor = sys.version_info[:2]
    assert packages_folder(Path("/s")) == Path(f"/s/groundtie/python{major}.{minor}")


def test_packages_are_found_after_those_of_qgis(folder: Path) -> None:
    from groundtie_qgis.installing import use_packages

    use_packages(folder)
    assert str(folder) not in sys.path
    for name in ("numpy", "groundtie_test_package"):
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text("")
    for _ in range(2):
        use_packages(folder)
    assert sys.path.count(str(folder)) == 1
    assert sys.path[-1] == str(folder)
    found = {name: importlib.util.find_spec(name) for name in ("numpy", "groundtie_test_package")}
    places = {name: spec is not None and str(spec.origin) for name, spec in found.items()}
    assert not str(places["numpy"]).startswith(str(folder))
    assert str(places["groundtie_test_package"]).startswith(str(folder))


def test_pip_is_asked_for_what_is_missing_with_the_numpy_of_qgis(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from groundtie_qgis.installing import missing_requirements, pip_command

    assert missing_requirements() == []
    monkeypatch.setitem(sys.modules, "rasterio", None)
    monkeypatch.setitem(sys.modules, "sklearn", None)
    wanted = missing_requirements()
    assert [line.partition(">")[0] for line in wanted] == ["rasterio", "scikit-learn"]
    command = pip_command(wanted, folder)
    assert command[1:4] == ["-m", "pip", "install"]
    assert command[command.index("--target") + 1] == str(folder)
    assert f"numpy=={np.__version__}" in command
    assert "--only-binary=:all:" in command
    assert set(wanted) < set(command)


def test_a_command_can_be_typed(plugin: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from groundtie_qgis.installing import as_typed

    command = ["/a b/python3", "pip", "numpy==1.26.4", "scipy>=1.10"]
    assert as_typed(command) == "'/a b/python3' pip numpy==1.26.4 'scipy>=1.10'"
    monkeypatch.setattr(sys, "platform", "win32")
    assert as_typed(command) == '"/a b/python3" pip "numpy==1.26.4" "scipy>=1.10"'


def fake_python(path: Path, text: str) -> Path:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def run_dialog(
    folder: Path, python: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[Any, list[str]]:
    """Click Install with a stand-in for QGIS's Python."""
    from groundtie_qgis import install_dialog, installing
    from qgis.PyQt.QtCore import QEventLoop, QTimer

    monkeypatch.setitem(sys.modules, "sklearn", None)
    monkeypatch.setattr(installing.packages, "interpreter", lambda: python)
    done: list[str] = []
    dialog = install_dialog.InstallDialog(folder, lambda: done.append("finished"))
    assert "scikit-learn" in dialog.text.text()
    assert f"--target {folder}" in dialog.log.toPlainText()
    loop = QEventLoop()
    dialog._process.finished.connect(lambda *_: loop.quit())
    dialog._process.errorOccurred.connect(lambda *_: loop.quit())
    QTimer.singleShot(20_000, loop.quit)
    QTimer.singleShot(0, dialog.install.click)
    loop.exec_()
    return dialog, done


def test_nothing_is_run_unasked_and_then_what_is_shown(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from groundtie_qgis import install_dialog

    python = fake_python(tmp_path / "python3", f'echo "$@" > {tmp_path}/called; mkdir -p {folder}')
    answers = iter([["scikit-learn>=1.2"]] * 4 + [[]] * 9)
    monkeypatch.setattr(install_dialog, "missing_requirements", lambda: next(answers))
    dialog, done = run_dialog(folder, python, monkeypatch)
    called = (tmp_path / "called").read_text()
    assert called.startswith("-m pip install --only-binary=:all: --upgrade --target")
    assert "scikit-learn>=1.2 numpy==" in called
    assert done == ["finished"]
    assert "All is installed" in dialog.text.text()
    dialog.close()


def test_a_pip_that_fails_is_told(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = fake_python(tmp_path / "python3", "echo no network >&2; exit 1")
    dialog, done = run_dialog(folder, python, monkeypatch)
    assert done == []
    assert "not installed" in dialog.text.text()
    assert "no network" in dialog.log.toPlainText()
    assert dialog.install.isEnabled()
    dialog.close()


def test_a_python_that_is_not_there_is_told(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dialog, done = run_dialog(folder, tmp_path / "nothing", monkeypatch)
    assert done == []
    assert "cannot be started" in dialog.text.text()
    dialog.close()


def test_the_menu_offers_it_and_goes_with_the_plugin(plugin: Any, tmp_path: Path) -> None:
    from unittest.mock import MagicMock

    from groundtie_qgis.plugin import GroundTiePlugin
    from qgis.PyQt.QtWidgets import QMainWindow

    iface = MagicMock()
    iface.mainWindow.return_value = window = QMainWindow()
    other = GroundTiePlugin(iface, tmp_path)
    other.initProcessing = lambda: None
    other.initGui()
    texts = [call.args[1].text() for call in iface.addPluginToRasterMenu.call_args_list]
    assert "Install what is missing…" in texts
    added = iface.addPluginToRasterMenu.call_count
    other.unload()
    assert iface.removePluginRasterMenu.call_count == added
    assert window is iface.mainWindow()
