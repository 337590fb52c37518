from __future__ import annotations

import numpy as np
import pytest
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.local_contrast import without_bright, without_dark

SIDE = 160


def shadowed() -> tuple[np.ndarray, np.ndarray]:
    """Return ground beneath dark squares of 6 px, which cover a ninth, and the squares."""
    rows, cols = np.indices((SIDE, SIDE))
    dark = (rows % 18 < 6) & (cols % 18 < 6)
    return np.where(dark, 300.0, 1000 + 40 * texture(SIDE, SIDE)), dark


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (1e-3, 0.0), (2.0, 1e6)])
def test_shadows_are_masked_and_their_neighbours(gain: float, offset: float) -> None:
    values, dark = shadowed()
    seen = Patch((gain * values + offset).astype(np.float32), np.ones(dark.shape, bool))
    left = without_dark(seen).valid
    around = dark.copy()
    for axis in (0, 1):
        around |= np.roll(around, 1, axis) | np.roll(around, -1, axis)
    inner = np.s_[20:-20, 20:-20]
    np.testing.assert_array_equal(left[inner], ~around[inner])
    # Bright is what is dark in the negative.
    negative = Patch((-gain * values + offset).astype(np.float32), seen.valid)
    np.testing.assert_array_equal(without_bright(negative).valid, left)


def test_masked_pixels_stay_masked_and_are_no_measure_of_brightness() -> None:
    values, dark = shadowed()
    valid = np.indices(dark.shape)[1] < SIDE // 2
    whole = without_dark(Patch(values.astype(np.float32), valid)).valid
    filled = np.where(valid, values, 1e5).astype(np.float32)
    np.testing.assert_array_equal(without_dark(Patch(filled, valid)).valid, whole)
    assert not whole[~valid].any() and whole[valid].mean() > 0.5


def test_of_an_image_without_contrast_nothing_is_masked() -> None:
    plain = Patch(np.full((SIDE, SIDE), 3000.1, np.float32), np.ones((SIDE, SIDE), bool))
    assert without_dark(plain).all_valid
