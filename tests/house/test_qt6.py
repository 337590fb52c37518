"""The plugin's Qt is Qt 6's, too: scoped enumerations, no names that Qt 6 has no more.

QGIS 4 cannot be had here: its `qgis.PyQt` hands PyQt6's modules on. Their own stubs tell which
names there are, and the dock runs in them with stand-ins for QGIS's classes.
"""

from __future__ import annotations

import ast
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from noise_pairs import write_pair

import groundtie

PLUGIN = Path(__file__).resolve().parents[2] / "plugin" / "groundtie_qgis"
MODULES = sorted(PLUGIN.glob("*.py"))
# What `qgis.PyQt.QtWidgets` has under Qt 6 though PyQt6 has it in QtGui, as QGIS's own code states.
MOVED = {"QAction", "QActionGroup", "QShortcut"}


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def chains(tree: ast.Module) -> Iterator[tuple[str, ...]]:
    """Yield what is written with dots, whole: `Qt.ItemFlag.ItemIsEnabled` as three names.

    What is called is left out: a class within a class, or a number made an enumeration's member.
    """
    inner = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    inner |= {
        id(node.func)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and is_member(getattr(node.func, "attr", ""))
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and id(node) not in inner:
            names: list[str] = []
            part: ast.expr = node
            while isinstance(part, ast.Attribute):
                names.insert(0, part.attr)
                part = part.value
            yield (part.id if isinstance(part, ast.Name) else "", *names)


def imports(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield module and name of all that is imported by name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield from ((node.module or "", alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, alias.asname or alias.name) for alias in node.names)


def objections(tree: ast.Module) -> list[str]:
    """Return what Qt 6 would not take."""
    found = [module for module, _ in imports(tree) if module.startswith(("PyQt", "sip"))]
    imported = {name: module for module, name in imports(tree)}
    for chain in chains(tree):
        first, *rest = chain
        from_qt = imported.get(first, "").startswith(("qgis.PyQt", "qgis.core", "qgis.gui"))
        # Enumerations begin large, as their members do: what stands alone is one without the other.
        # Those of QGIS are named in compat, wherever the version at hand has them.
        of_a_class = from_qt and len(rest) == 1 and is_member(rest[0])
        of_a_value = first not in imported and is_member(rest[-1]) and not is_member(chain[-2])
        if of_a_class or of_a_value or "exec_" in chain:
            found.append(".".join(chain))
    return found


def is_member(name: str) -> bool:
    """Return whether a name is written as those of enumerations and of their members are."""
    return name[:1].isupper() and not name.isupper()


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_what_qt_6_would_not_take_is_not_there(path: Path) -> None:
    assert objections(tree_of(path)) == []


@pytest.mark.parametrize(
    "line",
    [
        "from PyQt5.QtCore import Qt",
        "dialog.exec_()",
        "from qgis.PyQt.QtCore import Qt\nQt.Horizontal",
        "from qgis.PyQt.QtWidgets import QMessageBox\nQMessageBox.Yes",
        "self.view.SelectRows",
        "painter.Antialiasing",
        "from qgis.core import QgsWkbTypes\nQgsWkbTypes.LineGeometry",
    ],
)
def test_what_qt_6_would_not_take_is_found(line: str) -> None:
    assert len(objections(ast.parse(line))) == 1


@cache
def stub(module: str) -> dict[str, ast.ClassDef]:
    """Return the classes of a module of PyQt6, by its stub: the libraries need not load."""
    spec = importlib.util.find_spec("PyQt6")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("PyQt6 is not installed")
    path = Path(spec.submodule_search_locations[0]) / f"{module}.pyi"
    return {node.name: node for node in tree_of(path).body if isinstance(node, ast.ClassDef)}


def members(node: ast.ClassDef) -> dict[str, ast.stmt]:
    """Return what a class of a stub has, by name."""
    found: dict[str, ast.stmt] = {}
    for part in node.body:
        if isinstance(part, (ast.ClassDef, ast.FunctionDef)):
            found[part.name] = part
        elif isinstance(part, (ast.Assign, ast.AnnAssign)):
            targets = part.targets if isinstance(part, ast.Assign) else [part.target]
            found |= {target.id: part for target in targets if isinstance(target, ast.Name)}
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
@pytest.mark.slow
def test_pyqt6_has_every_name(path: Path) -> None:
    """Each class that is imported, and each enumeration and member that is named."""
    tree = tree_of(path)
    classes: dict[str, ast.ClassDef] = {}
    for module, name in imports(tree):
        if not module.startswith("qgis.PyQt.Qt") or name == "pyqtSignal":
            continue
        found = stub("QtGui" if name in MOVED else module.removeprefix("qgis.PyQt."))
        assert name in found, f"{module}.{name}"
        classes[name] = found[name]
    for first, *rest in chains(tree):
        if first not in classes or not rest[0][0].isupper():
            continue
        enumeration, member = rest[:2]
        scope = members(classes[first]).get(enumeration)
        assert isinstance(scope, ast.ClassDef), f"{first}.{enumeration}"
        assert member in members(scope), f"{first}.{enumeration}.{member}"


@pytest.mark.slow
def test_the_dock_runs_in_qt_6(tmp_path: Path) -> None:
    """Pages, table and points that are drawn, points switched off, the dialog that installs."""
    pytest.importorskip("PyQt6.QtWidgets", reason="PyQt6 or its libraries are missing")
    write_pair(tmp_path, 0)
    images, points = [str(tmp_path / f"{name}.tif") for name in ("reference", "input")], "tp.gpkg"
    groundtie.coregister(
        *images, tmp_path / "o.tif", search_radius=12.0, tie_points=tmp_path / points
    )
    program = Path(__file__).resolve().parents[1] / "qt6_desktop.py"
    pictures = Path(os.environ.get("GROUNDTIE_PICTURES") or tmp_path)
    called = subprocess.run(
        [sys.executable, str(program), *images, str(tmp_path / points), str(pictures)],
        env={
            **os.environ,
            "QT_QPA_PLATFORM": "offscreen",
            "PYTHONPATH": os.pathsep.join([str(PLUGIN.parent), *sys.path]),
        },
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert (called.returncode, called.stdout) == (0, "done\n"), called.stderr
    assert (pictures / "qt6_repair.png").is_file()
