from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.stats import skew
from textured_pairs import texture

from groundtie.features.patch_statistics import STATISTICS, patch_statistics
from groundtie.rasters.patch import Patch

PX = np.array([[50.0, 40.0], [3.2, 70.1], [89.0, 0.0]])


def window() -> Patch:
    values = (np.exp(texture(80, 90)) * 50 + 20_000).astype(np.float32)
    valid = np.ones(values.shape, bool)
    valid[30:50, :35] = False
    return Patch(np.where(valid, values, np.float32(-9999)), valid)


def around(image: np.ndarray, of: Patch, x: float, y: float) -> np.ndarray:
    """Return the valid pixels of a patch of 41 × 41, cut at the border."""
    col, row = round(x), round(y)
    inside = slice(max(row - 20, 0), row + 21), slice(max(col - 20, 0), col + 21)
    return image[inside][of.valid[inside]].astype(float)


def test_mean_and_variance_are_those_of_the_valid_pixels() -> None:
    found = patch_statistics("mean-variance", window(), PX)
    for row, (x, y) in zip(found, PX, strict=True):
        pixels = around(window().values, window(), x, y)
        np.testing.assert_allclose(row, [pixels.mean(), pixels.var()], rtol=1e-6)


def test_texture_adds_skewness_and_what_is_fine() -> None:
    whole = Patch(window().values, np.ones((80, 90), bool))
    whole = Patch(np.where(window().valid, whole.values, np.float32(20_050)), whole.valid)
    found = patch_statistics("texture", whole, PX)
    values = whole.values.astype(float)
    fine = (values - cv2.blur(values, (5, 5))) ** 2
    for row, (x, y) in zip(found, PX, strict=True):
        pixels = around(values, whole, x, y)
        np.testing.assert_allclose(row[2], skew(pixels), rtol=1e-6)
        np.testing.assert_allclose(row[4], around(fine, whole, x, y).mean(), rtol=1e-6)
        assert 0 < row[3] < np.ptp(pixels)


def test_band_ratios_are_the_shares_of_the_bands_in_their_sum() -> None:
    of = window()
    bands = np.stack([of.values, 2 * of.values, 300 * (1 + texture(80, 90, 3) ** 2)])
    bands = bands.astype(np.float32)
    found = patch_statistics("band-ratios", of, PX, bands)
    np.testing.assert_allclose(found[:, :2], patch_statistics("mean-variance", of, PX))
    for row, (x, y) in zip(found, PX, strict=True):
        means = np.array([around(band, of, x, y).mean() for band in bands])
        np.testing.assert_allclose(row[2:], means / means.sum(), rtol=1e-5)


def test_bands_that_are_black_are_alike() -> None:
    bands = np.zeros((4, 80, 90), np.float32)
    found = patch_statistics("band-ratios", window(), PX, bands)
    np.testing.assert_array_equal(found[:, 2:], np.full((3, 4), 0.25))


@pytest.mark.parametrize("name", STATISTICS)
def test_nothing_has_no_statistics(name: str) -> None:
    bands = np.ones((3, 80, 90), np.float32)
    some = patch_statistics(name, window(), PX, bands)
    none = patch_statistics(name, window(), np.zeros((0, 2)), bands)
    assert none.shape == (0, some.shape[1])
    nothing = Patch(np.zeros((9, 9), np.float32), np.zeros((9, 9), bool))
    found = patch_statistics(name, nothing, np.zeros((3, 2)), bands[:, :9, :9])
    assert np.isfinite(found).all()


@pytest.mark.parametrize("name", sorted(STATISTICS))
def test_what_lies_farther_off_changes_nothing_beside_what_is_masked(name: str) -> None:
    values = np.random.default_rng(0).normal(100, 5, (120, 400)).astype(np.float32)
    values[:, 200:] += 300  # bright land
    valid = np.ones(values.shape, bool)
    valid[:, 60:75] = False
    found = [
        patch_statistics(
            name,
            Patch(values[:, :width], valid[:, :width]),
            np.array([[45.0, 60.0]]),
            values[None, :, :width],
        )
        for width in (120, 400)
    ]
    # Skewness loses digits with the grey value that all are centred on.
    np.testing.assert_allclose(*found, rtol=1e-4)
