"""Print lines of code by folder (without docstrings, comments and blank lines), and parameters."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections import Counter
from pathlib import Path

from groundtie.tools import load_tools

PACKAGE = Path(__file__).resolve().parents[1] / "algorithms" / "groundtie"

# Code that is separate from the product: simulators and studies, with their tools.
APART = ("simulation", "studies")
APART_TOOLS = ("simulate", "similarity_surface", "detector_repeatability")

_NO_CODE = (
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
)
_CONSTANT = re.compile(r"^_?[A-Z][A-Z0-9_]+(: [\w\[\]]+)? = -?[0-9.]", re.MULTILINE)


def code_lines(source: str) -> int:
    """Return the number of lines of code in a module."""
    documented: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                documented |= set(range(first.lineno, (first.end_lineno or 0) + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _NO_CODE:
            lines |= set(range(token.start[0], token.end[0] + 1))
    return len(lines - documented)


def is_apart(module: Path) -> bool:
    """Whether a module, relative to the package, belongs to simulators and studies."""
    if module.parts[0] == "tools":
        return module.stem.startswith(APART_TOOLS)
    return module.parts[0] in APART


def main() -> int:
    folders: Counter[str] = Counter()
    product = constants = 0
    for path in sorted(PACKAGE.rglob("*.py")):
        module, source = path.relative_to(PACKAGE), path.read_text(encoding="utf-8")
        lines = code_lines(source)
        folders[module.parts[0]] += lines
        product += 0 if is_apart(module) else lines
        constants += len(_CONSTANT.findall(source))
    for name, lines in folders.most_common():
        print(f"{lines:6d}  {name}")
    print(f"{sum(folders.values()):6d}  all; {product} without simulators and studies")
    print(f"{constants:6d}  numbers at the level of modules")
    for tool in load_tools():
        advanced = sum(parameter.kind.advanced for parameter in tool.parameters)
        print(f"{len(tool.parameters):6d}  parameters of {tool.name}, {advanced} advanced")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
