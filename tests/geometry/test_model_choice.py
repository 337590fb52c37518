from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundtie.errors import TooFewPointsError
from groundtie.geometry.model_choice import (
    STANDARD_ERRORS,
    choose_simplest,
    left_out_blocks,
    left_out_scores,
    standard_errors,
)

PX = np.random.default_rng(0).uniform(0, 600, (200, 2))
NOISE = np.random.default_rng(1).normal(0, 1, 200)


def choose(gains: dict[str, float | None], **options: object) -> tuple[str, list[str]]:
    """Choose among kinds that score so much on average; None: their fit fails."""

    def fit(kind: str) -> tuple[str, np.ndarray]:
        gain = gains[kind]
        if gain is None:
            raise TooFewPointsError(f"too few points for {kind}")
        return kind, gain + 0.01 * (NOISE if kind == "affine" else -NOISE)

    return choose_simplest(list(gains), fit, PX, **options)  # type: ignore[arg-type]


def test_the_simplest_is_chosen_unless_a_more_flexible_one_gains() -> None:
    assert choose({"translation": 0.0, "similarity": 0.0})[0] == "translation"
    chosen, fitted = choose({"translation": 0.0, "similarity": 0.0, "affine": 0.5})
    assert (chosen, fitted) == ("affine", ["translation", "similarity", "affine"])
    assert choose({"translation": 0.0, "similarity": 0.5, "affine": 0.4})[0] == "similarity"


def test_the_gain_must_exceed_what_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    gains = {"translation": 0.0, "affine": 0.002}
    errors = standard_errors(0.002 + 0.02 * NOISE, PX)
    for asked, chosen in ((errors - 0.1, "affine"), (errors + 0.1, "translation")):
        monkeypatch.setitem(STANDARD_ERRORS, "affine", asked)
        assert choose(gains)[0] == chosen


def test_a_model_that_points_do_not_hold_is_not_chosen() -> None:
    gains = {"translation": 0.0, "similarity": 1.0, "affine": 2.0}
    asked_of = []

    def is_held(tried: str) -> bool:
        asked_of.append(tried)
        return tried != "similarity"

    assert choose(gains, is_held=is_held)[0] == "affine"
    assert asked_of == ["similarity", "affine"]


def test_models_that_cannot_be_fitted_are_passed_over() -> None:
    assert choose({"translation": None, "similarity": -1.0})[0] == "similarity"
    with pytest.raises(TooFewPointsError, match="for translation"):
        choose({"translation": None, "similarity": None})


def test_nothing_below_the_baseline_is_chosen() -> None:
    baseline = np.zeros(200)
    assert choose({"translation": -1.0, "similarity": 1.0}, baseline=baseline)[0] == "similarity"
    with pytest.raises(TooFewPointsError, match="too few of 200 points agree"):
        choose({"translation": -1.0, "similarity": -1.0}, baseline=baseline)


def test_each_point_is_scored_by_the_model_without_it() -> None:
    blocks = left_out_blocks(PX)
    assert np.array_equal(np.sum(blocks, axis=0), np.ones(200))
    scores = left_out_scores(PX, range(len(blocks)), lambda i, block: np.full(block.sum(), i))
    for number, block in enumerate(blocks):
        assert (scores[block] == number).all()


def test_standard_errors_are_those_of_the_sums_of_blocks() -> None:
    """Neighbours that rise together count once: as if there were one point a block."""
    block = (PX // 120).astype(int) @ [1, 5]
    rise = np.random.default_rng(2).normal(1, 1, 25)[block]
    assert standard_errors(rise, PX) < 0.5 * rise.sum() / (rise.std() * np.sqrt(200))
    assert standard_errors(np.ones(4), np.ones((4, 2))) == 0.0


@settings(max_examples=60)
@given(
    px=st.lists(st.tuples(st.floats(0, 1e4), st.floats(0, 1e4)), min_size=1, max_size=40),
)
def test_each_point_is_left_out_by_one_of_five_folds(px: list[tuple[float, float]]) -> None:
    blocks = left_out_blocks(np.array(px))
    assert (np.sum(blocks, axis=0) == np.ones(len(px))).all()
    same = np.unique(np.array(px), axis=0)
    assert len(blocks) <= min(len(same), 5)


def test_neighbours_share_a_fold_and_each_line_holds_all() -> None:
    cols, rows = np.meshgrid(np.arange(50.0), np.arange(50.0))
    left_out = left_out_blocks(np.column_stack([cols.ravel(), rows.ravel()]))
    folds = np.argmax(left_out, axis=0).reshape(50, 50)
    blocks = folds.reshape(5, 10, 5, 10).transpose(0, 2, 1, 3).reshape(25, 100)
    # The last row and column of the extent belong to the last blocks: all blocks but those are
    # of 10 points a side, give or take one.
    assert (blocks == np.median(blocks, axis=1)[:, None]).mean() > 0.8
    table = folds[5::10, 5::10]
    for line in (*table, *table.T):
        assert sorted(line) == [0, 1, 2, 3, 4]
    assert np.bincount(folds.ravel()).min() > 400


def test_points_on_one_spot_or_line_have_folds() -> None:
    assert len(left_out_blocks(np.ones((4, 2)))) == 1
    assert len(left_out_blocks(np.column_stack([np.arange(20.0), np.ones(20)]))) == 5


def test_a_few_points_are_not_all_left_out_at_once() -> None:
    """All three lie in blocks that share a fold where there are many points."""
    assert len(left_out_blocks(np.array([[10.0, 10.0], [990.0, 700.0], [500.0, 990.0]]))) == 3
