from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from groundtie.errors import TooFewPointsError
from groundtie.sensor.adjustment import Control, adjust
from groundtie.sensor.bias import KINDS, SHIFT, TERMS, Bias, design

SIZE = (6000, 5000)
COEFFICIENTS = np.array([[30.0, -12.0], [6.0, -5.0], [4.0, 7.0]])
LATTICE = np.stack(np.meshgrid(*(np.linspace(0, side, 9) for side in SIZE)), -1).reshape(-1, 2)


def truth(kind: str) -> Bias:
    terms = TERMS[kind]
    return Bias(kind, SIZE, COEFFICIENTS[:terms], np.zeros((2 * terms,) * 2))


def control(
    kind: str, count: int = 60, wrong: float = 0.0, noise_px: float = 0.4, seed: int = 0
) -> Control:
    """Return points that a bias moves, with covariances of their own, some moved at random."""
    random = np.random.default_rng(seed)
    px = random.uniform(0, 1, (count, 2)) * SIZE
    sigma = noise_px * random.uniform(0.5, 1.5, (count, 2))
    found = px + truth(kind)(px) + sigma * random.normal(size=px.shape)
    moved = random.permutation(count)[: round(wrong * count)]
    found[moved] += random.uniform(-100, 100, (len(moved), 2))
    covariance = np.zeros((count, 2, 2))
    covariance[:, [0, 1], [0, 1]] = sigma**2
    return Control(px, found, covariance, SIZE)


def error_px(bias: Bias, expected: Bias) -> float:
    return float(np.abs(bias(LATTICE) - expected(LATTICE)).max())


@pytest.mark.parametrize("kind", KINDS)
def test_auto_finds_the_model_and_its_parameters(kind: str) -> None:
    found = adjust(control(kind))
    assert found.bias.kind == kind
    assert error_px(found.bias, truth(kind)) < 0.4
    assert found.used.all()
    assert set(found.left_out_rmse_px) == set(KINDS)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(5))
def test_blunders_change_the_bias_by_little(kind: str, seed: int) -> None:
    clean = adjust(control(kind, 150, seed=seed), kind)
    spoilt = adjust(control(kind, 150, 0.3, seed=seed), kind)
    assert np.sqrt(np.mean((clean.bias(LATTICE) - spoilt.bias(LATTICE)) ** 2)) < 0.2
    assert 0.6 < spoilt.used.mean() < 0.75


def test_points_weigh_by_their_covariances() -> None:
    """Half of the points are as good as the other half is bad, and are biased the other way."""
    random = np.random.default_rng(0)
    px = random.uniform(0, 1, (80, 2)) * SIZE
    good = np.arange(80) % 2 == 0
    found = px + np.where(good[:, None], 1.0, 0.0)
    covariance = np.where(good, 0.01, 4.0)[:, None, None] * np.eye(2)
    bias = adjust(Control(px, found, covariance, SIZE), "shift").bias
    plain = adjust(Control(px, found, np.ones((80, 1, 1)) * np.eye(2), SIZE), "shift").bias
    assert bias.coefficients[0, 0] > 0.95
    assert abs(plain.coefficients[0, 0] - 0.5) < 0.05


def test_the_covariance_is_that_of_weighted_least_squares() -> None:
    points = control("affine", 40)
    found = adjust(points, "affine")
    terms = np.kron(design("affine", SIZE, points.expected_px), np.eye(2)).reshape(40, 2, 6)
    weights = np.linalg.inv(points.covariance_px2 + max(found.sigma_px, 1e-3) ** 2 * np.eye(2))
    normal = np.einsum("nai,nab,nbj->ij", terms, weights, terms)
    np.testing.assert_allclose(found.bias.covariance, np.linalg.inv(normal), rtol=1e-6, atol=1e-12)


@pytest.mark.slow
def test_estimates_scatter_as_their_covariance_says() -> None:
    drawn = [adjust(control("shift_drift", 50, seed=s), "shift_drift").bias for s in range(60)]
    scatter = np.std([b.coefficients for b in drawn], axis=0)
    told = np.sqrt(np.diag(drawn[0].covariance)).reshape(-1, 2)
    assert np.all((scatter / told > 0.6) & (scatter / told < 1.5))


