"""What users run can be read by the oldest Python that is supported, by that Python itself."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from groundtie.geometry import vector_layers

ROOT = Path(__file__).resolve().parents[2]
OLDEST = "3.10"

# Needs no package: what is imported of others is not looked at, nor what type checkers alone read.
READ = """
import ast, importlib, json, sys
from importlib.util import find_spec as _find

def find_spec(name):
    try:
        return _find(name)
    except ModuleNotFoundError:  # what should hold it is no package
        return None

faults = []
for path in json.load(sys.stdin):
    try:
        tree = compile(open(path, encoding="utf-8").read(), path, "exec", ast.PyCF_ONLY_AST)
        compile(tree, path, "exec")
    except SyntaxError as error:
        faults.append(f"{path}: {error}")
        continue
    apart = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
        for part in ast.walk(node)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.ImportFrom) or node.level or id(node) in apart:
            continue
        if node.module.partition(".")[0] in sys.stdlib_module_names - {"__future__"}:
            module = importlib.import_module(node.module)
            for name in [alias.name for alias in node.names]:
                if not hasattr(module, name) and not find_spec(f"{node.module}.{name}"):
                    faults.append(f"{path}: {node.module}.{name}")
json.dump(faults, sys.stdout)
"""


@pytest.fixture(scope="module")
def oldest() -> str:
    """Return a Python of the oldest version: one on PATH, or pyenv's."""
    found = shutil.which(f"python{OLDEST}")
    if found is not None:
        asked = [found, "-c", "import sys; print(sys.executable)"]
        env = {**os.environ, "PYENV_VERSION": OLDEST}
        called = subprocess.run(asked, env=env, capture_output=True, text=True, check=False)
        if called.returncode == 0:
            return called.stdout.strip()
    pytest.skip(f"there is no Python {OLDEST} here")


def faults(python: str, paths: list[Path]) -> list[str]:
    called = subprocess.run(
        [python, "-c", READ],
        input=json.dumps([str(path) for path in paths]),
        capture_output=True,
        text=True,
        check=True,
    )
    found: list[str] = json.loads(called.stdout)
    return found


def test_it_is_the_declared_one() -> None:
    declared = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert f'requires-python = ">={OLDEST}"' in declared


@pytest.mark.slow
def test_it_can_read_library_and_plugin(oldest: str) -> None:
    paths = [*(ROOT / "algorithms").rglob("*.py"), *(ROOT / "plugin").rglob("*.py")]
    assert len(paths) > 300
    assert faults(oldest, paths) == []


def test_vector_layers_are_read_by_it(
    oldest: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a process of its own, whose options it must know; fiona is a stand-in."""
    stand_in = "def open(path):\n    raise ValueError(f'asked for {path}')\n"
    (tmp_path / "fiona.py").write_text(stand_in, encoding="utf-8")
    monkeypatch.setattr(vector_layers, "interpreter", lambda: Path(oldest))
    monkeypatch.setattr("sys.path", [str(tmp_path)])
    assert vector_layers._read_apart("a.gpkg") == {"error": "asked for a.gpkg"}


@pytest.mark.parametrize(
    "source", ["from typing import Self\n", "from datetime import UTC\n", "type X = int\n"]
)
def test_what_it_cannot_read_is_found(oldest: str, tmp_path: Path, source: str) -> None:
    path = tmp_path / "newer.py"
    path.write_text(source, encoding="utf-8")
    assert len(faults(oldest, [path])) == 1
    path.write_text(f"if TYPE_CHECKING:\n    {source}", encoding="utf-8")
    assert len(faults(oldest, [path])) == int(source.startswith("type "))
