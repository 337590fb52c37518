"""`make check` leaves the slow tests out; what it runs still meets every module of the package."""

from __future__ import annotations

import ast
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
TOOLS = {name.rpartition(".")[2]: name for name in MODULES if name.startswith("groundtie.tools.")}


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imported(path: Path) -> set[str]:
    """Return the package's modules that a file imports, tools as `groundtie.TOOL` among them."""
    package = dotted(path).split(".") if path.is_relative_to(PACKAGE) else []
    if path.name != "__init__.py":
        package = package[:-1]
    names: set[str] = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            names |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            names.add(TOOLS.get(node.attr, "") if node.value.id == "groundtie" else "")
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

    return tests(parsed(path).body)


def test_every_module_is_met_by_a_quick_test() -> None:
    """A quick test's file imports it, or is at most two imports away from it."""
    tests = [path for path in (ROOT / "tests").rglob("test_*.py") if is_quick(path)]
    met = set().union(*map(imported, tests))
    for _ in range(2):
        met |= set().union(*(imported(MODULES[name]) for name in met))
    packages = {name for name, path in MODULES.items() if path.name == "__init__.py"}
    assert set(MODULES) - packages - met == WITHOUT_A_TEST
