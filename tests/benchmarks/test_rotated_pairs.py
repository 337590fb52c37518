from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from raster_files import write_raster
from turned_pairs import turned_pair

from benchmarks.accuracy import CORRECT, CRASHED, REFUSED, SILENTLY_WRONG
from benchmarks.attempt import Outcome
from benchmarks.cases import RealCase
from benchmarks.rotated_pairs import RotatedCase, crossed, goals, rotated_cases, run
from benchmarks.suites import Settings
from groundtie.pose.pose import Pose

POSE = Pose(40.0, 1.1, (3.0, 2.0))
KIND = "optical-optical-rotated"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two cases, and one of another kind."""
    folder = tmp_path_factory.mktemp("data")
    transform = POSE.between((150, 160), (170, 150))
    listed = []
    for number in range(2):
        names = f"reference{number}.tif", f"input{number}.tif"
        for name, window in zip(names, turned_pair(POSE, seed=number), strict=True):
            write_raster(folder / name, window.values)
        case = {"id": f"case/{number}", "kind": KIND, "reference": names[0], "input": names[1]}
        matrix = np.array(transform[:6]).reshape(2, 3).tolist()
        listed.append(case | {"truth": {"sigma_px": 2.0, "reference_to_input": matrix}})
    listed.append(listed[0] | {"kind": "sar-optical"})
    (folder / "cases.json").write_text(json.dumps(listed), encoding="utf-8")
    return folder


def outcome(verdict: str, seconds: float = 1.0) -> Outcome:
    nan = float("nan")
    return Outcome("a", KIND, verdict, verdict, 0.5, 0.5, 2.0, seconds, nan, "similarity", "")


def test_only_cases_of_unknown_rotation_are_read(data: Path) -> None:
    cases = rotated_cases(data)
    assert [case.name for case in cases] == ["case/0", "case/1"]
    assert cases[0].reference == data / "reference0.tif"


@pytest.mark.slow
def test_what_is_accepted_but_wrong_is_silently_wrong(data: Path) -> None:
    case = rotated_cases(data)[0]
    matrix = case.matrix + [[0, 0, 5], [0, 0, 0]]
    wrong = RealCase(case.name, KIND, case.reference, case.input, 2.0, matrix)
    found = RotatedCase(wrong).run(2)
    assert found.verdict == SILENTLY_WRONG
    # 5 input pixels are 4.5 of the reference, and 7.3 of one that is 256 px wide.
    assert found.error_px == pytest.approx(5 / 1.1 * 256 / 160, abs=1)


def test_what_cannot_be_read_has_crashed(data: Path) -> None:
    case = rotated_cases(data)[0]
    found = RotatedCase(case, data / "missing.tif").run(2)
    assert found.verdict == CRASHED


def test_no_case_is_crossed_with_itself(data: Path) -> None:
    case = rotated_cases(data)[0]
    many = [
        RealCase(str(i), KIND, case.reference, Path(f"{i}.tif"), 2.0, case.matrix)
        for i in range(29)
    ]
    pairs = [(one.case.name, one.input) for one in crossed(many)]
    assert len(pairs) == len(set(pairs)) == 4 * 29
    assert all(Path(f"{name}.tif") != input for name, input in pairs)


def test_cases_of_one_place_are_not_crossed(data: Path) -> None:
    case = rotated_cases(data)[0]
    names = ("oi-rotated/80", "oi-rotated/100", "other", "another")
    few = [RealCase(name, KIND, case.reference, Path(name), 2.0, case.matrix) for name in names]
    pairs = {(one.case.name, str(one.input)) for one in crossed(few)}
    assert ("oi-rotated/80", "oi-rotated/100") not in pairs
    assert ("oi-rotated/100", "other") in pairs


class TestGoals:
    def test_all_found_in_time(self) -> None:
        found = goals(KIND, [outcome(CORRECT), outcome(CORRECT, 2.9)])
        assert [goal.reached for goal in found] == [True, True]

    @pytest.mark.parametrize("verdict", [REFUSED, SILENTLY_WRONG])
    def test_one_missed(self, verdict: str) -> None:
        found = goals(KIND, [outcome(CORRECT), outcome(verdict)])
        assert found[0].reached is False
        assert found[0].found.startswith("1 of 2")

    def test_too_slow(self) -> None:
        assert goals(KIND, [outcome(CORRECT, 3.2)])[1].reached is False

    def test_other_places_must_be_refused(self) -> None:
        (goal,) = goals("crossed", [outcome(REFUSED), outcome(SILENTLY_WRONG)])
        assert goal.reached is False
        assert goals("crossed", [outcome(REFUSED)])[0].reached is True


@pytest.mark.slow
def test_a_quick_run(data: Path, tmp_path: Path) -> None:
    result = run(Settings(True, 1, 1, data, tmp_path))
    right, crossed = result.records[:2], result.records[2:]
    assert [record["verdict"] for record in right] == [CORRECT, CORRECT]
    assert all(record["error_px"] < 1 for record in right)
    assert {record["group"] for record in right} == {KIND}
    assert result.goals[0].reached
    # Of two cases every second stride leads back to the case itself.
    (other,) = [record for record in crossed if record["verdict"] == REFUSED]
    assert other["group"] == "crossed"
