from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RBFInterpolator

from groundtie.errors import TooFewPointsError
from groundtie.geometry.fitting import TPS_STIFFNESS, fit_model
from groundtie.geometry.models import DEGREE, KINDS, PARAMETERS, Frame, monomials

POLYNOMIALS = tuple(DEGREE)


def places(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 10_000, (count, 2)) + [500_000, 4_990_000]


def distort(kind: str, xy: np.ndarray, seed: int = 0) -> np.ndarray:
    """A distortion that the model can take up exactly."""
    rng = np.random.default_rng(seed)
    angle, scale = rng.uniform(-0.1, 0.1), rng.uniform(0.97, 1.03)
    centre = np.array([505_000, 4_995_000])
    shift = rng.uniform(-200, 200, 2)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    if kind == "translation":
        return xy + shift
    if kind == "rigid":
        return (xy - centre) @ turn + centre + shift
    if kind == "similarity":
        return scale * (xy - centre) @ turn + centre + shift
    uv = (xy - centre) / 5000
    degree = DEGREE[kind]
    terms = monomials(uv, degree)
    return xy + terms @ rng.uniform(-100, 100, (terms.shape[1], 2))


@pytest.mark.parametrize("kind", POLYNOMIALS)
@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_an_exact_distortion_is_recovered(kind: str, seed: int) -> None:
    xy, elsewhere = places(30, seed), places(30, seed + 1)
    model = fit_model(kind, xy, distort(kind, xy, seed))
    np.testing.assert_allclose(model(elsewhere), distort(kind, elsewhere, seed), atol=1e-3)


@pytest.mark.parametrize("kind", POLYNOMIALS)
def test_the_fewest_points_are_enough(kind: str) -> None:
    needed = -(-PARAMETERS[kind] // 2)
    # Fewer points than that leave a polynomial open.
    xy = places(needed, 3)
    model = fit_model(kind, xy, distort(kind, xy))
    np.testing.assert_allclose(model(xy), distort(kind, xy), atol=1e-4)
    with pytest.raises(
        TooFewPointsError, match=f"at least {needed} points; there are {needed - 1}"
    ):
        fit_model(kind, xy[:-1], xy[:-1])


def test_weights_of_zero_leave_points_out() -> None:
    xy = places(20)
    claimed = distort("affine", xy)
    claimed[:5] += 1000
    weights = np.r_[np.zeros(5), np.ones(15)]
    model = fit_model("affine", xy, claimed, weights)
    np.testing.assert_allclose(model(xy[5:]), claimed[5:], atol=1e-4)
    with pytest.raises(TooFewPointsError):
        fit_model("affine", xy, claimed, np.r_[1, 1, np.zeros(18)])


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "tps"])
def test_a_weight_counts_like_so_many_points(kind: str) -> None:
    rng = np.random.default_rng(1)
    xy = places(25)
    claimed = distort(kind, xy) + rng.normal(0, 5, xy.shape)
    weights = rng.integers(1, 4, len(xy)).astype(float)
    repeated = np.repeat(np.arange(len(xy)), weights.astype(int))
    one = fit_model(kind, xy, claimed, weights)
    other = fit_model(kind, xy[repeated], claimed[repeated])
    np.testing.assert_allclose(one(xy), other(xy), atol=1e-4)


def test_a_rigid_fit_has_no_scale_and_no_shear() -> None:
    xy = places(30)
    claimed = distort("similarity", xy, 5) + np.random.default_rng(0).normal(0, 20, xy.shape)
    for kind, scales in (("rigid", True), ("similarity", False)):
        moved = fit_model(kind, xy, claimed)(xy[:1] + [[0, 0], [1000, 0], [0, 1000]])
        along_x, along_y = moved[1] - moved[0], moved[2] - moved[0]
        assert along_x @ along_y == pytest.approx(0, abs=1e-2)
        assert np.hypot(*along_x) == pytest.approx(np.hypot(*along_y))
        assert (np.hypot(*along_x) == pytest.approx(1000, rel=1e-9)) == scales


def test_least_squares_agrees_with_numpy() -> None:
    rng = np.random.default_rng(2)
    xy = places(50)
    claimed = xy + rng.normal(0, 30, xy.shape)
    local = (xy - xy.mean(axis=0)) / 1000
    design = np.column_stack([np.ones(50), local])
    solution = np.linalg.lstsq(design, claimed - xy, rcond=None)[0]
    np.testing.assert_allclose(
        fit_model("affine", xy, claimed)(xy), xy + design @ solution, atol=1e-5
    )


def test_the_thin_plate_spline_agrees_with_scipy() -> None:
    rng = np.random.default_rng(3)
    xy = places(40)
    claimed = xy + 50 * np.sin((xy - [500_000, 4_990_000]) / 3000) + rng.normal(0, 5, xy.shape)
    uv = Frame.around(xy).enter(xy)
    # The kernel r² log r has the other sign for scipy's smoothing: both minimise the same energy.
    scipy_spline = RBFInterpolator(uv, claimed - xy, kernel="thin_plate_spline",
                                   smoothing=TPS_STIFFNESS)  # fmt: skip
    at = places(30, 9)
    expected = at + scipy_spline(Frame.around(xy).enter(at))
    np.testing.assert_allclose(fit_model("tps", xy, claimed)(at), expected, atol=1e-4)


def test_the_thin_plate_spline_weighs_residuals_against_bending() -> None:
    """A single outlier sways a smoothing spline less than an interpolating one: not all of it."""
    xy = places(60)
    claimed = xy.copy()
    claimed[0] += [100, 0]
    sway = fit_model("tps", xy, claimed)(xy[:1]) - xy[:1]
    assert 0 < sway[0, 0] < 100
    trusted = np.ones(60)
    trusted[0] = 100
    more = fit_model("tps", xy, claimed, trusted)(xy[:1]) - xy[:1]
    assert sway[0, 0] < more[0, 0] < 100


@pytest.mark.parametrize("kind", KINDS)
def test_large_coordinates_cost_no_accuracy(kind: str) -> None:
    xy = places(30)
    far = xy + [1e7, -1e7]
    near_fit = fit_model(kind, xy, distort("rigid", xy))
    far_fit = fit_model(kind, far, distort("rigid", xy) + [1e7, -1e7])
    np.testing.assert_allclose(far_fit(far) - [1e7, -1e7], near_fit(xy), atol=1e-4)
