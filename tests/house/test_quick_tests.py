"""`make check` leaves the slow tests out; what it runs still meets every module of the package."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "algorithms" / "groundtie"
# It only calls `cli.main`, which is tested.
WITHOUT_A_TEST = {"groundtie.__main__"}


def dotted(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


MODULES = {dotted(path): path for path in sorted(PACKAGE.rglob("*.py"))}
TOOLS = {
    name.rpartition(".")[2]: name
    for name in MODULES
    if name.rpartition(".")[0] == "groundtie.tools"
}


IMPORT = re.compile(r"^ *from (\.*)([\w.]*) import (\([^)]*\)|.*)|^ *import ([\w.]+)", re.MULTILINE)
CALLED = re.compile(r"\bgroundtie\.(\w+)\(")


@cache
def imported(path: Path) -> set[str]:
    """Return the package's modules that a file imports, tools as `groundtie.TOOL` among them."""
    package = dotted(path).split(".") if path.is_relative_to(PACKAGE) else []
    if path.name != "__init__.py":
        package = package[:-1]
    text = path.read_text(encoding="utf-8")
    names = {TOOLS.get(name, "") for name in CALLED.findall(text)}
    for dots, module, imports, whole in IMPORT.findall(text):
        above = package[: len(package) + 1 - len(dots)] if dots else []
        module = ".".join([*above, *([module] if module else [])])
        names |= {whole, module, *(f"{module}.{name}" for name in re.findall(r"\w+", imports))}
    names |= {TOOLS.get(name.removeprefix("groundtie."), "") for name in names}
    return names & MODULES.keys()


def is_quick(path: Path) -> bool:
    """Return whether a file has a test that is not marked slow."""

    def tests(body: list[ast.stmt]) -> bool:
        for node in body:
            if "slow" in " ".join(map(ast.unparse, getattr(node, "decorator_list", []))):
                continue
            if isinstance(node, ast.ClassDef) and tests(node.body):
                return True
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                return True
        return False

    return tests(ast.parse(path.read_text(encoding="utf-8")).body)


def test_every_module_is_met_by_a_quick_test() -> None:
    """A quick test's file imports it, or is at most two imports away from it."""
    tests = [path for path in (ROOT / "tests").rglob("test_*.py") if is_quick(path)]
    met = set().union(*map(imported, tests))
    for _ in range(2):
        met |= set().union(*(imported(MODULES[name]) for name in met))
    packages = {name for name, path in MODULES.items() if path.name == "__init__.py"}
    assert set(MODULES) - packages - met == WITHOUT_A_TEST
