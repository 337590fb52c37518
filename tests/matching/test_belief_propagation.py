from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from groundtie.matching.belief_propagation import propagate
from groundtie.similarity.peak import find_peak
from groundtie.similarity.surface import normalise

RADIUS = 10
SPACING = 30
REACH = 1.5 * SPACING


def peaks(surfaces: np.ndarray) -> np.ndarray:
    flat = surfaces.reshape(len(surfaces), -1).argmax(axis=1)
    rows, cols = np.unravel_index(flat, surfaces.shape[1:])
    return np.column_stack([cols, rows]) - surfaces.shape[1] // 2


def surfaces_peaking_at(shifts: np.ndarray, heights: object, seed: int) -> np.ndarray:
    """Return white noise of unit variance with a peak of a given height at each shift (x, y)."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1]
    dx, dy = (np.asarray(shifts, float)[:, k, None, None] for k in (0, 1))
    height = np.broadcast_to(np.asarray(heights, float), len(shifts))[:, None, None]
    peak = height * np.exp(-((x - dx) ** 2 + (y - dy) ** 2) / 3)
    return (peak + rng.normal(size=peak.shape)).astype(np.float32)


def lattice(columns: int, rows: int) -> np.ndarray:
    cols, rows_ = np.meshgrid(np.arange(columns), np.arange(rows))
    return SPACING * np.column_stack([cols.ravel(), rows_.ravel()])


def smooth_shifts(centres: np.ndarray) -> np.ndarray:
    """Return shifts that vary by up to 1.3 px from chip to chip and by 5 px in total."""
    x, y = centres.T * 2 * np.pi / (12 * SPACING)
    return 2.5 * np.column_stack([np.sin(x + 0.3) * np.cos(0.7 * y), np.cos(x) * np.sin(0.8 * y)])


def near_truth(surfaces: np.ndarray, shifts: np.ndarray, within: float = 1.5) -> np.ndarray:
    return np.hypot(*(peaks(surfaces) - shifts).T) <= within


def test_neighbours_that_agree_lift_weak_peaks() -> None:
    centres = lattice(8, 8)
    shifts = np.column_stack([3 + centres[:, 0] / 200, -2 - centres[:, 1] / 200])
    surfaces = surfaces_peaking_at(shifts, 3.0, 0)
    alone, propagated = (
        np.array([find_peak(surface).shift_px for surface in found]) - shifts
        for found in (surfaces, propagate(surfaces, centres, REACH))
    )
    assert np.sqrt(np.mean(alone**2)) > 1.5
    assert np.sqrt(np.mean(propagated**2)) < 0.5


@pytest.mark.parametrize("seed", range(3))
def test_outliers_in_a_smooth_field_are_recovered(seed: int) -> None:
    centres = lattice(12, 12)
    shifts = smooth_shifts(centres)
    rng = np.random.default_rng(seed)
    drawn = shifts.copy()
    outliers = rng.permutation(len(centres))[:40]
    drawn[outliers] = rng.uniform(-RADIUS, RADIUS, (40, 2))
    surfaces = surfaces_peaking_at(drawn, 5.0, seed)
    found = propagate(surfaces, centres, REACH)
    assert near_truth(surfaces, shifts)[outliers].mean() < 0.2
    assert near_truth(found, shifts, 3.0)[outliers].mean() > 0.95
    others = np.setdiff1d(np.arange(len(centres)), outliers)
    assert near_truth(found, shifts)[others].mean() > 0.98


def test_distortion_of_a_few_chips_is_not_smoothed_away() -> None:
    centres = lattice(11, 11)
    from_middle = np.hypot(*(centres - centres.mean(axis=0)).T) / SPACING
    # A dome five chips wide whose middle is displaced by 4 px against its surroundings.
    dome = 4 * np.exp(-0.5 * (from_middle / 1.7) ** 2)
    shifts = np.column_stack([dome, -0.5 * dome])
    surfaces = surfaces_peaking_at(shifts, 6.0, 4)
    alone, propagated = (
        np.array([find_peak(surface).shift_px for surface in found]) - shifts
        for found in (surfaces, propagate(surfaces, centres, REACH))
    )
    assert np.hypot(*propagated.T).mean() < np.hypot(*alone.T).mean()
    # At least four fifths of the dome remain.
    assert np.hypot(*propagated[from_middle < 1.5].mean(axis=0)) < 0.2 * dome.max()


def test_a_step_between_two_areas_stays_where_it_is() -> None:
    centres = lattice(10, 8)
    shifts = np.where(centres[:, :1] < 5 * SPACING, [[-6.0, 2.0]], [[5.0, -3.0]])
    surfaces = surfaces_peaking_at(shifts, 7.0, 5)
    assert near_truth(propagate(surfaces, centres, REACH), shifts).all()


def test_evidence_reaches_along_lines_of_chips() -> None:
    # Arranged like chips of the fit: on lines between held-out blocks, most with two neighbours.
    everywhere = lattice(13, 13)
    cols, rows = (everywhere // SPACING).T
    centres = everywhere[(cols % 4 == 0) | (rows % 4 == 0)]
    shifts = smooth_shifts(centres)
    heights = np.where(np.random.default_rng(6).random(len(centres)) < 0.4, 0.0, 4.5)
    surfaces = surfaces_peaking_at(shifts, heights, 6)
    found = near_truth(propagate(surfaces, centres, REACH), shifts, 3.0)
    assert near_truth(surfaces, shifts, 3.0).mean() < 0.75
    assert found.mean() > 0.93


def test_no_message_crosses_gaps() -> None:
    left, far = lattice(4, 4), lattice(4, 4) + [7 * SPACING, 0]
    shifts = np.repeat([[4.0, 4.0], [-5.0, 1.0]], 16, axis=0)
    surfaces = surfaces_peaking_at(shifts, 3.5, 7)
    together = propagate(surfaces, np.concatenate([left, far]), REACH)
    np.testing.assert_allclose(together[:16], propagate(surfaces[:16], left, REACH), atol=1e-3)
    np.testing.assert_allclose(together[16:], propagate(surfaces[16:], far, REACH), atol=1e-3)


def test_chips_without_neighbours_keep_their_surface() -> None:
    surfaces = surfaces_peaking_at(np.array([[3, 3], [-4, 2], [5, -5], [5, -4]]), 9.0, 1)
    apart = np.array([[0, 0], [100, 0], [0, 100]])
    np.testing.assert_array_equal(propagate(surfaces[:3], apart, 50.0), surfaces[:3])
    beside = np.array([[0, 0], [100, 0], [0, 100], [20, 100]])
    found = propagate(surfaces, beside, 50.0)
    np.testing.assert_array_equal(found[:2], surfaces[:2])
    assert (found[2:] != surfaces[2:]).any()
    assert propagate(surfaces[:0], apart[:0], 50.0).shape == (0, 21, 21)


def test_flat_surfaces_send_nothing_and_receive() -> None:
    centres = lattice(5, 1)
    shifts = np.tile([[2.0, -3.0]], (5, 1))
    surfaces = surfaces_peaking_at(shifts, 12.0, 8)
    surfaces[2] = 0
    found = propagate(surfaces, centres, REACH)
    assert near_truth(found, shifts).all()
    flat = np.zeros_like(surfaces)
    received = propagate(flat, centres, REACH)
    # The border cannot be reached from all sides; nothing else distinguishes the shifts.
    assert np.isfinite(received).all()
    np.testing.assert_allclose(received, received[:, ::-1, ::-1], atol=1e-4)


def test_two_chips_agree_with_bayes_rule() -> None:
    surfaces = surfaces_peaking_at(np.array([[1, 0], [2, -1]]), 3.0, 9)
    found = propagate(surfaces, np.array([[0, 0], [SPACING, 0]]), REACH)
    # Sum-product is exact on a tree: the sum over all pairs of shifts, weighted by the prior.
    likely = np.exp(surfaces.astype(float)).reshape(2, -1)
    evidence = 0.7 + 0.3 * likely / likely.mean(axis=1, keepdims=True)
    axis = np.arange(-RADIUS, RADIUS + 1.0)
    near = norm.pdf(axis[:, None], axis, 2.0)
    related = np.einsum("ij,kl->ikjl", near, near).reshape(axis.size**2, -1)
    joint = 0.9 * related + 0.1 / axis.size**2
    marginal = evidence[0] * (joint @ evidence[1])
    difference = found[0].ravel() - np.log(marginal)
    # Equal up to a constant, as the density replaces the sum over shifts.
    np.testing.assert_allclose(difference - difference.mean(), 0, atol=2e-3)


def test_beliefs_do_not_depend_on_the_order_of_the_chips() -> None:
    centres = np.random.default_rng(0).integers(0, 200, (20, 2))
    surfaces = surfaces_peaking_at(np.zeros((20, 2)), 3.0, 2)
    order = np.random.default_rng(1).permutation(20)
    found = propagate(surfaces, centres, 60.0)
    np.testing.assert_allclose(
        propagate(surfaces[order], centres[order], 60.0), found[order], atol=1e-3
    )


@pytest.mark.slow
def test_many_neighbours_do_not_overflow() -> None:
    centres = np.random.default_rng(3).integers(0, 40, (60, 2))
    shifts = np.tile([[-3.0, 6.0]], (60, 1))
    surfaces = surfaces_peaking_at(shifts, 40.0, 3)
    found = propagate(surfaces, centres, 60.0)
    assert np.isfinite(found).all()
    assert near_truth(found, shifts).all()


def test_surfaces_are_normalised_one_by_one() -> None:
    surfaces = surfaces_peaking_at(np.zeros((4, 2)), 0.0, 10)
    scaled = surfaces * np.array([1, 5, 0.2, 3], np.float32)[:, None, None] + 7
    normalised = normalise(scaled)
    np.testing.assert_allclose(np.median(normalised, axis=(1, 2)), 0, atol=1e-5)
    np.testing.assert_allclose(normalised.std(axis=(1, 2)), 1, atol=0.15)
    assert normalise(scaled[:0]).shape == (0, 21, 21)
