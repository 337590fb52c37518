from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from groundtie.similarity.peak import find_peak, find_peak_near

RADIUS = 12
Y, X = np.mgrid[-RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1].astype(float)


def gaussian(x: float, y: float, sigma: float = 2.5, height: float = 10.0) -> np.ndarray:
    return height * np.exp(-((X - x) ** 2 + (Y - y) ** 2) / (2 * sigma**2))


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.3, -0.2), (-4.45, 3.1), (6.5, 6.49)])
def test_the_top_of_a_paraboloid_is_exact(place: tuple[float, float]) -> None:
    dx, dy = X - place[0], Y - place[1]
    surface = (9 - 0.4 * dx**2 - 0.2 * dx * dy - 0.3 * dy**2).astype(np.float32)
    found = find_peak(surface)
    assert found.shift_px == pytest.approx(place, abs=1e-4)
    assert not found.at_border
    assert found.height == surface.max()
    hessian = -np.array([[0.8, 0.2], [0.2, 0.6]])
    expected = np.linalg.inv(-hessian) / found.height
    np.testing.assert_allclose(found.covariance_px2, expected, rtol=1e-3)


@pytest.mark.parametrize("place", [(0.1, 0.25), (-3.4, 5.45), (2.75, -1.6)])
@pytest.mark.parametrize("sigma", [2.0, 3.0])
def test_smooth_peaks_are_found_to_a_fiftieth_of_a_pixel(
    place: tuple[float, float], sigma: float
) -> None:
    found = find_peak(gaussian(*place, sigma).astype(np.float32))
    assert found.shift_px == pytest.approx(place, abs=0.02)


def test_the_covariance_is_the_scatter_of_found_peaks() -> None:
    """Background of unit variance whose correlation has the shape of the peak."""
    rng = np.random.default_rng(0)
    sigma, height = 2.5, 12.0
    # Noise filtered by a Gaussian has a correlation that is √2 as wide.
    spectrum = sigma / np.sqrt(2)
    found, told = [], []
    for _ in range(600):
        noise = gaussian_filter(rng.normal(size=X.shape), spectrum, mode="wrap")
        # White noise filtered by g has the variance Σ g².
        noise *= 2 * np.sqrt(np.pi) * spectrum
        place = rng.uniform(-0.5, 0.5, 2)
        evidence = find_peak((gaussian(*place, sigma, height) + noise).astype(np.float32))
        found.append(np.subtract(evidence.shift_px, place))
        told.append(evidence.covariance_px2)
    scatter = np.cov(np.array(found).T)
    predicted = np.mean(told, axis=0)
    # In theory sigma / height = 0.21 px along each axis.
    np.testing.assert_allclose(np.sqrt(np.diag(predicted)), sigma / height, rtol=0.3)
    np.testing.assert_allclose(np.sqrt(np.diag(scatter)), np.sqrt(np.diag(predicted)), rtol=0.3)
    assert abs(scatter[0, 1]) < 0.2 * scatter[0, 0]


def test_a_ridge_is_uncertain_along_itself() -> None:
    ridge = 10 * np.exp(-((X - 1) ** 2) / 4 - (Y - 1) ** 2 / 60)
    covariance = find_peak(ridge.astype(np.float32)).covariance_px2
    assert covariance[1, 1] > 5 * covariance[0, 0]
    diagonal = 10 * np.exp(-((X - Y) ** 2) / 4 - (X + Y) ** 2 / 80)
    covariance = find_peak(diagonal.astype(np.float32)).covariance_px2
    assert covariance[0, 1] > 0.5 * covariance[0, 0]


@pytest.mark.parametrize("place", [(RADIUS, 0), (-RADIUS, 3), (2, RADIUS), (0, -RADIUS)])
def test_a_peak_at_the_border_may_be_none(place: tuple[int, int]) -> None:
    found = find_peak(gaussian(*place).astype(np.float32))
    assert found.at_border
    assert found.shift_px == place


@pytest.mark.parametrize("part", [np.s_[3:-3, :], np.s_[:, 4:-4]])
def test_the_middle_is_no_shift_whatever_the_shape(part: tuple[slice, slice]) -> None:
    found = find_peak(gaussian(3.3, 2.2)[part].astype(np.float32))
    assert found.shift_px == pytest.approx((3.3, 2.2), abs=0.02)
    # Anywhere in the window, along each axis: the variance of a uniform distribution.
    empty = np.zeros_like(X[part])
    expected = np.array(empty.shape[::-1]) ** 2 / 12
    np.testing.assert_allclose(np.diag(find_peak(empty).covariance_px2), expected, rtol=0.15)


def test_a_surface_without_peak() -> None:
    found = find_peak(np.zeros((9, 9), np.float32))
    assert found.at_border
    assert found.height == 0
    assert np.isfinite(found.covariance_px2).all()
    # Anywhere in the window: at least the variance of a uniform distribution over its width.
    assert found.covariance_px2[0, 0] >= 9**2 / 12 * 0.9


def test_a_flat_top_has_a_wide_covariance() -> None:
    surface = np.minimum(gaussian(0, 0, 4.0), 6.0).astype(np.float32)
    found = find_peak(surface)
    assert np.isfinite(found.shift_px).all()
    assert np.isfinite(found.covariance_px2).all()
    assert found.height == 6


@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_gives_finite_evidence(seed: int) -> None:
    surface = np.random.default_rng(seed).normal(size=(25, 25)).astype(np.float32)
    found = find_peak(surface)
    whole = np.round(found.shift_px) + RADIUS
    assert np.isfinite(found.covariance_px2).all()
    assert np.linalg.eigvalsh(found.covariance_px2).min() > 0
    top = np.unravel_index(surface.argmax(), surface.shape)
    assert np.abs(whole - [top[1], top[0]]).max() <= 1


def test_the_peak_near_what_is_expected_wins_over_a_higher_one() -> None:
    surface = (gaussian(-6.3, 2.2, 1.5, 8) + gaussian(5.2, -3.4, 1.5, 12)).astype(np.float32)
    assert find_peak(surface).shift_px == pytest.approx((5.2, -3.4), abs=0.05)
    near = find_peak_near(surface, (-5.4, 3.1), 3)
    assert near.shift_px == pytest.approx((-6.3, 2.2), abs=0.05)
    assert near.height == pytest.approx(8, abs=0.5)
    assert not near.at_border


@pytest.mark.parametrize("expected", [(0, 0), (2.6, -1.2), (-8.9, 8.9), (9, 9)])
def test_near_is_the_same_as_alone_where_the_peak_is_inside(expected: tuple[float, float]) -> None:
    place = np.clip(np.add(expected, 0.3), -9.4, 9.4)
    surface = gaussian(*place, 1.5).astype(np.float32)
    near, alone = find_peak_near(surface, expected, 3), find_peak(surface)
    assert near.shift_px == pytest.approx(alone.shift_px)
    np.testing.assert_allclose(near.covariance_px2, alone.covariance_px2)


def test_a_peak_farther_than_asked_for_is_at_the_border() -> None:
    surface = gaussian(5.0, 0.0, 2.0).astype(np.float32)
    assert find_peak_near(surface, (0, 0), 3).at_border
    assert not find_peak_near(surface, (3, 0), 3).at_border


@pytest.mark.parametrize("expected", [(20.0, 0.0), (-3.0, -10.0), (1e6, -1e6)])
def test_expectations_beyond_the_window_are_at_the_border(expected: tuple[float, float]) -> None:
    found = find_peak_near(gaussian(8, 0).astype(np.float32), expected, 3)
    assert found.at_border
    assert np.abs(found.shift_px).max() <= RADIUS
