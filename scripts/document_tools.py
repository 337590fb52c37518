"""Write the tables of tools' parameters and of the verdict's rules into docs/, from the code."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from groundtie.cli import spelled
from groundtie.declaration import Parameter, Tool
from groundtie.kinds import (
    Band,
    Choice,
    Crs,
    FileIn,
    Flag,
    FolderOut,
    Kind,
    MaskIn,
    Number,
    OutputKind,
    RasterIn,
    RastersIn,
    SurfaceIn,
    Text,
    VectorIn,
    Views,
)
from groundtie.registration.rules import RULES, Rule
from groundtie.tools import load_tools

DOCS = Path(__file__).resolve().parents[1] / "docs"
BEGIN = "<!-- parameters: begin, made by scripts/document_tools.py -->"
END = "<!-- parameters: end -->"

RULES_PAGE = "method-verdict.md"
RULES_BEGIN, RULES_END = "<!-- rules -->", "<!-- /rules -->"


def page_of(tool: Tool, folder: Path) -> Path:
    """Return the path of a tool's page."""
    return folder / f"{tool.name.replace('_', '-')}.md"


def document(tools: Sequence[Tool], folder: Path) -> list[Path]:
    """Update the tables on the pages of the given tools.

    Parameters
    ----------
    tools
        The tools; each has a page in the folder.
    folder
        Folder of the pages.

    Returns
    -------
    list of Path
        The pages that were changed.

    Raises
    ------
    FileNotFoundError
        A tool has no page.
    ValueError
        A page does not mark the place of the tables exactly once.
    """
    paths = {page_of(tool, folder): tables(tool) for tool in tools}
    return [path for path, text in paths.items() if _update(path, text)]


def document_rules(rules: Mapping[str, Sequence[Rule]], folder: Path) -> list[Path]:
    """Update the table of rules on the verdict's page; otherwise like `document`."""
    path = folder / RULES_PAGE
    return [path] if _update(path, rule_table(rules), RULES_BEGIN, RULES_END) else []


def _update(path: Path, text: str, begin: str = BEGIN, end: str = END) -> bool:
    """Put a text between the marks of a page, and return whether this changed the page."""
    page = path.read_text(encoding="utf-8")
    updated = with_tables(page, text, path.name, begin, end)
    if updated != page:
        path.write_text(updated, encoding="utf-8")
    return updated != page


def with_tables(page: str, text: str, name: str, begin: str = BEGIN, end: str = END) -> str:
    """Return a page with `text` between the marks; `name` is the page's name in errors."""
    before, found_begin, rest = page.partition(begin)
    _, found_end, after = rest.partition(end)
    if not found_begin or not found_end or begin in after or end in before + after:
        raise ValueError(f"{name} must hold once, and in this order: {begin} {end}")
    return f"{before}{begin}\n\n{text}\n\n{end}{after}"


def rule_table(rules: Mapping[str, Sequence[Rule]]) -> str:
    """Return the table of rules, in the order in which they are applied."""
    rows = [
        (r.name, stage, r.refuses, r.source, r.advice, "nothing" if r.is_final else "another way")
        for stage, of_stage in rules.items()
        for r in of_stage
    ]
    titles = ("rule", "stage", "refuses", "source of the limit", "what to try", "tried next")
    return _rows(titles, rows)


def tables(tool: Tool) -> str:
    """Return the tables of a tool's parameters and of its output values in QGIS."""
    plain = [p for p in tool.parameters if not p.kind.advanced]
    advanced = [p for p in tool.parameters if p.kind.advanced]
    parts = [
        _parameter_table("Parameters", plain),
        _parameter_table("Advanced parameters", advanced),
    ]
    if tool.outputs:
        rows = [(f"`{output.name}`", output.label, f"`{output.path}`") for output in tool.outputs]
        heading = "Numbers for QGIS models"
        parts.append(_table(heading, ("in QGIS", "meaning", "place in the JSON"), rows))
    return "\n\n".join(part for part in parts if part)


def _parameter_table(title: str, parameters: Iterable[Parameter]) -> str:
    rows = [
        (
            f"`{spelled(parameter)}`",
            parameter.kind.label,
            parameter.kind.help,
            values(parameter.kind),
            default(parameter),
        )
        for parameter in parameters
    ]
    return _table(title, ("command line", "in QGIS", "meaning", "values", "default"), rows)


def _table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return f"### {title}\n\n{_rows(header, rows)}" if rows else ""


def _rows(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    cells = [" | ".join(cell.replace("|", "\\|") for cell in line) for line in lines]
    return "\n".join(f"| {line} |" for line in cells)


def values(kind: Kind) -> str:
    """Return the values that a parameter of this kind accepts."""
    if isinstance(kind, Number):
        what = "whole number" if kind.integer else "number"
        bounds = f"{kind.range_text} {kind.unit}".strip()
        return f"{what}, {bounds}" if bounds else what
    if isinstance(kind, Choice):
        return ", ".join(f"`{choice}`" for choice in kind.choices)
    if isinstance(kind, (FileIn, OutputKind)):
        return "file: " + ", ".join(f"`{suffix}`" for suffix in kind.suffixes)
    words: dict[type[Kind], str] = {
        Band: "band number, from 1",
        Crs: "CRS, as `EPSG:32632` or WKT",
        Flag: "yes or no",
        FolderOut: "folder",
        MaskIn: "raster, vector layer or classifier",
        RasterIn: "raster",
        RastersIn: "rasters",
        SurfaceIn: "raster or vector layer",
        Text: "text",
        VectorIn: "vector layer",
        Views: "text",
    }
    return words[type(kind)]


def default(parameter: Parameter) -> str:
    """Return the value of a parameter if none is given."""
    if parameter.required:
        return "required"
    if isinstance(parameter.kind, Flag):
        return "yes" if parameter.default else "no"
    if parameter.default is None:
        return "–"
    plain = f"{parameter.default:g}" if isinstance(parameter.default, float) else parameter.default
    return f"`{plain}`"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docs", type=Path, default=DOCS, help="folder of the pages")
    folder = parser.parse_args().docs
    for path in [*document(load_tools(), folder), *document_rules(RULES, folder)]:
        print(path)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
