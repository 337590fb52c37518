from __future__ import annotations

import numpy as np

from groundtie.search.support import support

RADIUS = 10


def peaks(surfaces: np.ndarray) -> np.ndarray:
    flat = surfaces.reshape(len(surfaces), -1).argmax(axis=1)
    rows, cols = np.unravel_index(flat, surfaces.shape[1:])
    return np.column_stack([cols, rows]) - surfaces.shape[1] // 2


def weak_surfaces(shifts: np.ndarray, height: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1]
    return np.array(
        [
            height * np.exp(-((x - dx) ** 2 + (y - dy) ** 2) / 3) + rng.normal(size=x.shape)
            for dx, dy in shifts
        ],
        np.float32,
    )


def test_neighbours_that_agree_lift_weak_peaks() -> None:
    cols, rows = np.meshgrid(np.arange(8) * 30, np.arange(8) * 30)
    centres = np.column_stack([cols.ravel(), rows.ravel()])
    shifts = np.column_stack([3 + cols.ravel() / 200, -2 - rows.ravel() / 200])
    surfaces = weak_surfaces(shifts, 3.0, 0)
    alone = np.abs(peaks(surfaces) - shifts).max(axis=1) <= 1
    supported = np.abs(peaks(support(surfaces, centres, 45.0)) - shifts).max(axis=1) <= 1
    assert alone.mean() < 0.8
    assert supported.mean() > 0.95


def test_places_beyond_reach_have_no_say() -> None:
    surfaces = weak_surfaces(np.array([[3, 3], [-4, 2], [5, -5.0]]), 9.0, 1)
    centres = np.array([[0, 0], [100, 0], [0, 100]])
    np.testing.assert_array_equal(peaks(support(surfaces, centres, 50.0)), peaks(surfaces))
    assert support(surfaces[:0], centres[:0], 50.0).shape == (0, 21, 21)


def test_support_does_not_depend_on_the_order_of_the_chips() -> None:
    centres = np.random.default_rng(0).integers(0, 200, (20, 2))
    surfaces = weak_surfaces(np.zeros((20, 2)), 3.0, 2)
    order = np.random.default_rng(1).permutation(20)
    found = support(surfaces, centres, 60.0)
    turned = support(surfaces[order], centres[order], 60.0)
    np.testing.assert_allclose(turned, found[order], atol=1e-4)
