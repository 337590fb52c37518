"""The adjustment against theory: values, covariances, gross errors, datum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, rayleigh
from series_dates import FRAME, link, shifted, star_and_chain

from groundtie.series.network import SCATTER_RANGE_PX, _Network, adjust

RNG = np.random.default_rng(5)
SIGMA = 0.1
LEAST = SCATTER_RANGE_PX[0]


def truth(count: int, linear_px: float = 0.0) -> np.ndarray:
    found = np.column_stack(
        [RNG.uniform(-15, 15, (count, 2)), RNG.uniform(-linear_px, linear_px, (count, 4))]
    )
    found[0] = 0.0
    return found


def test_links_without_error_give_the_truth_exactly() -> None:
    """Rotated and scaled, too: transforms are composed, not added."""
    true = truth(6, linear_px=3.0)
    links = [link(a, b, true, SIGMA) for a, b in star_and_chain(6)]
    found = adjust(FRAME, links, 6, 0, is_free=False)
    np.testing.assert_allclose(found.displacements, true, atol=1e-9)
    assert found.kept.all() and found.confirmed.all()


def test_the_covariance_of_a_chain_adds_up() -> None:
    true = truth(4)
    links = [link(a, a + 1, true, SIGMA) for a in range(3)]
    found = adjust(FRAME, links, 4, 0, is_free=False)
    each = SIGMA**2 + LEAST**2
    for date in range(4):
        np.testing.assert_allclose(found.covariances[date], date * each * np.eye(6), atol=1e-12)
    assert list(found.confirmed) == [False] * 4


def test_what_hangs_on_a_loop_by_one_link_is_not_confirmed() -> None:
    """The hub is no exception: what is confirmed, a loop leads to."""
    true = truth(5)
    links = [link(a, b, true, SIGMA) for a, b in ((0, 1), (1, 2), (0, 2), (2, 3), (3, 4))]
    confirmed = [adjust(FRAME, links, 5, hub, is_free=True).confirmed for hub in (0, 4)]
    assert [list(one) for one in confirmed] == [[True] * 3 + [False] * 2, [False] * 5]


def test_two_ways_of_one_length_halve_the_variance() -> None:
    true = truth(4)
    links = [link(a, b, true, SIGMA) for a, b in ((0, 1), (1, 3), (0, 2), (2, 3))]
    found = adjust(FRAME, links, 4, 0, is_free=False)
    np.testing.assert_allclose(found.covariances[3], (SIGMA**2 + LEAST**2) * np.eye(6), atol=1e-12)


@pytest.mark.slow
def test_the_stated_covariance_is_that_of_many_trials() -> None:
    """Links err by their covariance and the scatter; estimates do as their covariance has it."""
    true, ends, spread = truth(4), star_and_chain(4), np.hypot(SIGMA, LEAST)
    normalised = []
    for _ in range(40):
        links = [link(a, b, true, SIGMA, RNG.normal(0, spread, 6)) for a, b in ends]
        found = adjust(FRAME, links, 4, 0, is_free=False)
        if found.kept.all():
            error = found.displacements[3] - true[3]
            normalised.append(error @ np.linalg.solve(found.covariances[3], error))
    # The mean of χ² with six degrees of freedom is 6, its variance 12.
    assert np.mean(normalised) == pytest.approx(6.0, abs=4 * np.sqrt(12 / len(normalised)))


@pytest.mark.slow
def test_statistics_of_links_are_chi_squared() -> None:
    true, ends, spread = truth(8), star_and_chain(8), np.hypot(SIGMA, LEAST)
    found = []
    for _ in range(15):
        links = [link(a, b, true, SIGMA, RNG.normal(0, spread, 6)) for a, b in ends]
        network = _Network(FRAME, links, 8, 0)
        found.append(network.statistics(network.settled()))
    median = np.median(np.concatenate(found))
    assert median == pytest.approx(chi2.median(6), rel=0.2)


@pytest.mark.parametrize("wrong", [(0, 3), (3, 4), (0, 5)])
@pytest.mark.slow
def test_a_gross_error_is_found_and_does_no_harm(wrong: tuple[int, int]) -> None:
    true = truth(7)
    links = [
        link(a, b, true, 0.05, shifted(1.5, -1.0) if (a, b) == wrong else RNG.normal(0, 0.03, 6))
        for a, b in star_and_chain(7)
    ]
    found = adjust(FRAME, links, 7, 0, is_free=False)
    ends = [(one.first, one.second) for one in links]
    assert [end for end, kept in zip(ends, found.kept, strict=True) if not kept] == [wrong]
    assert np.abs(found.displacements - true)[:, :2].max() < 0.15


@pytest.mark.slow
def test_the_scatter_is_found_from_the_misclosures() -> None:
    true, scatter = truth(15), 0.15
    links = [link(a, b, true, 0.01, RNG.normal(0, scatter, 6)) for a, b in star_and_chain(15)]
    found = adjust(FRAME, links, 15, 0, is_free=False)
    assert found.scatter_px == pytest.approx(scatter, rel=0.35)


@pytest.mark.parametrize("affine", [0, 1, 3])
def test_shifts_have_two_degrees_of_freedom_beside_affine_links_too(affine: int) -> None:
    """Errors of the scatter alone, of the first links in six parameters, of the others in two."""
    scatter, ends, rng = 0.1, star_and_chain(12), np.random.default_rng(3)
    found, rejected = [], 0
    for _ in range(12):
        links = []
        for number, (a, b) in enumerate(ends):
            count = 6 if number < affine else 2
            error = np.pad(rng.normal(0, scatter, count), (0, 6 - count))
            sigma = np.repeat([0.01, 0.0], [count, 6 - count])
            links.append(link(a, b, np.zeros((12, 6)), sigma, error))
        adjusted = adjust(FRAME, links, 12, 0, is_free=False)
        found.append(adjusted.scatter_px)
        rejected += int((~adjusted.kept).sum())
    assert np.median(found) == pytest.approx(scatter, rel=0.2)
    # One in a thousand is expected, of 252.
    assert rejected <= 2


def test_a_shift_between_maps_is_one_of_two_parameters() -> None:
    """On another zone's map, which is rotated, it changes a little over the frame."""
    turned = np.array([1, 1, 1e-3, 0, 0, 1e-3])
    assert link(0, 1, np.zeros((2, 6)), 0.1 * turned).degrees_of_freedom == 2
    assert link(0, 1, np.zeros((2, 6)), 0.1).degrees_of_freedom == 6


