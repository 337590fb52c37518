"""Write the table of rules into docs/method-verdict.md, from the list of rules."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from groundtie.registration.rules import RULES, Rule

PAGE = Path(__file__).resolve().parents[1] / "docs" / "method-verdict.md"
BEGIN, END = "<!-- rules -->", "<!-- /rules -->"


def table(rules: Sequence[Rule] = RULES) -> str:
    """Return the table of rules, in their order."""
    lines = [
        "| rule | refuses if | source of the limit | what to try |",
        "| --- | --- | --- | --- |",
    ]
    for rule in rules:
        cells = (rule.name, rule.refuses, rule.source, rule.advice)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def with_table(page: str, text: str) -> str:
    """Return a page with a text between the marks.

    Raises
    ------
    ValueError
        The page does not have the marks once, in their order.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end or BEGIN in after or END in before + after:
        raise ValueError(f"the page must hold once, and in this order: {BEGIN} {END}")
    return f"{before}{BEGIN}\n{text}\n{END}{after}"


def main() -> int:
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(with_table(page, table()), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
