"""In a German QGIS dialogs and dock are German; icons of tools are their own."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from groundtie.tools import NAMES


@pytest.fixture
def german(provider: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from groundtie_qgis import translation

    monkeypatch.setattr(translation, "language", lambda: "de")


def texts_of(widget: Any) -> set[str]:
    """Return what a widget and all in it show."""
    from qgis.PyQt.QtWidgets import QAbstractButton, QComboBox, QLabel, QTabWidget

    found = {
        part.text() for kind in (QLabel, QAbstractButton) for part in widget.findChildren(kind)
    }
    for box in widget.findChildren(QComboBox):
        found |= {box.itemText(index) for index in range(box.count())}
    for tabs in widget.findChildren(QTabWidget):
        found |= {tabs.tabText(index) for index in range(tabs.count())}
    return found


def left_in_english(texts: set[str]) -> set[str]:
    """Return those of some texts that have a translation, which they are not."""
    from groundtie_qgis.translation import FOLDER, read

    german = read(FOLDER / "groundtie_de.ts")
    return {t for t in texts if german.get(t, t) != t and t not in german.values()}


@pytest.mark.parametrize(
    ("tool", "title"),
    [("register", "Bilder registrieren"), ("orthorectify", "Orthorektifizieren")],
)
@pytest.mark.usefixtures("german")
def test_a_dialog_is_german(iface: Any, tmp_path: Path, tool: str, title: str) -> None:
    from processing.gui.AlgorithmDialog import AlgorithmDialog
    from qgis.core import QgsApplication

    algorithm = QgsApplication.processingRegistry().createAlgorithmById(f"groundtie:{tool}")
    dialog = AlgorithmDialog(algorithm, False, iface.mainWindow())
    shown = texts_of(dialog.mainWidget())
    assert any(text.startswith("Referenzbild") for text in shown)
    assert left_in_english({text.partition(" [")[0] for text in shown}) == set()
    # Newer ones put the group before it.
    assert dialog.windowTitle().rpartition(" - ")[2] == title
    assert "the " not in algorithm.shortHelpString()
    pictures = Path(os.environ.get("GROUNDTIE_PICTURES") or tmp_path)
    pictures.mkdir(parents=True, exist_ok=True)
    dialog.resize(1000, 700)
    dialog.show()
    assert dialog.grab().save(str(pictures / f"german_{tool}.png"))
    dialog.close()


@pytest.mark.usefixtures("german")
def test_the_dock_and_the_menu_are_german(iface: Any, tmp_path: Path) -> None:
    from groundtie_qgis.dock import GroundTieDock
    from groundtie_qgis.plugin import GroundTiePlugin

    dock = GroundTieDock(iface)
    shown = texts_of(dock)
    assert {"Registrieren", "Ansehen", "Nachbessern", "Punkte verschieben"} <= shown
    assert left_in_english(shown) == set()
    dock.take_away()
    plugin = GroundTiePlugin(iface, tmp_path)
    plugin.initProcessing = lambda: None
    plugin.initGui()
    assert [action.text() for action in plugin.actions][1:] == [
        "Beispiel laden",
        "Fehlendes installieren…",
        "Hilfe",
    ]
    plugin.unload()


@pytest.mark.usefixtures("german")
def test_choices_are_still_taken_as_words(provider: Any) -> None:
    algorithm = provider.algorithm("coregister").create()
    definition = algorithm.parameterDefinition("MODEL")
    assert "Polynom zweiten Grades" in definition.options()
    assert definition.word("polynomial2") == "polynomial2"
    assert definition.word("Polynom zweiten Grades") == "polynomial2"


def test_a_language_that_is_not_there_is_english(
    provider: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from groundtie_qgis import translation

    monkeypatch.setattr(translation, "language", lambda: "xx")
    assert provider.algorithm("register").displayName() == "Register images"


def test_every_tool_has_an_icon_of_its_own(provider: Any) -> None:
    icons = {name: Path(provider.algorithm(name).svgIconPath()) for name in NAMES}
    assert {path.stem for path in icons.values()} == set(NAMES)
    assert len({path.read_bytes() for path in icons.values()}) == len(NAMES)
