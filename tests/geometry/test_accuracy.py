"""The predicted accuracy of transforms holds for transforms whose error is known."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from scipy.stats import binom

from groundtie.geometry.accuracy import (
    UNKNOWN,
    Accuracy,
    Common,
    ErrorModel,
    shared_by_neighbours,
)
from groundtie.geometry.estimation import fit_without_blocks
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.misses import Misses
from groundtie.geometry.robust import Mixture

SIZE_PX = 500
RUNS = 80
NO_BIAS = np.zeros(2)


def lattice(count: int, margin: float) -> np.ndarray:
    side = np.linspace(margin, SIZE_PX - margin, count)
    return np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)


PLACES, FIT, CHECK = lattice(9, 0), lattice(8, 25), lattice(4, 80)


def missed(
    px: np.ndarray, residuals_px: np.ndarray, probability: np.ndarray | None = None
) -> Misses:
    """Return by how much points are missed that are inliers with a probability, or for sure."""
    found = Misses(px, residuals_px, radius_px=10, max_error_px=3.0)
    known = np.ones(len(px)) if probability is None else probability
    vars(found).update(mixture=Mixture(known, 1.0))
    return found


def run(
    seed: int, kind: str, sigma: float, check_sigma: float, bias: np.ndarray = NO_BIAS
) -> tuple[Accuracy, float]:
    """Fit a model to points with noise; return its predicted accuracy and error at a place."""
    random = np.random.default_rng(seed)
    nominal = FIT + sigma * random.standard_normal(FIT.shape) + bias
    model = fit_model(kind, FIT, nominal)
    folds = fit_without_blocks(kind, FIT, nominal, np.ones(len(FIT)))
    matched = CHECK + check_sigma * random.standard_normal(CHECK.shape)
    check = missed(CHECK, matched - model(CHECK))
    place = random.uniform(0, SIZE_PX, (1, 2))
    found = ErrorModel(folds, check).accuracy(PLACES)
    return found, float(np.hypot(*(model(place) - place)[0]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["translation", "affine", "polynomial2"])
@pytest.mark.parametrize("check_sigma", [0.1, 1.5])
def test_radii_hold_as_many_errors_as_they_say(kind: str, check_sigma: float) -> None:
    """Whatever the check points' own errors, within what is probable of so many runs."""
    runs = [run(seed, kind, 0.5, check_sigma) for seed in range(RUNS)]
    for name, said in (("ce50_px", 0.5), ("ce90_px", 0.9), ("ce95_px", 0.95)):
        held = sum(error <= getattr(accuracy, name) for accuracy, error in runs)
        low, high = binom.ppf((0.0005, 0.9995), RUNS, said)
        # Blocks that are left out at the border are extrapolated: the jackknife is no smaller.
        assert low <= held <= max(high, RUNS * (said + 0.2))


def test_an_error_that_no_block_shows_is_seen_by_check_points() -> None:
    accuracy, error = run(0, "affine", 0.05, 0.3, np.array([2.0, 0.0]))
    assert error == pytest.approx(2.0, abs=0.1)
    assert accuracy.ce90_px > 2.0


def test_heights_may_displace_all_points_evenly_up_to_the_largest() -> None:
    folds = [partial(np.add, (0.01 * k, 0.0)) for k in range(5)]
    check = missed(CHECK, np.zeros_like(CHECK))
    accuracy = ErrorModel(folds, check, Common(4.0 * np.array([0.6, 0.8]))).accuracy(PLACES)
    assert accuracy.ce50_px == pytest.approx(2.0, rel=0.05)
    assert accuracy.ce90_px == pytest.approx(3.6, rel=0.05)


def test_what_displaces_all_points_in_any_direction_is_normal() -> None:
    folds = [partial(np.add, (0.001 * k, 0.0)) for k in range(5)]
    check = missed(CHECK, np.zeros_like(CHECK))
    common = Common(sigma_px=0.5)
    accuracy = ErrorModel(folds, check, common).accuracy(PLACES)
    # Circles of two normal variates: sqrt(-2 ln(1 - p)) standard deviations.
    assert accuracy.ce50_px == pytest.approx(0.5 * 1.177, rel=0.05)
    assert accuracy.ce90_px == pytest.approx(0.5 * 2.146, rel=0.05)
    assert accuracy.ellipse.minor_px == pytest.approx(0.5 * 2.146, rel=0.01)
    assert accuracy.heights_px == 0.0
    sigma = ErrorModel(folds, check, common).standard_deviation_px(PLACES)
    assert sigma == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0, 135.0])
