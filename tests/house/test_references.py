"""Every citation is an entry of docs/references.md, and every entry is cited."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REFERENCES = ROOT / "docs/references.md"
KEY = re.compile(r"\[([A-Z][A-Za-z]+(?:19|20)\d{2}[a-z]?)\]")
ENTRY = re.compile(r"^\* \*\*\[(\w+)\]\*\* ", re.MULTILINE)
# Citations by name, as they stood before there was a list.
BY_NAME = re.compile(
    r"\b[Tt]hesis [SP]\b|\bet al\.|[A-Z]\w+ (?:&|and) [A-Z]\w+,? \(?(?:19|20)\d{2}\b|doi:10"
)


def texts() -> list[Path]:
    """Return all files that may cite: code, tests, benchmarks and pages, without the list."""
    code = [
        path
        for folder in ("algorithms", "benchmarks", "scripts", "plugin", "tests")
        for path in sorted((ROOT / folder).rglob("*.py"))
        if ".peers" not in path.parts and path != Path(__file__).resolve()
    ]
    pages = [ROOT / "README.md", ROOT / "benchmarks/README.md", *sorted(ROOT.glob("docs/*.md"))]
    return [path for path in (*code, *pages) if path != REFERENCES]


def entries() -> list[str]:
    return ENTRY.findall(REFERENCES.read_text(encoding="utf-8"))


def test_entries_are_unique_and_in_order() -> None:
    keys = entries()
    assert len(set(keys)) == len(keys) > 2
    papers = [key for key in keys if key not in ("Suri2010", "Patel2017")]
    assert papers == sorted(papers, key=str.lower)


def test_every_citation_is_an_entry() -> None:
    known = set(entries())
    unknown = {
        f"{path.relative_to(ROOT)}: {key}"
        for path in texts()
        for key in KEY.findall(path.read_text(encoding="utf-8"))
        if key not in known
    }
    assert not unknown


def test_every_entry_is_cited() -> None:
    cited = {key for path in texts() for key in KEY.findall(path.read_text(encoding="utf-8"))}
    assert set(entries()) <= cited


def test_nothing_is_cited_but_by_its_key() -> None:
    named = {
        f"{path.relative_to(ROOT)}: {found.group()}"
        for path in texts()
        for found in BY_NAME.finditer(path.read_text(encoding="utf-8"))
    }
    assert not named
