"""The page on verdicts has the table of the rules that the code has."""

from __future__ import annotations

import pytest

from groundtie.registration.rules import RULES
from scripts import document_rules


def test_the_page_agrees_with_the_list_of_rules() -> None:
    page = document_rules.PAGE.read_text(encoding="utf-8")
    made = document_rules.with_table(page, document_rules.table())
    assert page == made, "run scripts/document_rules.py"


def test_every_rule_has_its_row() -> None:
    rows = document_rules.table().splitlines()[2:]
    assert [row.split(" | ")[0] for row in rows] == [f"| {rule.name}" for rule in RULES]
    assert all(row.count(" | ") == 3 for row in rows)


@pytest.mark.parametrize(
    "page", ["none", f"{document_rules.END}{document_rules.BEGIN}", f"{document_rules.BEGIN}"]
)
def test_a_page_without_its_marks_is_refused(page: str) -> None:
    with pytest.raises(ValueError, match="must hold once"):
        document_rules.with_table(page, "text")
