"""The suite of RPCs in cities: judged by the truth on the ground, counted by size and looks."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from benchmark_outcomes import outcome

import groundtie
from benchmarks import rpc_city
from benchmarks.accuracy import CORRECT, CRASHED, INACCURATE, REFUSED, SILENTLY_WRONG
from benchmarks.rpc import rms
from benchmarks.rpc_city import EXTRACTED, MODELLED, REFINED, RUNS, City, CityCase
from benchmarks.suites import Settings, SuiteResult
from groundtie.errors import NotRegisteredError
from groundtie.sensor.rpc_files import read_rpc, write_rpc

HEADER = "reference_x,reference_y,height_m,input_col,input_row,role,state"


@pytest.fixture(scope="module")
def city() -> City:
    return City(64, 4.0, 3)


@pytest.fixture(scope="module")
def scene(city: City, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scene of the city, a suburb, which is small enough for a test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rpc_city, "DENSITY", "suburban")
        return city.scene(tmp_path_factory.mktemp("cache"))


def settings(cache: Path, **more: Any) -> Settings:
    return Settings(
        **{"quick": False, "seeds": 20, "jobs": 1, "data": cache, "cache": cache} | more
    )


def test_at_least_forty_cities_by_default_and_few_of_them_quickly(tmp_path: Path) -> None:
    every = rpc_city.cases(settings(tmp_path))
    for what in RUNS:
        own = [case.city for case in every if case.what == what]
        assert len(set(own)) == len(own) >= 40
        assert {(city.size, city.looks) for city in own} == {
            (700, 1.0), (700, 4.0), (1000, 1.0), (1000, 4.0)
        }  # fmt: skip
    assert len(rpc_city.cases(settings(tmp_path, seeds=2))) == 4 * 2 * len(RUNS)
    assert len(rpc_city.cases(settings(tmp_path, quick=True))) == len(RUNS)


def test_only_the_comparison_sets_a_surface_model() -> None:
    scene = Path("scene")
    assert [run.on(scene) for run in RUNS.values()] == [
        {},
        {"surface_model": scene / "dsm.tif"},
        {},
    ]


@pytest.mark.slow
def test_a_scene_is_made_once(city: City, scene: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groundtie, "simulate_sensor", None)
    assert city.scene(scene.parent) == scene
    assert [path.name for path in scene.parent.iterdir()] == [scene.name]


@pytest.mark.slow
def test_rpcs_are_wrong_by_what_they_are_moved(scene: Path, tmp_path: Path) -> None:
    exact = read_rpc(scene / "exact_rpc.txt")
    refined = tmp_path / "refined_RPC.TXT"
    write_rpc(refined, exact)
    assert rms(rpc_city.misses_px(scene, refined)) < 1e-3
    write_rpc(refined, exact.shifted(np.array([3.0, 4.0])))
    assert rms(rpc_city.misses_px(scene, refined)) == pytest.approx(5.0, abs=1e-3)


def write_points(scene: Path, path: Path, off: np.ndarray, end: str = "fit,used") -> None:
    """Write the scene's check points as ground control that is off by so much, (n or 1, 2)."""
    rows = [line.split(",") for line in (scene / "check_points.csv").read_text().split()[1:]]
    moved = np.array([row[3:5] for row in rows], float) + off
    lines = [
        ",".join([*row[:3], *map(str, px), end])
        for row, px in zip(rows, moved.tolist(), strict=True)
    ]
    lines.append(f"{','.join(rows[0][:3])},900,900,fit,rejected: disagrees with the model")
    lines.append(f"{','.join(rows[0][:3])},900,900,check,used")
    path.write_text("\n".join([HEADER, *lines]))


def test_ground_control_is_as_wrong_as_what_its_points_have_in_common(
    scene: Path, tmp_path: Path
) -> None:
    points = tmp_path / "points.csv"
    write_points(scene, points, np.array([[3.0, 4.0]]))
    assert rms(rpc_city.misses_px(scene, points)) == pytest.approx(5.0, abs=0.01)
    count = len((scene / "check_points.csv").read_text().split()) - 1
    noise = np.random.default_rng(0).normal(0, 1.0, (count, 2))
    write_points(scene, points, noise)
    # Three parameters for each coordinate are fitted to so many points.
    assert rms(rpc_city.misses_px(scene, points)) < 3 * math.sqrt(6 / count)


