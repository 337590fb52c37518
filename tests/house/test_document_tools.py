"""The pages agree with the declarations and the rules, and their links lead somewhere."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from toys import TOY

from groundtie import errors
from groundtie.cli import spelled
from groundtie.declaration import Parameter, Tool
from groundtie.kinds import (
    Band,
    Choice,
    Distance,
    FileIn,
    Flag,
    FolderOut,
    Kind,
    MaskIn,
    Number,
    RasterIn,
    RasterOut,
    SurfaceIn,
    Text,
    VectorIn,
    VectorOut,
)
from groundtie.registration.evidence import SEARCH
from groundtie.registration.rules import RULES
from groundtie.registration.verdict import NOT_JUDGED
from groundtie.tools import load_tools
from scripts import document_tools

TOOLS = load_tools()
ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
TEXTS = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.glob("*.md"))]
WORDS = {"label": "Label", "help": "Help."}


def empty_page(text: str = "") -> str:
    return f"# A tool\n\n{document_tools.BEGIN}\n{text}\n{document_tools.END}\n\nMore.\n"


def table_rows(text: str) -> list[list[str]]:
    """Return the cells of all rows below the headers of the tables in a text."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    rows = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        for line in lines
        if not line.startswith("| ---")
    ]
    return [row for row in rows if row[0] not in ("command line", "in QGIS")]


@pytest.mark.parametrize("tool", TOOLS, ids=lambda tool: tool.name)
def test_the_page_agrees_with_the_declaration(tool: Tool) -> None:
    path = document_tools.page_of(tool, DOCS)
    page = path.read_text(encoding="utf-8")
    updated = document_tools.with_tables(page, document_tools.tables(tool), path.name)
    assert page == updated, "run scripts/document_tools.py"


@pytest.mark.parametrize("tool", [*TOOLS, TOY], ids=lambda tool: tool.name)
def test_every_parameter_stands_in_one_row(tool: Tool) -> None:
    first_cells = [row[0] for row in table_rows(document_tools.tables(tool))]
    expected = [f"`{spelled(parameter)}`" for parameter in tool.parameters]
    expected += [f"`{output.name}`" for output in tool.outputs]
    assert sorted(first_cells) == sorted(expected)


@pytest.mark.parametrize("tool", [*TOOLS, TOY], ids=lambda tool: tool.name)
def test_rows_carry_label_and_help_of_the_declaration(tool: Tool) -> None:
    rows = {row[0]: row for row in table_rows(document_tools.tables(tool))}
    for parameter in tool.parameters:
        row = [cell.replace("\\|", "|") for cell in rows[f"`{spelled(parameter)}`"]]
        assert len(row) == 5
        assert row[1:3] == [parameter.kind.label, parameter.kind.help]


def test_advanced_parameters_stand_in_a_table_of_their_own() -> None:
    coregister = next(tool for tool in TOOLS if tool.name == "coregister")
    plain, _, advanced = document_tools.tables(coregister).partition("### Advanced parameters")
    for parameter in coregister.parameters:
        part = advanced if parameter.kind.advanced else plain
        assert f"| `{spelled(parameter)}` |" in part


def test_advice_names_tools_that_can_follow_it() -> None:
    """A tool without these options, as register, gives it, too."""
    advice = next(rule.advice for rule in RULES[SEARCH] if rule.name == "nothing in common")
    named = [tool for tool in TOOLS if re.search(rf"\b{tool.name}\b", advice)]
    assert len(named) == 3
    for tool in named:
        names = {parameter.name for parameter in tool.parameters}
        assert {"search_radius", "search_rotation"} <= names


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (Number(**WORDS), "number"),
        (Number(**WORDS, integer=True, minimum=1), "whole number, at least 1"),
        (Number(**WORDS, unit="px", minimum=0.1, maximum=100), "number, 0.1 to 100 px"),
        (Distance(**WORDS), "number, at least 0 m"),
        (Choice(**WORDS, choices=("a", "b")), "`a`, `b`"),
        (FileIn(**WORDS, suffixes=(".json", ".csv")), "file: `.json`, `.csv`"),
        (RasterOut(**WORDS), "file: `.tif`, `.tiff`"),
        (VectorOut(**WORDS), "file: `.gpkg`, `.geojson`"),
        (FolderOut(**WORDS), "folder"),
        (MaskIn(**WORDS), "raster, vector layer or classifier"),
        (SurfaceIn(**WORDS), "raster or vector layer"),
        (RasterIn(**WORDS), "raster"),
        (VectorIn(**WORDS), "vector layer"),
        (Band(**WORDS, of="input"), "band number, from 1"),
        (Flag(**WORDS), "yes or no"),
        (Text(**WORDS), "text"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Kind) else value,
)
def test_values_in_words(kind: Kind, expected: str) -> None:
    assert document_tools.values(kind) == expected


@pytest.mark.parametrize(
    ("parameter", "expected"),
    [
        (Parameter("size", Number(**WORDS), required=True), "required"),
        (Parameter("size", Number(**WORDS), required=False), "–"),
        (Parameter("size", Number(**WORDS), required=False, default=8.0), "`8`"),
        (Parameter("size", Number(**WORDS), required=False, default=0), "`0`"),
        (Parameter("size", Number(**WORDS), required=False, default=1.02), "`1.02`"),
        (Parameter("how", Text(**WORDS), required=False, default="cubic"), "`cubic`"),
        (Parameter("fast", Flag(**WORDS), required=False, default=True), "yes"),
        (Parameter("fast", Flag(**WORDS), required=False, default=False), "no"),
    ],
)
def test_defaults_in_words(parameter: Parameter, expected: str) -> None:
    assert document_tools.default(parameter) == expected


