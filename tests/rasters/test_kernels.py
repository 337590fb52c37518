from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.ndimage import map_coordinates

from groundtie.rasters.kernels import REACH, bspline_weights, interpolate

KERNELS = tuple(method for method in REACH if method != "nearest")
fraction = st.floats(0, 1, exclude_max=True)


def impulse_response(method: str, s: float) -> np.ndarray:
    """Weights of the pixels 0 … 20 at the position 10 + s."""
    image = np.eye(21)
    return interpolate(image, np.stack([np.arange(21.0)[None], np.full((1, 21), 10 + s)]), method)[
        0
    ]


@given(method=st.sampled_from(KERNELS), s=fraction)
def test_weights_sum_up_to_one(method: str, s: float) -> None:
    assert impulse_response(method, s).sum() == pytest.approx(1, abs=1e-12)


@given(method=st.sampled_from(KERNELS), s=fraction)
def test_kernels_are_symmetric(method: str, s: float) -> None:
    mirrored = impulse_response(method, -s)
    np.testing.assert_allclose(impulse_response(method, s), mirrored[::-1], atol=1e-9)


@pytest.mark.parametrize("method", KERNELS)
def test_kernels_reach_as_far_as_they_say(method: str) -> None:
    touched = np.flatnonzero(np.abs(impulse_response(method, 0.3)) > 1e-12)
    assert touched.tolist() == list(range(11 - REACH[method], 11 + REACH[method]))


@pytest.mark.parametrize("method", KERNELS)
def test_at_pixels_there_is_nothing_between(method: str) -> None:
    np.testing.assert_allclose(impulse_response(method, 0.0), np.eye(21)[10], atol=1e-12)
    np.testing.assert_allclose(impulse_response(method, 1e-9), np.eye(21)[10], atol=1e-8)


def test_the_cubic_kernel_is_keys() -> None:
    # Keys 1981: -1/16, 9/16, 9/16, -1/16 half-way
    expected = np.array([-1, 9, 9, -1]) / 16
    np.testing.assert_allclose(impulse_response("cubic", 0.5)[9:13], expected)


def test_the_lanczos_kernel_is_a_windowed_sinc() -> None:
    t = 0.3 - np.arange(-3, 5)
    expected = np.sinc(t) * np.sinc(t / 4)
    np.testing.assert_allclose(impulse_response("lanczos", 0.3)[7:15], expected / expected.sum())


@pytest.mark.parametrize("positions", [np.float32, np.float64])
@pytest.mark.parametrize("method", KERNELS)
def test_far_outside_there_is_nothing(method: str, positions: type) -> None:
    px = np.array([[[-1e9, 1e9, 5, 5]], [[5, 5, -1e9, 1e9]]], positions)
    assert not interpolate(np.ones((10, 10), np.float32), px, method).any()


@pytest.mark.parametrize("positions", [np.float32, np.float64])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.complex64])
def test_bilinear_values_are_scipys(positions: type, dtype: type) -> None:
    """To 1e-4 pixels, the step of single precision there; beyond the borders all is 0."""
    random = np.random.default_rng(0)
    image = random.normal(size=(700, 900)).astype(dtype)
    px = random.uniform(-3, [[[903]], [[703]]], (2, 60, 500)).astype(positions)
    found = interpolate(image, px, "bilinear")
    padded = np.pad(image, 4)
    expected = map_coordinates(padded, px[::-1].astype(float) + 4, order=1, prefilter=False)
    assert found.dtype == dtype
    np.testing.assert_allclose(found, expected, atol=5e-4)


@pytest.mark.parametrize("dtype", [np.float32, np.complex64])
@pytest.mark.parametrize("method", KERNELS)
def test_bands_that_share_weights_are_what_each_is_alone(method: str, dtype: type) -> None:
    random = np.random.default_rng(1)
    bands = random.normal(size=(3, 90, 70)).astype(dtype)
    px = random.uniform(-3, [[[73]], [[93]]], (2, 200, 150)).astype(np.float32)
    alone = [interpolate(band, px, method) for band in bands]
    np.testing.assert_array_equal(interpolate(bands, px, method), np.stack(alone))


@pytest.mark.parametrize("order", [2, 3, 4, 7])
def test_bsplines_are_scipys(order: int) -> None:
    fraction = np.linspace(0, 1, 11)
    basis = BSpline.basis_element(np.arange(order + 1.0), extrapolate=False)
    place = np.arange(1, order + 1)[:, None] - fraction
    weights = bspline_weights(order, fraction)
    np.testing.assert_allclose(weights, np.nan_to_num(basis(place)), atol=1e-12)
    np.testing.assert_allclose(weights.sum(axis=0), 1)


@pytest.mark.parametrize("method", KERNELS)
@pytest.mark.parametrize("corner", [(3.25, 7.75), (-9.5, 31.125), (45.5, -4.25), (90.5, 3.5)])
def test_positions_side_by_side_have_the_values_that_they_have_alone(
    method: str, corner: tuple[float, float]
) -> None:
    image = np.random.default_rng(0).normal(size=(2, 50, 60)).astype(np.float32)
    rows, cols = np.mgrid[:40, :30].astype(np.float32)
    px = np.stack([cols + corner[0], rows + corner[1]]).astype(np.float32)
    # Transposed, they are no lattice whose rows are the image's.
    alone = interpolate(image, px.transpose(0, 2, 1), method).transpose(0, 2, 1)
    np.testing.assert_allclose(interpolate(image, px, method), alone, atol=2e-6)


def test_cubic_b_splines_sum_to_one_and_reproduce_a_ramp() -> None:
    t = np.linspace(0, 0.999, 50)
    weights = bspline_weights(4, t)
    np.testing.assert_allclose(weights.sum(axis=0), 1)
    np.testing.assert_allclose([-1, 0, 1, 2] @ weights, t, atol=1e-12)