@pytest.mark.parametrize(("kind", "count"), [("shift", 3), ("shift", 5), ("affine", 12)])
def test_few_points_tell_the_variance_of_all(kind: str, count: int) -> None:
    """Their covariances state nothing: the estimate of the variance must be unbiased."""
    noise_px, excess = 0.4, []
    for seed in range(200):
        points = control(kind, count)
        noise = np.random.default_rng(seed).normal(0, noise_px, (count, 2))
        points.found_px[:] = points.expected_px + noise
        points.covariance_px2[:] = np.eye(2) * 1e-8
        excess.append(adjust(points, kind).sigma_px ** 2)
    # The variance of n - terms free errors an axis; four standard deviations of its mean.
    free = 2 * (count - TERMS[kind]) * len(excess)
    assert np.mean(excess) == pytest.approx(noise_px**2, rel=4 * np.sqrt(2 / free))


@pytest.mark.parametrize("times", [0.05, 1.0, 5.0])
@pytest.mark.parametrize("kind", KINDS)
def test_the_model_does_not_depend_on_the_unit_of_covariances(kind: str, times: float) -> None:
    """Covariances may state too much or too little: left-out points show what is true."""
    points = control(kind)
    stated = replace(points, covariance_px2=times**2 * points.covariance_px2)
    assert adjust(stated).bias.kind == kind


@pytest.mark.parametrize("times", [1.0, 20.0])
@pytest.mark.slow
def test_noise_is_no_drift(times: float) -> None:
    found = []
    for seed in range(40):
        points = control("shift", seed=seed)
        stated = replace(points, covariance_px2=times**2 * points.covariance_px2)
        found.append(adjust(stated).bias.kind)
    assert found.count("shift") >= 36


@pytest.mark.parametrize("kind", KINDS[1:])
def test_points_in_a_corner_carry_no_more_than_a_shift(kind: str) -> None:
    points = control("shift", 30)
    packed = points.expected_px * 0.05
    moved = Control(
        packed, packed + (points.found_px - points.expected_px), points.covariance_px2, SIZE
    )
    assert adjust(moved).bias.kind == "shift"
    # Asked for, the model is fitted, and how badly it is held is told.
    held = adjust(moved, kind)
    assert held.bias.sigma_px(np.array([SIZE])).max() > 1


@pytest.mark.parametrize(("kind", "count"), [("shift", 2), ("shift_drift", 5), ("affine", 8)])
def test_a_model_needs_points(kind: str, count: int) -> None:
    with pytest.raises(TooFewPointsError, match=f"the model {kind} needs at least"):
        adjust(control(kind, count), kind)


def test_auto_does_not_give_few_points_many_parameters() -> None:
    assert adjust(control("affine", 5, noise_px=0.1), "auto").bias.kind == "shift"


def test_left_out_points_show_the_error_of_a_fit_without_them() -> None:
    points = control("affine", 40)
    found = adjust(points, "affine")
    fitted = points.residuals_px(found.bias)
    assert (found.left_out_px**2).sum() > (fitted**2).sum()
    assert found.left_out_rmse_px["affine"] == pytest.approx(0.4 * np.sqrt(2 * 13 / 12), rel=0.3)


def test_residuals_as_delivered_are_what_was_found() -> None:
    points = control("shift", noise_px=1e-6)
    np.testing.assert_allclose(points.residuals_px(None), [[30.0, -12.0]] * 60, atol=1e-4)
    assert len(points) == 60


@pytest.mark.parametrize("far_px", [0.0, 1e4, 1e8])
def test_one_point_anywhere_makes_no_other_agree(far_px: float) -> None:
    """As of coordinates that are swapped: beyond the image, it is as wrong as any."""
    kept = 0
    for seed in range(20):
        points = control(SHIFT, 12, noise_px=0.8, seed=seed)
        points.found_px[0] += [8.0, 0.0]
        points.found_px[1] += far_px
        kept += int(adjust(points, SHIFT).used[0])
    assert kept <= 2


def test_a_model_that_hangs_on_points_side_by_side_is_refused() -> None:
    """Seven of nine points lie in one corner: without them two are left."""
    random = np.random.default_rng(0)
    px = np.vstack([random.uniform(0, 100, (7, 2)), [[5900, 100], [3000, 4900]]])
    points = Control(px, px + truth("affine")(px), np.tile(np.eye(2) * 0.04, (9, 1, 1)), SIZE)
    with pytest.raises(TooFewPointsError, match="side by side"):
        adjust(points, "affine")
