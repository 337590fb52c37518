from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from speckled_pairs import whole
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.orientation import (
    SCALES_PX,
    compress,
    edge_strength,
    orientation_fields,
    squared_gradients,
)

SHAPE = (90, 100)
INNER = (slice(12, -12), slice(12, -12))


def field_of(values: np.ndarray, scale: float = 1.5) -> np.ndarray:
    patch = whole(values)
    return squared_gradients(patch.values, patch.valid, (scale,))[0]


@pytest.mark.parametrize("scale", SCALES_PX)
def test_the_field_is_the_squared_gradient_made_alike(scale: float) -> None:
    """(gx + i gy)² / |g| / (|g| + median |g|), with scipy's Gaussian derivatives."""
    image = texture(*SHAPE)
    derivative = {"sigma": scale, "mode": "reflect", "truncate": 6.0}
    gx = gaussian_filter(image, order=(0, 1), **derivative)
    gy = gaussian_filter(image, order=(1, 0), **derivative)
    size = np.hypot(gx, gy)
    expected = (gx + 1j * gy) ** 2 / size / (size + np.median(size))
    found = field_of(image, scale)
    close = np.abs(found - expected)[INNER] < 0.02
    # scipy's discrete derivative differs where the gradient vanishes, and at fine scales.
    assert close.mean() > (0.98 if scale > 1 else 0.9)


@pytest.mark.parametrize("scale", SCALES_PX)
def test_contrast_brightness_and_inversion_do_not_matter(scale: float) -> None:
    image = texture(*SHAPE)
    expected = field_of(image, scale)
    for changed in (-image, 5 * image, image + 30):
        np.testing.assert_allclose(field_of(changed, scale), expected, atol=2e-3)


