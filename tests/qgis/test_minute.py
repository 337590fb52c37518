"""README's minute in QGIS: the dialog as a person uses it, with its defaults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from noise_pairs import write_pair

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def desktop(iface: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the window of a desktop, with no results of other runs."""
    from processing.core.ProcessingResults import resultsList

    monkeypatch.setattr(resultsList, "results", [])
    return iface.mainWindow()


def load(folder: Path, names: list[str]) -> list[Any]:
    from qgis.core import QgsProject, QgsRasterLayer

    layers = [QgsRasterLayer(str(folder / f"{name}.tif"), name) for name in names]
    for layer in layers:
        QgsProject.instance().addMapLayer(layer)
    return layers


def click_run(window: Any, tool: str, **values: Any) -> tuple[bool, str]:
    """Run the dialog of a tool with values; return whether it succeeded, and the log."""
    from processing.gui.AlgorithmDialog import AlgorithmDialog
    from qgis.core import QgsApplication
    from qgis.PyQt.QtCore import QEventLoop, QTimer
    from qgis.PyQt.QtWidgets import QTextEdit

    algorithm = QgsApplication.processingRegistry().createAlgorithmById(f"groundtie:{tool}")
    dialog = AlgorithmDialog(algorithm, False, window)
    dialog.setParameters(values)
    loop, done = QEventLoop(), []
    dialog.algorithmFinished.connect(lambda ok, results: (done.append(ok), loop.quit()))
    QTimer.singleShot(60_000, loop.quit)
    QTimer.singleShot(0, dialog.runButton().click)
    loop.exec_()
    log = "".join(text.toPlainText() for text in dialog.findChildren(QTextEdit, "txtLog"))
    dialog.close()
    assert done, log
    return bool(done[0]), log


def test_the_minute_is_as_readme_has_it(desktop: Any, tmp_path: Path) -> None:
    from processing.core.ProcessingResults import resultsList
    from qgis.core import QgsProject

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    minute = text.partition("## One minute in QGIS")[2].partition("##")[0]
    assert "*GroundTie → Registration → Register images*" in minute
    write_pair(tmp_path, 0)
    reference, input = load(tmp_path, ["reference", "input"])
    succeeded, log = click_run(desktop, "register", REFERENCE=reference.id(), INPUT=input.id())
    assert succeeded, log
    drawn = [layer.name() for layer in QgsProject.instance().layerTreeRoot().layerOrder()]
    assert drawn == ["Tie points", "Registered image", "input", "reference"]
    group = QgsProject.instance().layerTreeRoot().children()[0]
    assert group.name() == "Register images: input"
    (report,) = resultsList.getResults()
    assert "accepted" in Path(report.filename).read_text(encoding="utf-8")
    assert report.filename in log


def test_a_refusal_shows_its_report(desktop: Any, tmp_path: Path) -> None:
    from processing.core.ProcessingResults import resultsList
    from qgis.core import QgsProject

    for seed, name in enumerate(("one", "other")):
        (tmp_path / name).mkdir()
        write_pair(tmp_path / name, seed)
    (reference,) = load(tmp_path / "one", ["reference"])
    (input,) = load(tmp_path / "other", ["input"])
    succeeded, log = click_run(
        desktop,
        "coregister",
        REFERENCE=reference.id(),
        INPUT=input.id(),
        MODEL="translation",
        SEARCH_RADIUS=12,
    )
    assert not succeeded
    assert "was not registered to" in log
    (report,) = resultsList.getResults()
    assert report.name == "Co-register images: refused"
    assert "refused" in Path(report.filename).read_text(encoding="utf-8")
    assert report.filename in log
    assert "not correctly generated" not in log
    assert len(QgsProject.instance().mapLayers()) == 2


def test_a_simulated_pair_is_loaded(desktop: Any, tmp_path: Path) -> None:
    from qgis.core import QgsProject

    values = {"FOLDER": str(tmp_path / "pair"), "SIZE": 100, "DENSITY": "rural"}
    succeeded, log = click_run(desktop, "simulate", **values)
    assert succeeded, log
    root = QgsProject.instance().layerTreeRoot()
    assert [layer.name() for layer in root.layerOrder()] == ["input", "reference"]
    assert [group.name() for group in root.children()] == ["Simulate a SAR–optical pair"]
    assert all(layer.isValid() for layer in root.layerOrder())
    assert Path(root.layerOrder()[0].source()).is_relative_to(tmp_path / "pair")
