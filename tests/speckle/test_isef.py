from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import convolve1d

from groundtie.speckle.isef import decay_for_window, isef


@pytest.mark.parametrize("decay", [0.3, 0.75, 0.9])
def test_it_is_the_convolution_with_the_exponential(decay: float) -> None:
    image = np.random.default_rng(0).normal(size=(90, 70)).astype(np.float32)
    reach = 400
    weights = decay ** np.abs(np.arange(-reach, reach + 1)) * (1 - decay) / (1 + decay)
    expected = convolve1d(image.astype(float), weights, axis=0, mode="nearest")
    expected = convolve1d(expected, weights, axis=1, mode="nearest")
    np.testing.assert_allclose(isef(image, decay), expected, atol=2e-6)


def test_a_constant_stays_and_no_decay_changes_nothing() -> None:
    image = np.random.default_rng(0).normal(size=(30, 40)).astype(np.float32)
    np.testing.assert_allclose(isef(image, 0.0), image, atol=1e-6)
    np.testing.assert_allclose(isef(np.full((30, 40), 7, np.float32), 0.8), 7, rtol=1e-6)


def test_the_image_itself_is_left_alone() -> None:
    image = np.random.default_rng(0).normal(size=(30, 40)).astype(np.float32)
    before = image.copy()
    isef(image, 0.5)
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("window", [3, 7, 15])
def test_a_window_is_that_of_the_mean_which_smooths_noise_as_much(window: int) -> None:
    noise = np.random.default_rng(0).normal(size=(600, 600)).astype(np.float32)
    inside = np.s_[60:-60, 60:-60]
    assert isef(noise, decay_for_window(window))[inside].var() == pytest.approx(
        1 / window**2, rel=0.05
    )
