from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from textured_pairs import texture

from groundtie.context import threads
from groundtie.studies.box_hessian import determinants, integral_image, sigma_of
from groundtie.studies.surf import octave_sides

FloatImage = NDArray[np.float32]
HEIGHT, WIDTH = 61, 83


def image() -> FloatImage:
    return (texture(HEIGHT, WIDTH) * 20 + 1000).astype(np.float32)


def kernels(side: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the boxes of the second derivative along columns and of the mixed one, as drawn."""
    lobe, centre = side // 3, side // 2
    second, mixed = np.zeros((side, side)), np.zeros((side, side))
    across = slice(centre - lobe + 1, centre + lobe)
    second[across, :lobe] = second[across, -lobe:] = 1
    second[across, lobe:-lobe] = -2
    before, after = slice(centre - lobe, centre), slice(centre + 1, centre + lobe + 1)
    mixed[before, before] = mixed[after, after] = 1
    mixed[before, after] = mixed[after, before] = -1
    return second, mixed


def by_convolution(values: FloatImage, side: int) -> NDArray[np.float64]:
    second, mixed = kernels(side)
    along_cols, along_rows, both = (
        cv2.filter2D(values.astype(float), -1, kernel, borderType=cv2.BORDER_CONSTANT)
        for kernel in (second, second.T, mixed)
    )
    found = (along_cols * along_rows - (0.9 * both) ** 2) / side**4
    half = side // 2
    inside = np.zeros_like(found)
    inside[half:-half, half:-half] = found[half:-half, half:-half]
    return inside


@pytest.mark.parametrize("step", [1, 2, 4])
@pytest.mark.parametrize("side", [9, 15, 21, 27, 51])
def test_responses_are_those_of_the_kernels(side: int, step: int) -> None:
    values = image()
    found = determinants(integral_image(values), (side,), step)[0]
    expected = by_convolution(values, side)[::step, ::step]
    assert found.shape == expected.shape
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(found, expected, atol=2e-6 * np.abs(expected).max())


def test_filters_larger_than_the_image_see_nothing() -> None:
    found = determinants(integral_image(image()), (75,), 2)[0]
    assert not found.any()


def test_threads_change_nothing() -> None:
    integral = integral_image((texture(300, 600) * 20).astype(np.float32))
    with threads(2) as context:
        several = determinants(integral, (9, 15), 1, context)
    for one, other in zip(determinants(integral, (9, 15)), several, strict=True):
        np.testing.assert_array_equal(one, other)


def test_filters_are_those_of_the_paper() -> None:
    # [Bay2008] figure 7.
    assert [octave_sides(octave) for octave in range(4)] == [
        (9, 15, 21, 27),
        (15, 27, 39, 51),
        (27, 51, 75, 99),
        (51, 99, 147, 195),
    ]
    assert sigma_of(np.array([9.0, 27.0])).tolist() == pytest.approx([1.2, 3.6])
