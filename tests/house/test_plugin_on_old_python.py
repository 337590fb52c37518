"""What of the plugin an old Python reads is in that Python's syntax."""

from __future__ import annotations

import ast
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

PLUGIN = Path(__file__).resolve().parents[2] / "plugin" / "groundtie_qgis"


@pytest.mark.parametrize("name", ["__init__", "old_python"])
def test_the_entry_is_read_by_python_3_9(name: str) -> None:
    source = (PLUGIN / f"{name}.py").read_text(encoding="utf-8")
    ast.parse(source, feature_version=(3, 9))
    # What annotations say is not looked at: they are texts.
    assert "from __future__ import annotations" in source


def load_entry(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Import the entry beside a stand-in for QGIS."""
    core = ModuleType("qgis.core")
    core.Qgis = type("Qgis", (), {"QGIS_VERSION": "3.28.1-Firenze", "Warning": 1})  # type: ignore[attr-defined]
    core.QgsMessageLog = object  # type: ignore[attr-defined]
    for name, module in (("qgis", ModuleType("qgis")), ("qgis.core", core)):
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "entry.old_python", raising=False)
    spec = importlib.util.spec_from_file_location(
        "entry", PLUGIN / "__init__.py", submodule_search_locations=[str(PLUGIN)]
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "entry", module)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("platform", "take"),
    [
        ("win32", "install QGIS 3.34.10 or newer, best the current long-term release"),
        ("darwin", "install QGIS from conda-forge or MacPorts"),
        ("linux", "install a newer QGIS"),
    ],
)
def test_one_sentence_names_python_and_the_qgis_to_take(
    monkeypatch: pytest.MonkeyPatch, platform: str, take: str
) -> None:
    entry = load_entry(monkeypatch)
    with monkeypatch.context() as old:
        old.setattr(sys, "platform", platform)
        old.setattr(sys, "version_info", (3, 9, 5, "final", 0))
        sentence = entry.classFactory(None).complaint
    assert "Python 3.9.5" in sentence
    assert "QGIS (3.28.1-Firenze)" in sentence
    assert take in sentence
    assert "\n" not in sentence