@pytest.mark.parametrize("degrees", [10, 30, 45, 80, 90, 135])
def test_a_rotation_turns_the_field_twice_as_far(degrees: float) -> None:
    """Waves along one direction: the field of rotated waves is the same times e^(2 i θ)."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    angle = np.deg2rad(degrees)
    along = x * np.cos(angle) + y * np.sin(angle)
    # The direction is well defined where the slope of the waves is steep.
    steep = np.abs(np.cos(2 * np.pi * along / 17)) > 0.3
    turned = field_of(np.sin(2 * np.pi * along / 17))[INNER][steep[INNER]]
    np.testing.assert_allclose(np.angle(turned * np.exp(-2j * angle)), 0, atol=0.02)


def test_a_turned_image_has_the_turned_field() -> None:
    image = texture(91, 91)
    matrix = cv2.getRotationMatrix2D((45, 45), -20, 1)
    turned = cv2.warpAffine(image, matrix, (91, 91), flags=cv2.INTER_CUBIC)
    field = field_of(image, 2.0)
    parts = [cv2.warpAffine(part.copy(), matrix, (91, 91)) for part in (field.real, field.imag)]
    expected = (parts[0] + 1j * parts[1]) * np.exp(2j * np.deg2rad(20))
    inside = np.hypot(*(np.mgrid[:91, :91] - 45)) < 32
    found = field_of(turned, 2.0)[inside]
    agreement = np.vdot(expected[inside], found)
    size = np.linalg.norm(expected[inside]) * np.linalg.norm(found)
    assert agreement.real / size > 0.97


def test_the_field_is_bounded_and_of_steep_and_gentle_edges_alike() -> None:
    image = np.zeros(SHAPE)
    image[:, 30:] += 1.0
    image[:, 60:] += 100.0
    noise = 0.02 * np.random.default_rng(0).normal(size=SHAPE)
    field = np.abs(field_of(image + noise))
    assert field.max() <= 1 + 1e-6
    assert field[20:70, 29:31].mean() > 0.8
    assert field[20:70, 59:61].mean() > 0.8


@pytest.mark.parametrize("scale", SCALES_PX)
def test_masked_pixels_leave_no_edges(scale: float) -> None:
    image = texture(*SHAPE)
    valid = np.ones(SHAPE, bool)
    valid[40:60, 30:50] = False
    dug = np.where(valid, image, -50).astype(np.float32)
    masked = squared_gradients(dug, valid, (scale,))[0]
    reach = int(np.ceil(3 * scale))
    around = cv2.dilate((~valid).astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0
    assert not masked[around].any()
    assert np.isfinite(masked).all()
    # The typical gradient, estimated from fewer pixels, is nearly the same.
    far = cv2.dilate((~valid).astype(np.uint8), np.ones((25, 25), np.uint8)) == 0
    np.testing.assert_allclose(masked[far], field_of(image, scale)[far], atol=0.05)


def test_an_image_without_content_has_no_field() -> None:
    for value in (0.0, 7.0, 1e4):
        fields = orientation_fields(whole(np.full(SHAPE, value)))
        assert len(fields) == len(SCALES_PX)
        for field in fields:
            assert not field.any()


@pytest.mark.parametrize(("background", "level"), [(0.0, 100), (1.0, 100), (200.0, 100), (0, -60)])
def test_a_background_without_any_detail_does_no_harm(background: float, level: float) -> None:
    """More than half of the window is a lake or undeclared nodata; also in decibels."""
    image = np.full(SHAPE, background)
    image[:, 60:] = level + 15 * texture(SHAPE[0], SHAPE[1] - 60)
    for field in orientation_fields(whole(image)):
        assert np.isfinite(field).all()
        assert np.abs(field).max() <= 1 + 1e-6
        assert not field[:, :40].any()
        assert np.abs(field[20:70, 72:88]).mean() > 0.3


def test_a_window_without_valid_pixels() -> None:
    patch = Patch(np.zeros(SHAPE, np.float32), np.zeros(SHAPE, bool))
    for field in orientation_fields(patch):
        assert not field.any()


def test_amplitudes_are_compressed_and_decibels_left_alone() -> None:
    rng = np.random.default_rng(0)
    amplitude = rng.rayleigh(100, SHAPE)
    decibels = 20 * np.log10(amplitude) - 50
    assert (decibels < 0).mean() > 0.5
    found = compress(whole(decibels))
    np.testing.assert_allclose(found, decibels.astype(np.float32))
    bright = amplitude > np.median(amplitude)
    expected = np.log(amplitude / np.median(amplitude) + 0.1)
    np.testing.assert_allclose(compress(whole(amplitude))[bright], expected[bright], atol=1e-5)
    # A gain adds a constant to the logarithm, here none, as it is relative to the median.
    scaled = compress(whole(amplitude * 37))
    np.testing.assert_allclose(scaled, compress(whole(amplitude)), atol=1e-4)


def test_a_few_negative_values_are_taken_for_overshoot() -> None:
    values = np.full(SHAPE, 100.0)
    values[0, :5] = -3
    found = compress(whole(values))
    assert np.isfinite(found).all()
    assert found[0, 0] == pytest.approx(np.log(0.1))
    assert found[5, 5] == pytest.approx(np.log(1.1))


@pytest.mark.parametrize("level", [-20.0, 80.0])
def test_masked_pixels_do_not_stand_out(level: float) -> None:
    values = level + np.random.default_rng(0).normal(0, 3, SHAPE)
    valid = np.random.default_rng(1).random(SHAPE) < 0.8
    found = compress(Patch(np.where(valid, values, 0).astype(np.float32), valid))
    assert found[valid].min() < found[~valid].min() == found[~valid].max() < found[valid].max()


def test_the_same_image_has_the_same_field_to_the_last_digit() -> None:
    """For every memory layout, as the same seed must give the same registration."""
    image = texture(73, 73)
    blocks, found = [], set()
    for size in range(1, 60):
        blocks.append(np.empty(size * 37, np.uint8))
        found.add(field_of(image.copy()).tobytes())
    assert len(found) == 1


def test_edge_strength_is_the_soft_size_of_the_gradient() -> None:
    """|g| / (|g| + median |g|), with scipy's Gaussian derivatives."""
    image = texture(*SHAPE)
    derivative = {"sigma": SCALES_PX[0], "mode": "reflect", "truncate": 6.0}
    size = np.hypot(*(gaussian_filter(image, order=o, **derivative) for o in ((0, 1), (1, 0))))
    valid = np.ones(SHAPE, bool)
    found = edge_strength(field_of(image, SCALES_PX[0]), valid)
    assert found.all_valid
    close = np.abs(found.values - size / (size + np.median(size)))[INNER] < 0.03
    assert close.mean() > 0.9


def test_edge_strength_near_masked_pixels_does_not_count() -> None:
    image = texture(*SHAPE).astype(np.float32)
    valid = np.ones(SHAPE, bool)
    valid[40:60, 30:50] = False
    field = squared_gradients(image, valid, SCALES_PX[:1])[0]
    found = edge_strength(field, valid)
    reach = int(np.ceil(3 * SCALES_PX[0]))
    around = cv2.dilate((~valid).astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0
    np.testing.assert_array_equal(found.valid, ~around)