@pytest.mark.parametrize(
    ("error_px", "verdict"),
    [(2.0, CORRECT), (2.1, INACCURATE), (3.0, INACCURATE), (3.1, SILENTLY_WRONG)],
)
def test_limits(error_px: float, verdict: str) -> None:
    assert rpc_city.judge(error_px) == verdict


SUMMARY = {
    "verdict": {"check_rmse_px": 0.5, "ce90_px": 2.6, "reason": "they agree"},
    "bias": {"model": "shift"},
}


def test_cases_call_the_tool_and_judge_what_it_writes(
    city: City, scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[dict[str, Any]] = []

    def refine(**given: Any) -> SimpleNamespace:
        calls.append(given)
        write_rpc(given["output"], read_rpc(scene / "exact_rpc.txt").shifted(np.array([0.0, 2.5])))
        return SimpleNamespace(summary=lambda: SUMMARY)

    monkeypatch.setattr(groundtie, "refine_rpc", refine)
    found = CityCase(city, MODELLED, scene.parent).run(1)
    assert (found.verdict, found.model, found.reason) == (INACCURATE, "shift", "they agree")
    assert found.group == "refine_rpc, surface model, 64 px, 4 looks"
    assert found.error_px == pytest.approx(2.5, abs=1e-3)
    assert found.claimed_ce90_px == 2.6
    assert calls[0]["surface_model"] == scene / "dsm.tif"
    assert CityCase(city, REFINED, scene.parent).run(1).verdict == INACCURATE
    assert "surface_model" not in calls[1]


@pytest.mark.parametrize(
    ("error", "verdict"),
    [(NotRegisteredError("too few points"), REFUSED), (ValueError("oh"), CRASHED)],
)
def test_refusals_and_crashes_are_counted(
    city: City, scene: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, verdict: str
) -> None:
    def extract(**given: Any) -> None:
        raise error

    monkeypatch.setattr(groundtie, "extract_gcps", extract)
    found = CityCase(city, EXTRACTED, scene.parent).run(1)
    assert found.verdict == verdict
    assert str(error) in found.reason


def suite(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, wrong: str) -> SuiteResult:
    def run(case: CityCase, workers: int | None) -> Any:
        error = 8.3 if case.what == wrong and case.city.seed == 2 else 0.5
        return outcome(rpc_city.judge(error), error, name=case.city.name, group=case.group)

    monkeypatch.setattr(City, "scene", lambda city, cache: cache)
    monkeypatch.setattr(CityCase, "run", run)
    return rpc_city.run(settings(tmp_path, seeds=2))


@pytest.mark.parametrize(
    ("wrong", "reached"),
    [
        (REFINED, [False, True, True]),
        (MODELLED, [True, False, True]),
        (EXTRACTED, [True, True, False]),
    ],
)
def test_goals(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, wrong: str, reached: list[bool]
) -> None:
    result = suite(monkeypatch, tmp_path, wrong)
    assert [goal.reached for goal in result.goals] == reached


def test_tables_count_by_size_and_looks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    detailed, summed = suite(monkeypatch, tmp_path, REFINED).tables
    assert len(detailed.rows) == 4 * len(RUNS)
    expected = [
        "refine_rpc, 700 px, 1 looks",
        "2",
        "1",
        "0",
        "1",
        "0",
        "0",
        "4.40",
        "8.30",
        "0 of 2",
    ]
    assert list(detailed.rows[0]) == expected
    assert [row[1] for row in summed.rows] == ["8"] * len(RUNS)


def test_nothing_accepted() -> None:
    table = rpc_city.verdict_table({"a": [outcome(REFUSED)]})
    assert table.rows == [["a", "1", "0", "0", "0", "1", "0", "–", "–", "0 of 0"]]
