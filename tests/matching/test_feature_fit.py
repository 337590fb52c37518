from __future__ import annotations

import numpy as np
import pytest
from affine import Affine

from groundtie.errors import NothingFoundError, TooFewPointsError
from groundtie.matching.feature_fit import fit_matches, require_no_rival
from groundtie.matching.matcher import Correspondences
from groundtie.rasters.grid import apply_affine, compose

AREA = np.pi * 16**2


def matches(
    truth: Affine, bend: float = 0.0, right: int = 60, wrong: int = 200, seed: int = 0
) -> Correspondences:
    """Return matches with a small misregistration; wrong ones are spread over the gate."""
    rng = np.random.default_rng(seed)
    px = rng.uniform(0, 600, (right + wrong, 2))
    partner = apply_affine(truth, px)
    partner[:, 0] += bend * ((px[:, 1] - 300) / 300) ** 2
    partner += rng.normal(0, 0.4, px.shape)
    angle, reach = rng.uniform(0, 2 * np.pi, wrong), 16 * np.sqrt(rng.random(wrong))
    partner[right:] = px[right:] + reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return Correspondences(px, partner, np.ones(len(px)), AREA)


def error_px(fit: object, prior: Affine, truth: Affine) -> float:
    px = np.stack(np.meshgrid(np.linspace(50, 550, 5), np.linspace(50, 550, 5)), -1).reshape(-1, 2)
    expected = apply_affine(compose(prior, truth), px)
    return float(np.sqrt(((fit.model(px) - expected) ** 2).sum(axis=1).mean()))  # type: ignore[attr-defined]


SHIFT = Affine.translation(3.2, -4.1)
LINEAR = compose(Affine.translation(3, -2), Affine(1.004, 0.006, 0, -0.003, 0.997, 0))


@pytest.mark.parametrize("kind", ["auto", "translation", "rigid", "similarity", "affine"])
def test_a_shift_is_found_among_three_times_as_many_wrong_matches(kind: str) -> None:
    found = matches(SHIFT)
    fit = fit_matches(kind, found, Affine.identity(), 0)
    assert error_px(fit, Affine.identity(), SHIFT) < 0.3
    right = np.arange(len(found.px)) < 60
    assert fit.mixture.inliers[right].mean() > 0.9
    assert fit.mixture.inliers[~right].mean() < 0.1
    assert len(fit.fold_models) == 5


@pytest.mark.slow
def test_auto_takes_the_simplest_model_that_predicts_best() -> None:
    for truth, bend, kinds in (
        (SHIFT, 0.0, {"translation"}),
        (LINEAR, 0.0, {"affine"}),
    ):
        found = matches(truth, bend)
        fit = fit_matches("auto", found, Affine.identity(), 0)
        assert fit.model.kind in kinds


def test_the_model_tells_claimed_positions_whatever_the_input_was_resampled_by() -> None:
    prior = compose(Affine.translation(200, -90), Affine.rotation(30), Affine.scale(1.2))
    found = matches(LINEAR)
    fit = fit_matches("affine", found, prior, 0)
    assert error_px(fit, prior, LINEAR) < 0.4


@pytest.mark.slow
def test_the_same_seed_gives_the_same_model() -> None:
    found = matches(LINEAR)
    one, other = (fit_matches("auto", found, Affine.identity(), 3) for _ in range(2))
    assert one.model.to_json() == other.model.to_json()


def test_too_few_matches_are_refused() -> None:
    found = matches(SHIFT, right=3, wrong=0)
    with pytest.raises(TooFewPointsError, match="only 3 features were matched"):
        fit_matches("auto", found, Affine.identity(), 0)


@pytest.mark.parametrize("leaning", [0, 3, 30])
def test_matches_that_agree_on_two_transforms_are_refused(leaning: int) -> None:
    found = matches(SHIFT, right=100)
    found.partner_px[:leaning] += [9.0, 0.0]
    fit = fit_matches("affine", found, Affine.identity(), 0)
    if leaning < 10:
        require_no_rival(found, Affine.identity(), fit.model)
        return
    with pytest.raises(NothingFoundError, match="agree 9 px beside the others"):
        require_no_rival(found, Affine.identity(), fit.model)


def test_matches_that_slip_to_both_sides_are_no_rival() -> None:
    found = matches(SHIFT, right=160)
    found.partner_px[:30] += [9.0, 0.0]
    found.partner_px[30:60] -= [9.0, 0.0]
    fit = fit_matches("affine", found, Affine.identity(), 0)
    require_no_rival(found, Affine.identity(), fit.model)
