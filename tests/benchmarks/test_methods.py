"""The suite's tables and goals, from shares and registrations that are made up."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from benchmarks import methods
from benchmarks.accuracy import CORRECT, CRASHED, REFUSED, SILENTLY_WRONG, VERDICTS
from benchmarks.chips import CHIPS_PX, ChipShare, ChipShares
from benchmarks.methods import (
    choose_scenes,
    error_table,
    goals,
    mean_share,
    pair_table,
    program_table,
    share_table,
)
from benchmarks.programs import PROGRAMS, Registration, Registrations
from benchmarks.speed import NOT_INSTALLED, OWN
from benchmarks.suites import Settings
from benchmarks.tables import suite_markdown, write_result
from groundtie.similarity.surface import SIMILARITIES

FIRST = CHIPS_PX[0]
PEER = PROGRAMS[0].name


def shares(
    name: str, values: dict[str, float], group: str = "sar-optical", chips: int = 9
) -> list[ChipShare]:
    """Shares within 3 px; half of that is within 1.5 px. Similarities not named have 0."""
    return [
        ChipShare(
            name,
            group,
            similarity,
            FIRST,
            chips,
            (values.get(similarity, 0.0) / 2, values.get(similarity, 0.0)) if chips else (),
            20.0,
        )
        for similarity in SIMILARITIES
    ]


def registration(
    program: str = OWN, verdict: str = CORRECT, error_px: float | None = 0.5, name: str = "hills"
) -> Registration:
    return Registration(name, "sar-optical", program, verdict, error_px, 2.0, 1.5, 200_000_000)


def rows(table: methods.Table) -> dict[str, dict[str, str]]:
    """Cells by the row's first cell and the column's head."""
    return {row[0]: dict(zip(table.head, row, strict=True)) for row in table.rows}


def test_the_mean_is_over_pairs_not_chips() -> None:
    some = [*shares("a", {"nmi": 0.2}, chips=100), *shares("b", {"nmi": 0.6}, chips=1)]
    assert mean_share(some, "nmi", FIRST, ("sar-optical",), 1) == pytest.approx(0.4)
    assert mean_share(some, "nmi", FIRST, ("sar-optical",), 0) == pytest.approx(0.2)


def test_pairs_without_chips_do_not_count() -> None:
    some = [*shares("a", {"nmi": 0.2}), *shares("b", {}, chips=0)]
    assert mean_share(some, "nmi", FIRST, ("sar-optical",), 1) == pytest.approx(0.2)
    assert mean_share(some, "nmi", FIRST, ("day-night",), 1) is None
    assert mean_share(some, "nmi", CHIPS_PX[1], ("sar-optical",), 1) is None


def test_shares_stand_by_similarity_and_group() -> None:
    some = [*shares("a", {"nmi": 0.5}), *shares("b", {"nmi": 0.7}, "sar-sar")]
    table = share_table(some, FIRST)
    assert list(table.head) == ["similarity", "SAR, real", "sar-optical", "sar-sar", "ms a chip"]
    cells = rows(table)
    assert tuple(cells) == SIMILARITIES
    assert cells["nmi"]["sar-optical"] == "25 / 50"
    assert cells["nmi"]["SAR, real"] == "30 / 60"
    assert cells["nmi"]["ms a chip"] == "20"
    assert rows(share_table(some, CHIPS_PX[1]))["nmi"]["sar-sar"] == "– / –"


def test_shares_stand_by_pair() -> None:
    some = [*shares("a", {"nmi": 0.5, "fused": 1.0}), *shares("b", {}, chips=0)]
    table = pair_table(some)
    assert rows(table)["a"]["fused"] == "100" and rows(table)["a"]["chips"] == "9"
    assert list(rows(table)) == ["a"]


@pytest.mark.parametrize(
    ("fused", "best", "reached"),
    [(0.80, 0.70, (True, True)), (0.70, 0.75, (False, False)), (0.77, 0.79, (True, True))],
)
def test_goals_are_on_the_mean_and_on_the_worst_pair(
    fused: float, best: float, reached: tuple[bool, bool]
) -> None:
    found = goals(shares("a", {"fused": fused, "orientation": best}))
    assert tuple(goal.reached for goal in found) == reached
    assert found[1].found.endswith("(a)")


def test_goals_are_on_sar_alone() -> None:
    others = shares("b", {"ncc": 1.0}, "optical-optical")
    assert goals(others) == ()
    both = goals([*others, *shares("a", {"fused": 0.9})])
    assert both[0].found == "90.0%" and both[1].reached


def test_programs_are_counted_and_those_that_are_missing_named() -> None:
    runs = [
        registration(),
        registration(verdict=SILENTLY_WRONG, error_px=30.0),
        registration(verdict=REFUSED, error_px=None),
    ]
    cells = rows(program_table("all", runs))
    assert list(cells) == [OWN, *(program.name for program in PROGRAMS)]
    own = cells[OWN]
    assert [own[v] for v in VERDICTS] == ["1", "0", "1", "1", "0"]
    assert (own["runs"], own["median error (px)"], own["largest (px)"]) == ("3", "15.25", "30.0")
    assert (own["median s"], own["processor s"], own["peak MB"]) == ("2.0", "1.5", "200")
    assert cells[PEER]["runs"] == NOT_INSTALLED


def test_a_program_that_never_finished_has_no_memory() -> None:
    failed = Registration("hills", "sar-optical", PEER, REFUSED, None, 180.0, reason="time limit")
    cells = rows(program_table("all", [failed]))[PEER]
    assert (cells["median error (px)"], cells["processor s"], cells["peak MB"]) == ("–",) * 3


def test_errors_stand_by_pair() -> None:
    runs = [
        registration(),
        registration(PEER, SILENTLY_WRONG, 12.34),
        registration(verdict=CRASHED, error_px=None, name="plain"),
    ]
    table = error_table(runs)
    assert list(table.head) == ["pair", OWN, PEER]
    assert table.rows == [["hills", "0.5", "12.3"], ["plain", "crashed", "–"]]


@pytest.fixture
def settings(data: Path, tmp_path: Path) -> Settings:
    return Settings(quick=False, seeds=2, jobs=1, data=data, cache=tmp_path / "cache")


def test_all_real_pairs_and_a_few_simulated_ones_are_run(settings: Settings) -> None:
    scenes = choose_scenes(settings)
    assert [scene.name for scene in scenes[:2]] == ["hills", "plain"]
    assert [scene.group for scene in scenes[2:]] == ["rural"] * 2 + ["suburban"] * 2
    many = choose_scenes(dataclasses.replace(settings, seeds=20))
    assert len(many) == 2 + 2 * methods._MOST_SEEDS


def test_a_quick_run_has_one_small_pair_of_two_kinds(settings: Settings) -> None:
    scenes = choose_scenes(dataclasses.replace(settings, quick=True))
    assert [scene.name for scene in scenes] == ["hills", "plain"]


def test_the_suite_writes_markdown_and_json(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = [
        ChipShares(tuple(shares("hills", {"fused": 0.9}))),
        Registrations((registration(), registration(PEER, REFUSED, None))),
    ]
    cases = []
    monkeypatch.setattr(methods, "run_cases", lambda given, jobs: cases.extend(given) or parts)
    result = methods.run(settings)
    # The chips and the registrations of every pair.
    assert len(cases) == 2 * len(choose_scenes(settings))
    page = suite_markdown(result, {"commit": "abc"})
    assert "90.0%" in page and f"| {PEER} | 1 |" in page and NOT_INSTALLED in page
    _, numbers = write_result("methods", result, {"commit": "abc"}, tmp_path)
    records = json.loads(numbers.read_text())["records"]
    assert len(records) == len(SIMILARITIES) + 2
    assert records[-1]["verdict"] == REFUSED and records[-1]["error_px"] is None