def test_a_bar_in_a_text_does_not_end_its_cell() -> None:
    kind = Text(label="Either|or", help="This | that.")
    parameter = Parameter("word", kind, required=False)
    tool = Tool("bars", "Bars", "Test", "", "", (parameter,), (), lambda: None)
    (row,) = table_rows(document_tools.tables(tool))
    assert row == ["`--word`", r"Either\|or", r"This \| that.", "text", "–"]


def test_only_what_lies_between_the_marks_is_replaced() -> None:
    page = document_tools.with_tables(empty_page("old"), "new", "page.md")
    assert page == empty_page("\nnew\n")
    assert document_tools.with_tables(page, "new", "page.md") == page


@pytest.mark.parametrize(
    "page",
    [
        "no marks",
        f"{document_tools.BEGIN} without an end",
        f"{document_tools.END} first, then {document_tools.BEGIN}",
        empty_page() + empty_page(),
        empty_page() + document_tools.END,
    ],
    ids=["none", "no end", "wrong order", "twice", "two ends"],
)
def test_a_page_without_its_marks_is_refused(page: str) -> None:
    with pytest.raises(ValueError, match=r"page\.md must hold once"):
        document_tools.with_tables(page, "text", "page.md")


def test_changed_pages_are_written_and_named(tmp_path: Path) -> None:
    path = document_tools.page_of(TOY, tmp_path)
    path.write_text(empty_page("old"), encoding="utf-8")
    assert document_tools.document([TOY], tmp_path) == [path]
    assert document_tools.tables(TOY) in path.read_text(encoding="utf-8")
    assert document_tools.document([TOY], tmp_path) == []


def test_a_tool_without_a_page_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        document_tools.document([TOY], tmp_path)


@pytest.mark.slow
def test_the_script_repairs_a_page(tmp_path: Path) -> None:
    for tool in TOOLS:
        shutil.copy(document_tools.page_of(tool, DOCS), tmp_path)
    shutil.copy(DOCS / document_tools.RULES_PAGE, tmp_path)
    spoilt = document_tools.page_of(TOOLS[0], tmp_path)
    original = spoilt.read_text(encoding="utf-8")
    spoilt.write_text(original.replace("| required |", "| – |"), encoding="utf-8")
    path = [str(ROOT / "algorithms"), *filter(None, sys.path)]
    done = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "document_tools.py"), "--docs", str(tmp_path)],
        env={"PYTHONPATH": ":".join(path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [str(spoilt)]
    assert spoilt.read_text(encoding="utf-8") == original


def rules_section() -> str:
    page = (DOCS / document_tools.RULES_PAGE).read_text(encoding="utf-8")
    _, _, rest = page.partition(document_tools.RULES_BEGIN)
    return rest.partition(document_tools.RULES_END)[0]


def test_the_page_on_the_verdict_agrees_with_the_list_of_rules() -> None:
    assert rules_section().strip() == document_tools.rule_table(RULES), "run document_tools.py"


def test_every_rule_stands_in_one_row_in_its_order() -> None:
    header, *rows = table_rows(rules_section())
    titles = ["rule", "stage", "refuses", "source of the limit", "what to try", "tried next"]
    assert header == titles
    next_tried = {True: "nothing", False: "another way"}
    assert rows == [
        [r.name, stage, r.refuses, r.source, r.advice, next_tried[r.is_final]]
        for stage, rules in RULES.items()
        for r in rules
    ]


def test_a_rule_that_changes_changes_the_page(tmp_path: Path) -> None:
    path = tmp_path / document_tools.RULES_PAGE
    shutil.copy(DOCS / document_tools.RULES_PAGE, path)
    assert document_tools.document_rules(RULES, tmp_path) == []
    changed = {**RULES, SEARCH: (replace(RULES[SEARCH][0], name="a house rule"),)}
    assert document_tools.document_rules(changed, tmp_path) == [path]
    assert "| a house rule |" in path.read_text(encoding="utf-8")


def test_a_page_without_the_marks_of_its_rules_is_refused(tmp_path: Path) -> None:
    (tmp_path / document_tools.RULES_PAGE).write_text(empty_page(), encoding="utf-8")
    with pytest.raises(ValueError, match=r"method-verdict\.md must hold once"):
        document_tools.document_rules(RULES, tmp_path)


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.name)
def test_links_within_the_repository_lead_somewhere(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    targets = re.findall(r"\]\((?!https?://)([^)#]+)(?:#[^)]*)?\)", text)
    missing = [target for target in targets if not (path.parent / target).exists()]
    assert not missing


def test_the_index_links_every_page() -> None:
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    pages = {path.name for path in DOCS.glob("*.md")} - {"index.md"}
    assert {name for name in pages if f"({name})" not in index} == set()


def test_the_page_on_python_names_every_error_and_its_builtin() -> None:
    page = (DOCS / "python.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+Error)` \| `(\w+)` \|", page, re.MULTILINE))
    classes = {
        name: found.__bases__[1].__name__
        for name, found in vars(errors).items()
        if isinstance(found, type) and len(found.__bases__) == 2
    }
    assert rows == classes


def test_the_page_on_reports_names_every_number_of_the_verdict() -> None:
    page = (DOCS / "report.md").read_text(encoding="utf-8")
    _, _, keys = page.partition("## The JSON")
    assert {key for key in NOT_JUDGED.summary() if f"`{key}`" not in keys} == set()
