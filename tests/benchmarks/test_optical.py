"""Match rates are shares of what is known, and the tables say what was found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from benchmark_outcomes import outcomes
from textured_pairs import texture

from benchmarks.accuracy import CORRECT, REFUSED, SILENTLY_WRONG
from benchmarks.cases import RealCase, write_image
from benchmarks.cloudy_rates import (
    BANDS,
    KERNEL,
    MASK,
    OTHERS,
    REFINEMENTS,
    TEXTURE,
    CloudLabels,
    CloudyCase,
    LabelCase,
    for_others,
)
from benchmarks.cloudy_registrations import CloudyRegistration
from benchmarks.match_rates import METHODS, ClearCase, MatchRate
from benchmarks.optical import (
    FREE_CROSSING,
    FreeCrossing,
    cloud_table,
    crossings,
    goals,
    mean_table,
    pair_table,
)
from benchmarks.optical_speed import REGISTRATION, SURF, Timing, timing_goals, timing_table
from benchmarks.rotated_pairs import RotatedCase
from benchmarks.suites import none_wrong


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


@pytest.mark.slow
def test_equal_images_match_nearly_everywhere(case: RealCase) -> None:
    found = ClearCase(case).run(1).found
    assert [rate.method for rate in found] == list(METHODS)
    for rate in found:
        assert rate.rates[0] > 0.9
        assert rate.correct_at_20 == 20


@pytest.mark.slow
def test_a_wrong_truth_leaves_no_match_right(case: RealCase) -> None:
    wrong = case.matrix + [[0, 0, 40], [0, 0, 0]]
    off = RealCase("off", case.kind, case.reference, case.input, 0.5, wrong)
    assert max(rate.rates[0] for rate in ClearCase(off).run(1).found) < 0.1


@pytest.mark.slow
def test_refinement_leaves_out_matches_on_clouds(case: RealCase) -> None:
    labels = LabelCase(case).run(1)
    others = for_others([labels, CloudLabels("other", labels.labelled)], case.name)
    found = {rate.refinement: rate for rate in CloudyCase(case, others).run(1).found}
    assert set(found) == {"", *REFINEMENTS}
    for name in REFINEMENTS:
        assert 0 < found[name].matches < found[""].matches
    assert found[KERNEL].rates[0] > found[""].rates[0]
    # Nothing tells better what clouds hide than their own mask.
    assert found[MASK].rates[0] >= max(found[name].rates[0] for name in REFINEMENTS) - 0.02
    without = CloudyCase(case).run(1).found
    assert {rate.refinement for rate in without} == {"", *REFINEMENTS} - {OTHERS}


def test_points_for_a_pair_are_those_of_all_others(case: RealCase) -> None:
    one = LabelCase(case).run(1).labelled
    labels = [CloudLabels(name, one) for name in ("a", "b", "c")]
    chosen = for_others(labels, "b")
    assert len(chosen.kept) == 2 * len(one.kept)
    assert one.kept.any() and not one.kept.all()


@pytest.mark.slow
@pytest.mark.parametrize("classified", [False, True])
def test_an_image_under_clouds_is_registered_or_refused(case: RealCase, classified: bool) -> None:
    found = CloudyRegistration(case, "match_optical", classified).run(1)
    assert found.verdict in (CORRECT, REFUSED)
    assert found.group == f"match_optical, {'classifier' if classified else 'no classifier'}"
    assert none_wrong("", [found]).reached
    assert not none_wrong("", outcomes({CORRECT: 3, SILENTLY_WRONG: 1})).reached


@pytest.mark.slow
def test_images_of_different_places_are_refused(case: RealCase, tmp_path: Path) -> None:
    other = np.clip(120 + 30 * texture(250, 250, 5), 0, 255).astype(np.uint8)[None]
    path = write_image(other, Affine.scale(1, -1), tmp_path / "other.tif")
    elsewhere = replace(case, name="elsewhere", input=path)
    (both,) = [one for one in crossings([case, elsewhere]) if one.reference is case][:1]
    assert (both.reference, both.input, both.tool) == (case, elsewhere, "match_optical")
    assert both.run(1).verdict == REFUSED
    free = FreeCrossing(RotatedCase(case, path)).run(1)
    assert (free.verdict, free.group) == (REFUSED, FREE_CROSSING)


def test_other_work_on_the_machine_does_not_decide_on_time() -> None:
    timings = [Timing(SURF, 5.0, 3.9), Timing(REGISTRATION, 14.0, 30.2)]
    assert [goal.reached for goal in timing_goals(timings)] == [True, False]
    assert timing_table(timings).rows[0] == [SURF, "5.00", "3.90"]


def rate(name: str, method: str, share: float, refinement: str = "") -> MatchRate:
    return MatchRate(name, "day-night", method, refinement, 50, (share, share / 2), 10, 0.5)


def test_tables_hold_the_rates() -> None:
    clear = [rate(name, m, s) for m in METHODS for name, s in (("a", 0.2), ("b", 0.4))]
    assert mean_table(clear).rows[0] == ["SURF-64", "30.0", "15.0", "10.0", "50", "0.50"]
    assert pair_table("", clear, ["HOG-81"]).rows == [["a", "20 (10)"], ["b", "40 (10)"]]
    cloudy = [rate("a", "HOG-81", 0.2), *(rate("a", "HOG-81", 0.3, k) for k in REFINEMENTS)]
    cloudy += [rate("b", "HOG-81", 0.5)]
    rows = cloud_table(cloudy).rows
    assert rows[0] == ["a", "20.0 (50)", *["30.0 (50)"] * len(REFINEMENTS)]
    assert rows[1] == ["b", "50.0 (50)", *["–"] * len(REFINEMENTS)]
    # Pairs without enough of both classes are no part of the means.
    assert rows[2] == ["mean", "20.0", *["30.0"] * len(REFINEMENTS)]


def test_goals_are_reached_or_not() -> None:
    def refined(before: float, after: float) -> list[MatchRate]:
        names = (KERNEL, BANDS, TEXTURE, OTHERS, MASK)
        parts = [rate("a", "HOG-81", after, name) for name in names]
        return [rate("a", "HOG-81", before), *parts]

    clear = [rate("a", "SURF-64", 0.2), rate("a", "HOG-81", 0.3)]
    good, refused = outcomes({CORRECT: 9, REFUSED: 1}), outcomes({REFUSED: 3})
    reached = [goal.reached for goal in goals(clear, refined(0.2, 0.3), good, refused)]
    assert reached == [True, True, True, True, None, None, True, True, True]
    bad, taken = outcomes({CORRECT: 8, SILENTLY_WRONG: 2}), outcomes({REFUSED: 2, CORRECT: 1})
    same = [rate("a", "SURF-64", 0.2), rate("a", "HOG-81", 0.2)]
    reached = [goal.reached for goal in goals(same, refined(0.3, 0.2), bad, taken)]
    assert reached == [False, False, False, False, None, None, False, False, False]