def test_dates_are_imprecise_if_two_of_them_may_be_further_apart_than_the_goal() -> None:
    """More than 0.3 px by 1 in 1000, of Rayleigh's distribution: each axis has both variances."""
    true, limit = np.zeros((2, 6)), 0.3 / rayleigh.isf(1e-3) / np.sqrt(2)
    # Of an axis, over the frame: a shift, and two terms that grow over ±1.
    variance = limit**2 / (1 + 1 / 3 + 1 / 3) - LEAST**2
    for factor, expected in ((0.95, False), (1.05, True)):
        found = adjust(FRAME, [link(0, 1, true, factor * variance**0.5)], 2, 0, is_free=False)
        assert list(found.imprecise) == [False, expected]


def test_without_a_reference_the_mean_is_zero() -> None:
    true = truth(5)
    links = [link(a, b, true, SIGMA) for a, b in star_and_chain(5)]
    found = adjust(FRAME, links, 5, 0, is_free=True)
    np.testing.assert_allclose(found.displacements.mean(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(found.displacements - found.displacements[0], true, atol=1e-9)
    # No date is without error now, and all together have less than from the hub.
    fixed = adjust(FRAME, links, 5, 0, is_free=False)
    assert found.covariances[0, 0, 0] > 0
    assert found.covariances[:, 0, 0].sum() < fixed.covariances[:, 0, 0].sum()


def test_what_is_not_connected_is_not_placed() -> None:
    true = truth(5)
    links = [link(a, b, true, SIGMA) for a, b in ((0, 1), (1, 2), (0, 2), (3, 4))]
    found = adjust(FRAME, links, 5, 0, is_free=False)
    assert list(found.reached) == [True, True, True, False, False]
    assert list(found.kept) == [True, True, True, False]


def test_no_link_at_all() -> None:
    found = adjust(FRAME, [], 2, 0, is_free=False)
    assert list(found.reached) == [True, False]
