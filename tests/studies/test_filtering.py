from __future__ import annotations

import numpy as np
import pytest

from groundtie.geometry.fitting import fit_model
from groundtie.studies.matching import filter_matches


def pairs(wrong: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, partners by an affine model, and which of them are right."""
    rng = np.random.default_rng(seed)
    px = rng.uniform(0, 500, (80, 2))
    partner = px @ [[1.01, 0.02], [-0.03, 0.99]] + [12, -7] + rng.normal(0, 0.3, px.shape)
    right = np.arange(80) >= wrong
    partner[~right] += rng.uniform(30, 200, (wrong, 2)) * rng.choice([-1, 1], (wrong, 2))
    return px, partner, right


@pytest.mark.parametrize("wrong", [0, 5, 25])
def test_wrong_matches_are_dropped_and_few_right_ones(wrong: int) -> None:
    px, partner, right = pairs(wrong)
    kept = filter_matches(px, partner)
    assert not (kept & ~right).any()
    # Beyond twice the root mean square length lie exp(-4) of such errors in each round.
    assert kept.sum() > 0.8 * right.sum()


def test_what_remains_lies_within_two_sigmas_of_its_own_fit() -> None:
    px, partner, _ = pairs(10)
    kept = filter_matches(px, partner)
    model = fit_model("affine", px[kept], partner[kept])
    residuals = np.hypot(*(partner[kept] - model(px[kept])).T)
    assert residuals.max() <= 2 * np.sqrt(np.mean(residuals**2)) + 1e-9


def test_exact_matches_are_all_kept() -> None:
    px = np.random.default_rng(1).uniform(0, 100, (20, 2))
    assert filter_matches(px, px + [3, 4], "translation").sum() == 20


def test_too_few_matches_leave_none() -> None:
    px = np.random.default_rng(1).uniform(0, 100, (3, 2))
    assert not filter_matches(px, px).any()
