from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import convolve1d
from speckled_pairs import radar_image, speckled

from groundtie.speckle.isef import isef_along
from groundtie.studies.gradients import (
    GRADIENTS,
    average_after,
    average_before,
    gradient_operator,
    needs_positive,
)

SIGNED = tuple(name for name in GRADIENTS if name != "roewa-unsigned")


@pytest.mark.parametrize("name", SIGNED)
def test_a_quarter_turn_of_the_image_turns_the_gradient(name: str) -> None:
    image = radar_image(60, 80)
    along_cols, along_rows = gradient_operator(name)(image)
    turned_cols, turned_rows = gradient_operator(name)(np.rot90(image).copy())
    # Turned counter-clockwise, what rose to the right rises upwards, what rose downwards, right.
    np.testing.assert_allclose(turned_rows, -np.rot90(along_cols), rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(turned_cols, np.rot90(along_rows), rtol=1e-3, atol=1e-3)


def test_without_a_sign_directions_fill_a_quarter_only() -> None:
    along_cols, along_rows = gradient_operator("roewa-unsigned")(radar_image(60, 80))
    assert along_cols.min() >= 0 and along_rows.min() >= 0
    signed_cols, signed_rows = gradient_operator("roewa")(radar_image(60, 80))
    np.testing.assert_array_equal(along_cols, np.abs(signed_cols))
    directions = np.arctan2(signed_rows, signed_cols)
    assert np.histogram(directions, 4, (-np.pi, np.pi))[0].min() > 0.2 * directions.size


@pytest.mark.parametrize("name", ["differences", "recursive"])
def test_a_ramp_has_its_slope(name: str) -> None:
    ramp = np.add.outer(3.0 * np.arange(40), 5.0 * np.arange(60)).astype(np.float32)
    along_cols, along_rows = (field[15:-15, 15:-15] for field in gradient_operator(name)(ramp))
    # Simple differences reach over two pixels.
    span = 2 if name == "differences" else 1
    np.testing.assert_allclose(along_cols, 5.0 * span, rtol=1e-3)
    np.testing.assert_allclose(along_rows, 3.0 * span, rtol=1e-3)


def test_recursive_differences_are_deriche_s_filters() -> None:
    image = np.random.default_rng(0).normal(size=(40, 50)).astype(np.float32)
    x = np.arange(-20, 21)
    smooth = (np.abs(x) + 1) * np.exp(-np.abs(x))
    smooth /= smooth.sum()
    slope = x * np.exp(-np.abs(x))
    slope /= (x * slope).sum()
    expected = convolve1d(
        convolve1d(image, smooth, 0, mode="nearest"), slope[::-1], 1, mode="nearest"
    )
    np.testing.assert_allclose(gradient_operator("recursive")(image)[0], expected, atol=1e-4)


def test_the_ratio_of_a_step_is_its_logarithm() -> None:
    image = np.full((40, 60), 10, np.float32)
    image[:, 30:] = 40
    along_cols, along_rows = gradient_operator("roewa")(image)
    # Far averages see one side of the step alone, but for their tails.
    assert np.abs(along_cols).max() == pytest.approx(np.log(4), rel=0.1)
    assert along_cols[20, 30] > 0
    np.testing.assert_allclose(along_rows, 0, atol=1e-4)


def test_ratios_are_as_noisy_in_bright_as_in_dark_areas() -> None:
    image = np.full((100, 200), 10.0)
    image[:, 100:] = 1000.0
    image = speckled(image, 4.0, 3)
    dark, bright = np.s_[:, 10:90], np.s_[:, 110:190]
    ratios, differences = (gradient_operator(name)(image)[1] for name in ("roewa", "differences"))
    assert ratios[bright].std() == pytest.approx(ratios[dark].std(), rel=0.1)
    assert differences[bright].std() > 50 * differences[dark].std()


@pytest.mark.parametrize("axis", [0, 1])
def test_one_sided_averages_weigh_exponentially(axis: int) -> None:
    image = np.random.default_rng(1).normal(5, 1, size=(40, 50)).astype(np.float32)
    weights = 0.4 * 0.6 ** np.arange(60)
    padded = np.zeros(121)
    padded[60:120] = weights
    for found, kernel in (
        (average_before(image, 0.6, axis), padded),
        (average_after(image, 0.6, axis), padded[::-1]),
    ):
        np.testing.assert_allclose(
            found, convolve1d(image, kernel, axis, mode="nearest"), rtol=1e-4
        )


@pytest.mark.parametrize("axis", [0, 1])
def test_smoothing_is_symmetric_and_of_unit_sum(axis: int) -> None:
    image = np.random.default_rng(1).normal(5, 1, size=(40, 50)).astype(np.float32)
    weights = 0.5 ** np.abs(np.arange(-40, 41))
    expected = convolve1d(image, weights / weights.sum(), axis, mode="nearest")
    np.testing.assert_allclose(isef_along(image, 0.5, axis), expected, rtol=1e-4)


def test_only_ratios_need_positive_values() -> None:
    assert {name for name in GRADIENTS if needs_positive(name)} == {"roewa", "roewa-unsigned"}