def test_the_ellipse_is_longest_along_what_heights_displace(angle_deg: float) -> None:
    # Clockwise from the top; rows run down.
    angle = math.radians(angle_deg)
    along = np.array([math.sin(angle), -math.cos(angle)])
    folds = [partial(np.add, (0.01 * k, 0.01 * k**2)) for k in range(5)]
    check = missed(CHECK, np.zeros_like(CHECK))
    accuracy = ErrorModel(folds, check, Common(4.0 * along)).accuracy(PLACES)
    # An even distribution to ±4 px has a standard deviation of 4 / √3; 90 % of two normal
    # variates lie within 2.146 of theirs.
    assert accuracy.ellipse.major_px == pytest.approx(2.146 * 4 / math.sqrt(3), rel=0.01)
    assert accuracy.ellipse.minor_px < 0.5
    off = (accuracy.ellipse.angle_deg - angle_deg + 90) % 180 - 90
    assert abs(off) < 1
    assert accuracy.heights_px == pytest.approx(4.0)


@pytest.mark.slow
def test_the_ellipse_of_random_errors_holds_nine_in_ten() -> None:
    """A shift known to 0.5 / √64 px an axis from all points: 90 % in a circle of 2.146 times it."""
    axes = [run(seed, "translation", 0.5, 0.0)[0].ellipse for seed in range(RUNS)]
    mean = np.mean([(one.major_px * one.minor_px) for one in axes]) ** 0.5
    assert mean == pytest.approx(2.146 * 0.5 / math.sqrt(len(FIT)), rel=0.3)


@pytest.mark.slow
def test_the_interval_holds_the_true_radius_as_often_as_it_says() -> None:
    """For a shift of σ = 0.5 / √64 px an axis, with the interval's 90 %, or a little more."""
    true = 2.146 * 0.5 / math.sqrt(len(FIT))
    ranges = [run(seed, "translation", 0.5, 0.1)[0].ce90_range_px for seed in range(RUNS)]
    held = sum(low <= true <= high for low, high in ranges)
    assert held >= binom.ppf(0.001, RUNS, 0.75)


def test_matching_errors_of_neighbours_are_not_shared() -> None:
    random = np.random.default_rng(5)
    own = [missed(CHECK, random.standard_normal(CHECK.shape)) for _ in range(200)]
    assert np.mean([shared_by_neighbours(check)[0] for check in own]) < 0.1
    common = missed(CHECK, np.full(CHECK.shape, 0.7))
    assert shared_by_neighbours(common)[0] == pytest.approx(0.49)


def test_outliers_count_by_their_probability() -> None:
    residuals, weights = np.zeros_like(CHECK), np.ones(len(CHECK))
    residuals[3], weights[3] = 12.0, 0.0
    assert shared_by_neighbours(missed(CHECK, residuals, weights))[0] == 0.0


def test_one_block_or_no_check_point_predicts_nothing() -> None:
    check = missed(CHECK, np.zeros_like(CHECK))
    none = missed(CHECK[:0], CHECK[:0])
    alike = partial(np.add, 0.0)
    assert ErrorModel([alike], check).accuracy(PLACES) is UNKNOWN
    assert ErrorModel([alike] * 5, none).accuracy(PLACES) is UNKNOWN
    assert ErrorModel([alike] * 5, check).accuracy(PLACES).ce90_px == 0.0


def test_fewer_check_points_leave_a_wider_interval() -> None:
    folds = [partial(np.add, (0.1 * k, 0.0)) for k in range(5)]

    def width(side: int) -> float:
        px = lattice(side, 80)
        # The same error to the left and to the right in turns: nothing is shared.
        own = np.where((np.arange(len(px)) + np.arange(len(px)) // side) % 2, 0.5, -0.5)
        check = missed(px, np.column_stack([own, 0 * own]))
        low, high = ErrorModel(folds, check).accuracy(PLACES).ce90_range_px
        return high / low

    assert width(2) > 1.2 * width(6)


@pytest.mark.parametrize("kind", ["translation", "affine"])
def test_the_standard_deviation_is_that_of_errors(kind: str) -> None:
    squared = []
    for seed in range(RUNS):
        random = np.random.default_rng(seed)
        nominal = FIT + random.standard_normal(FIT.shape)
        model = fit_model(kind, FIT, nominal)
        folds = fit_without_blocks(kind, FIT, nominal, np.ones(len(FIT)))
        matched = CHECK + random.standard_normal(CHECK.shape)
        check = missed(CHECK, matched - model(CHECK))
        place = random.uniform(0, SIZE_PX, (1, 2))
        sigma = ErrorModel(folds, check).standard_deviation_px(place)
        squared.append(((model(place) - place)[0] / sigma) ** 2)
    # 1, and a little more, as blocks know their variance badly; 160 values are good to 11 %.
    assert 0.75 < np.mean(squared) < 1.6


def test_heights_add_the_variance_of_an_even_distribution() -> None:
    still = [lambda px: px] * 4
    check = missed(CHECK, np.zeros(CHECK.shape))
    found = ErrorModel(still, check, Common(np.array([3.0, 3.0]))).standard_deviation_px(PLACES)
    np.testing.assert_allclose(found, math.sqrt(3.0))
    assert np.isinf(ErrorModel(still[:1], check).standard_deviation_px(PLACES)).all()
