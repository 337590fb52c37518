"""The pages of methods have one form, and what pages link to exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import groundtie
from groundtie.kinds import RasterOut
from groundtie.tools import NAMES
from scripts.make_figures import DRAWN

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FIGURES = DOCS / "figures"
METHODS = sorted(DOCS.glob("method-*.md"))
TEXTS = [ROOT / "README.md", ROOT / "benchmarks/README.md", *sorted(DOCS.glob("*.md"))]

MOST_LINES = 80
MOST_BYTES = 60_000
MADE = re.compile(
    r"(<!-- rules -->\n|<!-- parameters: begin).*?(<!-- /rules -->|parameters: end -->)", re.DOTALL
)
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
IMAGE = re.compile(r"!\[[^\]]+\]\(([^)]+)\)")
ANCHOR = re.compile(r"\]\((?!https?://)([^)#]*)#([^)]+)\)")
# Words of a private language, for which the field has others.
PRIVATE = re.compile(
    r"\b(?:leans?|leaning|shin(?:es|ing)|what stands|tells?|told|says|judg(?:es?|ed|ing)|turned"
    r"|calm(?:est)?|claim(?:s|ed)?|two-way error|rough (?:shift|search)|speaks? against)\b",
    re.IGNORECASE,
)


def read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def anchors(path: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"```.*?```", "", read(path), flags=re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    plain = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower() for heading in headings]
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("path", METHODS, ids=lambda path: path.stem)
def test_a_method_page_has_one_figure_its_parts_and_is_short(path: Path) -> None:
    text = MADE.sub(r"\1\2", read(path))
    assert IMAGE.findall(text) == [f"figures/{path.stem}.png"]
    assert len(text.splitlines()) <= MOST_LINES
    headings = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert "Source" in headings
    if path.stem != "method-verdict":  # its rules have their limits, and where they come from
        assert {"Parameters", "Limits"} <= set(headings)


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.stem)
def test_pages_use_the_words_of_the_field(path: Path) -> None:
    assert PRIVATE.findall(CODE.sub("", MADE.sub("", read(path)))) == []


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.stem)
def test_images_and_anchors_exist(path: Path) -> None:
    text = read(path)
    assert all((path.parent / image).is_file() for image in IMAGE.findall(text))
    for page, anchor in ANCHOR.findall(text):
        target = path.parent / page if page else path
        assert anchor in anchors(target), f"{page}#{anchor}"


@pytest.mark.parametrize("name", NAMES)
def test_every_tool_has_a_worked_example(name: str) -> None:
    page = read(DOCS / f"{name.replace('_', '-')}.md")
    example = re.search(r"^## Example\n(.*?)^(?:## |<!--)", page, re.MULTILINE | re.DOTALL)
    assert example is not None
    assert f"groundtie {name.replace('_', '-')} " in example[1].replace("\n", " ")


def test_the_tools_that_write_virtual_rasters_are_named() -> None:
    (row,) = re.findall(r"^\| `\.vrt` (.*?) \|", read(DOCS / "files.md"), re.MULTILINE)
    declared = [
        name
        for name in NAMES
        for parameter in getattr(groundtie, name).__groundtie_tool__.parameters
        if isinstance(parameter.kind, RasterOut) and ".vrt" in parameter.kind.suffixes
    ]
    assert sorted(re.findall(r"\(([a-z-]+)\.md\)", row)) == sorted(
        name.replace("_", "-") for name in declared
    )


def test_every_figure_is_drawn_shown_and_small() -> None:
    shown = {image for path in TEXTS for image in IMAGE.findall(read(path))}
    assert {path.stem for path in FIGURES.iterdir()} == set(DRAWN)
    assert shown == {f"figures/{name}.png" for name in DRAWN}
    assert all(path.stat().st_size < MOST_BYTES for path in FIGURES.iterdir())


def test_the_readme_is_short_and_its_limits_are_points() -> None:
    text = read(ROOT / "README.md")
    assert len(text.splitlines()) <= 90
    _, _, rest = text.partition("## Limits\n")
    points = [line for line in rest.partition("\n## ")[0].splitlines() if line]
    assert 0 < len(points) <= 10
    assert all(point.startswith("* ") for point in points)


def test_every_block_of_measurements_has_its_command() -> None:
    for section in read(DOCS / "measurements.md").split("\n## ")[1:]:
        assert "    .venv/bin/python benchmarks/run.py --only " in section, section[:40]
