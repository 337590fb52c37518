"""Match rates are shares of what is known, and the tables say what was found."""

from __future__ import annotations

import numpy as np
import pytest
from affine import Affine
from benchmark_outcomes import outcomes
from textured_pairs import texture

from benchmarks.accuracy import CORRECT, REFUSED, SILENTLY_WRONG
from benchmarks.cases import RealCase, write_image
from benchmarks.match_rates import METHODS, ClearCase, CloudyCase, MatchRate
from benchmarks.optical import cloud_table, goals, mean_table, pair_table
from groundtie.features.classifier import KERNELS


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> RealCase:
    """Return a pair whose input lies 7 columns and 4 rows off."""
    folder = tmp_path_factory.mktemp("pair")
    canvas = 120 + 30 * texture(260, 260)
    for name, col, row in (("a", 0, 0), ("b", 7, 4)):
        part = canvas[row : row + 250, col : col + 250]
        values = np.clip(part, 0, 255).astype(np.uint8)[None]
        write_image(values, Affine.scale(1, -1), folder / f"{name}.tif")
    matrix = np.array([[1.0, 0, -7], [0, 1, -4]])
    return RealCase("hills", "optical-optical", folder / "a.tif", folder / "b.tif", 0.5, matrix)


def test_equal_images_match_nearly_everywhere(case: RealCase) -> None:
    found = ClearCase(case).run(1).found
    assert [rate.method for rate in found] == list(METHODS)
    for rate in found:
        assert rate.rates[0] > 0.9
        assert rate.correct_at_20 == 20


def test_a_wrong_truth_leaves_no_match_right(case: RealCase) -> None:
    wrong = case.matrix + [[0, 0, 40], [0, 0, 0]]
    off = RealCase("off", case.kind, case.reference, case.input, 0.5, wrong)
    assert max(rate.rates[0] for rate in ClearCase(off).run(1).found) < 0.1


def test_refinement_leaves_out_matches_on_clouds(case: RealCase) -> None:
    found = {rate.refinement: rate for rate in CloudyCase(case).run(1).found}
    assert set(found) == {"", *KERNELS}
    for kernel in KERNELS:
        assert found[kernel].matches < found[""].matches
    assert found["polynomial"].rates[0] > found[""].rates[0]


def rate(name: str, method: str, share: float, refinement: str = "") -> MatchRate:
    return MatchRate(name, "day-night", method, refinement, 50, (share, share / 2), 10, 0.5)


def test_tables_hold_the_rates() -> None:
    clear = [rate(name, m, s) for m in METHODS for name, s in (("a", 0.2), ("b", 0.4))]
    assert mean_table(clear).rows[0] == ["SURF-64", "30.0", "15.0", "10.0", "50", "0.50"]
    assert pair_table("", clear, ["HOG-81"]).rows == [["a", "20 (10)"], ["b", "40 (10)"]]
    cloudy = [rate("a", "HOG-81", 0.2), *(rate("a", "HOG-81", 0.3, k) for k in KERNELS)]
    cloudy += [rate("b", "HOG-81", 0.5)]
    rows = cloud_table(cloudy).rows
    assert rows[0] == ["a", "20.0 (50)", *["30.0 (50)"] * 4]
    assert rows[1] == ["b", "50.0 (50)", *["–"] * 4]
    # Pairs without enough of both classes are no part of the means.
    assert rows[2] == ["mean", "20.0", *["30.0"] * 4]


def test_goals_are_reached_or_not() -> None:
    clear = [rate("a", "SURF-64", 0.2), rate("a", "HOG-81", 0.3)]
    cloudy = [rate("a", "HOG-81", 0.2), rate("a", "HOG-81", 0.3, "polynomial")]
    good = outcomes({CORRECT: 9, REFUSED: 1})
    assert [goal.reached for goal in goals(clear, cloudy, good)] == [True, True, True, True]
    bad = outcomes({CORRECT: 8, SILENTLY_WRONG: 2})
    same = [rate("a", "SURF-64", 0.2), rate("a", "HOG-81", 0.2)]
    worse = [rate("a", "HOG-81", 0.3), rate("a", "HOG-81", 0.2, "polynomial")]
    assert [goal.reached for goal in goals(same, worse, bad)] == [False] * 4
