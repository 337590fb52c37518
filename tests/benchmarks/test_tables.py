"""Results are written for people and for programs, and say what was not reached."""

from __future__ import annotations

import json
from pathlib import Path

from benchmark_outcomes import outcome, outcomes

from benchmarks.accuracy import CORRECT, REFUSED, SILENTLY_WRONG, VERDICTS
from benchmarks.suites import Goal, SuiteResult, Table
from benchmarks.tables import accuracy_table, goals_table, suite_markdown, to_markdown, write_result

RESULT = SuiteResult(
    "Pairs",
    (Goal("correct", "at least 2 of 3", "1 of 3", False), Goal("seconds", "reported", "7", None)),
    (Table("By pair", ("pair", "error"), (("hills", "0.5"), ("plain", "–"))),),
    [outcome().record(), outcome(REFUSED).record()],
    ("A note.",),
)
ABOUT = {"commit": "abc", "quick": "no"}


def cells(table: Table) -> dict[str, list[str]]:
    """Columns by their first head; repeated heads are left out."""
    columns: dict[str, list[str]] = {}
    for index, head in enumerate(table.head):
        columns.setdefault(head, [row[index] for row in table.rows])
    return columns


def test_a_table_is_markdown() -> None:
    assert to_markdown(RESULT.tables[0]) == (
        "### By pair\n\n| pair | error |\n| --- | --- |\n| hills | 0.5 |\n| plain | – |\n"
    )


def test_an_empty_table_says_so() -> None:
    assert to_markdown(Table("Accepted", ("pair",), ())) == "### Accepted\n\nnone\n"


def test_goals_stand_beside_what_was_found() -> None:
    rows = goals_table(RESULT.goals).rows
    assert list(rows[0]) == ["correct", "at least 2 of 3", "1 of 3", "**no**"]
    assert [row[-1] for row in rows] == ["**no**", "–"]
    assert goals_table([Goal("", "", "", True)]).rows[0][-1] == "yes"


def test_every_verdict_is_counted() -> None:
    some = [outcome(v) for n, v in enumerate(VERDICTS) for _ in range(n + 1)]
    table = cells(accuracy_table("", {"all": some}))
    assert [table[verdict] for verdict in VERDICTS] == [[str(n + 1)] for n in range(len(VERDICTS))]
    assert table["runs"] == ["15"]


def test_errors_are_of_what_was_accepted() -> None:
    some = [outcome(error_px=e, lattice_error_px=2 * e) for e in (0.5, 0.1, 3.5)]
    table = cells(accuracy_table("", {"all": [*some, *outcomes({REFUSED: 9})]}))
    assert table["median error (px)"] == ["0.50"]
    assert table["largest (px)"] == ["3.50"]
    assert table["median (px)"] == ["1.00"]


def test_the_lattice_has_its_own_columns() -> None:
    some = [outcome(CORRECT, lattice_verdict=SILENTLY_WRONG), outcome(CORRECT)]
    table = accuracy_table("", {"all": some})
    row = dict(zip(list(table.head)[-4:], table.rows[0][-4:], strict=True))
    assert row["on the lattice: correct"] == "1"
    assert row["silently wrong"] == "1"


def test_a_group_that_was_refused_has_no_errors() -> None:
    table = cells(accuracy_table("", {"all": outcomes({REFUSED: 2})}))
    assert table["median error (px)"] == table["largest (px)"] == ["–"]


def test_the_range_of_the_truths_is_told() -> None:
    groups = {
        "both": [outcome(sigma_px=2.0), outcome(sigma_px=0.5), outcome(sigma_px=1.0)],
        "one": [outcome(sigma_px=2.0)],
    }
    assert cells(accuracy_table("", groups))["σ of truth (px)"] == ["0.5–2", "2"]


def test_a_page_has_goals_first_and_says_what_the_figures_depend_on() -> None:
    page = suite_markdown(RESULT, ABOUT)
    assert page.startswith("## Pairs\n\ncommit abc, quick no\n")
    assert page.index("### Goals") < page.index("### By pair") < page.index("A note.")


def test_results_are_written_twice(tmp_path: Path) -> None:
    page, numbers = write_result("real", RESULT, ABOUT, tmp_path / "results")
    assert page.read_text(encoding="utf-8") == suite_markdown(RESULT, ABOUT)
    values = json.loads(numbers.read_text(encoding="utf-8"))
    assert values["about"] == ABOUT
    assert values["goals"][0] == {
        "what": "correct",
        "wanted": "at least 2 of 3",
        "found": "1 of 3",
        "reached": False,
    }
    assert [record["verdict"] for record in values["records"]] == [CORRECT, REFUSED]
    assert values["records"][1]["error_px"] is None
