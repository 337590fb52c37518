"""Every text of the plugin's dialogs and its dock is there in German."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from scripts import translations

GERMAN = translations.PLUGIN / "i18n" / "groundtie_de.ts"
READ = translations.plugin_module("translation").read
# What shows a text that it is called with.
SHOWING = {
    *("QLabel", "QPushButton", "QCheckBox", "QAction", "QGroupBox", "QDockWidget"),
    *("setText", "setToolTip", "setWindowTitle", "setSpecialValueText", "setStatusTip"),
    *("addRow", "addTab", "addItem", "addButton", "setPlaceholderText", "_add_action", "_state"),
}
# A name is the same in all languages.
NAMES = {"GroundTie"}


def test_every_text_has_its_translation_and_no_other_is_kept(tmp_path: Path) -> None:
    again = tmp_path / GERMAN.name
    unfinished = translations.write(again, READ(GERMAN), translations.texts())
    assert unfinished == 0, "run scripts/translations.py and translate what is unfinished"
    assert again.read_text() == GERMAN.read_text(), "run scripts/translations.py"


def test_new_texts_are_unfinished_and_old_ones_go(tmp_path: Path) -> None:
    path = tmp_path / "groundtie_de.ts"
    assert translations.write(path, {"a": "A", "gone": "Weg"}, ["a", "b & <c>"]) == 1
    assert READ(path) == {"a": "A"}
    assert "b &amp; &lt;c&gt;" in path.read_text()


@pytest.mark.parametrize(
    "pattern", [r"\{\w*\}", r"</?\w+>", r"\d{2,}", r"\.[a-z]{3,7}\b", r"_RPC|\b[a-z]+_[a-z_]+"]
)
def test_translations_keep_what_is_filled_in_and_what_is_typed(pattern: str) -> None:
    for text, german in READ(GERMAN).items():
        one, other = (sorted(set(re.findall(pattern, t))) for t in (text, german))
        assert one == other, (text, german)
        assert german.strip() == german != ""


def shown_literals(source: str) -> list[str]:
    """Return the texts that a module shows as they are, untranslated."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "id", "") or getattr(node.func, "attr", "")
        for value in node.args if name in SHOWING else ():
            parts = value.values if isinstance(value, ast.JoinedStr) else [value]
            words = [p.value for p in parts if isinstance(p, ast.Constant) and p.value not in NAMES]
            found += [w for w in words if isinstance(w, str) and re.search(r"[A-Za-z]{3}", w)]
    return found


def test_a_text_that_is_not_translated_is_found() -> None:
    assert shown_literals('box.setText("Two words")\nQLabel(f"{n} points")') == [
        "Two words",
        " points",
    ]
    assert shown_literals('box.setText(tr("Two words"))\nQLabel("")') == []


@pytest.mark.parametrize("path", sorted(translations.PLUGIN.glob("*.py")), ids=lambda p: p.stem)
def test_no_module_shows_a_text_untranslated(path: Path) -> None:
    literals = shown_literals(path.read_text(encoding="utf-8"))
    assert [text for text in literals if "<p" not in text] == []


def test_qt_reads_the_file(tmp_path: Path) -> None:
    lrelease = shutil.which("lrelease") or shutil.which("lrelease", path="/usr/lib/qt5/bin")
    if lrelease is None:
        pytest.skip("Qt's lrelease is not installed")
    command = [lrelease, str(GERMAN), "-qm", str(tmp_path / "de.qm")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    count = len(translations.texts())
    assert f"Generated {count} translation(s) ({count} finished and 0 unfinished)" in done.stdout
