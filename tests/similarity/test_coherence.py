"""Coherence of coarse and of fine structure, and noise that two radar images share."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.coherence import coherence, spectral_products
from groundtie.similarity.in_common import Look, Sameness, sameness_of
from groundtie.similarity.seams import step_products

FloatArray = NDArray[np.float64]
SIDE, WINDOWS = 96, 16


def patch(values: FloatArray, valid: NDArray[np.bool_] | None = None) -> Patch:
    known = np.ones(values.shape, bool) if valid is None else valid
    return Patch(values.astype(np.float32), known)


def white(rng: np.random.Generator) -> FloatArray:
    return rng.normal(size=(SIDE, SIDE))


@pytest.mark.parametrize("common", [0.0, 1.0, 3.0])
def test_white_noise_is_as_coherent_as_the_variance_it_shares(common: float) -> None:
    """Of arrays c + a and c + b with variances c², 1 and 1 it is c² / (c² + 1), in both bands."""
    rng = np.random.default_rng(0)
    products = []
    for _ in range(WINDOWS):
        shared = common * white(rng)
        one, other = (shared + white(rng) for _ in range(2))
        # Neither the gain nor the mean of an image matters.
        products.append(spectral_products(patch(one), patch(50 - 7 * -other)))
    expected = common**2 / (common**2 + 1)
    # The standard error of the real part is at most 1 / √(2 n): n is 50 or so in a coarse window.
    assert coherence(products) == pytest.approx([expected] * 2, abs=0.08)


def test_opposite_contrast_is_negative_coherence() -> None:
    one = patch(texture(SIDE, SIDE))
    products = spectral_products(one, patch(-texture(SIDE, SIDE)))
    assert coherence([products]) == pytest.approx([-1, -1])


@pytest.mark.parametrize(("side", "expected"), [(10, 1.0), (30, 0.0)])
def test_few_pixels_may_be_invalid_and_have_no_part(side: int, expected: float) -> None:
    """The outline of a mask, which both images have, would be coherent itself."""
    values = texture(SIDE, SIDE)
    spoilt = values.copy()
    hidden = np.s_[20 : 20 + side, 30 : 30 + side]
    spoilt[hidden] = 1e6
    valid = np.ones(values.shape, bool)
    valid[hidden] = False
    products = spectral_products(patch(values), patch(spoilt, valid))
    assert coherence([products]) == pytest.approx([expected] * 2, abs=1e-4)


def test_constant_windows_have_no_coherence() -> None:
    products = spectral_products(patch(np.full((SIDE, SIDE), 7.0)), patch(texture(SIDE, SIDE)))
    assert coherence([products]) == (0.0, 0.0)


def measured(same_ground: bool, noise: float, smooth_px: float) -> Sameness:
    """Measure two images with speckle, of one ground or two, with one pattern of noise in both."""
    rng, looks = np.random.default_rng(3), []
    for seed in range(WINDOWS):
        pattern = white(rng)
        if smooth_px:
            pattern = gaussian_filter(pattern, smooth_px)
        pattern *= noise / pattern.std()
        # Half of the variance of ground is coarse, half of it fine; see `texture`.
        ground = [texture(SIDE, SIDE, seed + (0 if same_ground else 100 * k)) for k in range(2)]
        looks.append([patch(one + pattern + 0.7 * white(rng)) for one in ground])
    steps = [step_products(*pair) for pair in looks]
    return sameness_of([Look.of(*pair) for pair in looks], steps)


@pytest.mark.parametrize("smooth_px", [0.0, 0.7, 1.3])
@pytest.mark.parametrize("noise", [0.6, 1.2])
def test_a_pattern_of_noise_over_other_ground_is_found(noise: float, smooth_px: float) -> None:
    assert measured(False, noise, smooth_px).is_noise


@pytest.mark.parametrize("noise", [0.0, 0.6])
def test_ground_is_no_noise(noise: float) -> None:
    """Nor is ground in both images beneath a pattern of noise: it is coherent itself."""
    assert not measured(True, noise, 1.0).is_noise


def test_other_ground_without_noise_is_no_noise() -> None:
    assert not measured(False, 0.0, 0.0).is_noise
