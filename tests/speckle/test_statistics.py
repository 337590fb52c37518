from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import generic_filter

from groundtie.speckle.statistics import (
    estimate_looks,
    homogeneous_variation2,
    local_statistics,
    window_counts,
)


def speckled(power: np.ndarray, looks: float, seed: int = 0) -> np.ndarray:
    """Return a power image under gamma-distributed speckle of so many looks."""
    speckle = np.random.default_rng(seed).gamma(looks, 1 / looks, power.shape)
    return (power * speckle).astype(np.float32)


def test_mean_and_variation_are_those_of_the_window() -> None:
    image = speckled(np.full((24, 31), 7.0), 2.0)
    local = local_statistics(image, np.ones(image.shape, bool), 5)
    inside = np.s_[2:-2, 2:-2]
    mean = generic_filter(image.astype(float), np.mean, 5)[inside]
    variance = generic_filter(image.astype(float), np.var, 5)[inside]
    np.testing.assert_allclose(local.mean[inside], mean, rtol=1e-5)
    np.testing.assert_allclose(local.variation2[inside], variance / mean**2, rtol=1e-4)


def test_invalid_pixels_and_what_lies_beyond_do_not_count() -> None:
    image = speckled(np.full((20, 20), 3.0), 1.0)
    valid = np.random.default_rng(1).random(image.shape) < 0.6
    local = local_statistics(np.where(valid, image, 0).astype(np.float32), valid, 5)
    for row, col in ((0, 0), (3, 19), (10, 10)):
        window = np.s_[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3]
        values = image[window][valid[window]].astype(float)
        assert local.mean[row, col] == pytest.approx(values.mean(), rel=1e-5)
        assert local.variation2[row, col] == pytest.approx(
            values.var() / values.mean() ** 2, rel=1e-4
        )
        assert window_counts(valid, 5)[row, col] == values.size


def test_counts_of_a_full_image_are_those_of_any_other() -> None:
    full = np.ones((9, 13), bool)
    with_hole = full.copy()
    with_hole[8, 12] = False
    difference = window_counts(full, 5) - window_counts(with_hole, 5)
    expected = np.zeros(full.shape)
    expected[6:, 10:] = 1
    np.testing.assert_array_equal(difference, expected)


@pytest.mark.parametrize("grey_value", [0.0, 17.0, 255.0])
def test_a_frame_has_no_part_in_how_homogeneous_windows_vary(grey_value: float) -> None:
    image = speckled(np.full((200, 200), 900.0), 4.0)
    everywhere = np.ones(image.shape, bool)
    alone = homogeneous_variation2(image[40:-40, 40:-40], everywhere[40:-40, 40:-40])
    framed = np.full(image.shape, grey_value**2, np.float32)
    framed[40:-40, 40:-40] = image[40:-40, 40:-40]
    # Windows that hold its rim vary more: few of them.
    assert homogeneous_variation2(framed, everywhere) == pytest.approx(alone, rel=0.05)
    assert homogeneous_variation2(np.full_like(framed, 5.0), everywhere) == 0


def test_values_of_16_bits_squared_keep_their_precision() -> None:
    image = speckled(np.full((60, 60), 6e4**2), 4.0)
    local = local_statistics(image, np.ones(image.shape, bool), 7)
    values = image[27:34, 27:34].astype(float)
    assert local.variation2[30, 30] == pytest.approx(values.var() / values.mean() ** 2, rel=1e-3)


@pytest.mark.parametrize("looks", [1.0, 2.7, 9.0, 40.0])
def test_looks_of_a_scene_with_edges_are_those_of_its_speckle(looks: float) -> None:
    power = np.ones((400, 500))
    power[:, 250:] = 6.0
    power[120:260] *= 3.0
    # A quarter of the scene is no homogeneous area at all.
    texture = np.random.default_rng(5).lognormal(0, 1, (200, 250))
    power[200:, 250:] *= texture
    image = speckled(power, looks)
    assert estimate_looks(image, np.ones(image.shape, bool)) == pytest.approx(looks, rel=0.06)


def test_looks_are_estimated_from_valid_pixels_alone() -> None:
    image = speckled(np.ones((200, 200)), 4.0)
    valid = np.ones(image.shape, bool)
    valid[:, :90] = False
    image[:, :90] = 0
    assert estimate_looks(image, valid) == pytest.approx(4.0, rel=0.08)
    assert estimate_looks(image, np.zeros_like(valid)) == 1.0
    assert estimate_looks(np.ones_like(image), np.ones_like(valid)) == 1.0
