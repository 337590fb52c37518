from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from speckled_pairs import whole
from textured_pairs import texture

from groundtie.features import hog
from groundtie.features.hog import HogDescriptor
from groundtie.features.keypoints import Keypoints
from groundtie.rasters.patch import Patch

SIDE = 200


def points(*rows: tuple[float, float, float, float]) -> Keypoints:
    """Return features from columns, rows, scales and orientations."""
    table = np.array(rows, float)
    return Keypoints(table[:, :2], table[:, 2], table[:, 3], np.ones(len(table)))


def image(seed: int = 0) -> NDArray[np.float32]:
    # Half of it negative: taken as it is, on a logarithmic scale already.
    return texture(SIDE, SIDE, seed).astype(np.float32)


def directly(values: NDArray[np.float32], x: int, y: int, directions: int) -> NDArray[np.float64]:
    """Return the values of an upright patch of 41 × 41 pixels, sample by sample."""
    # The image is blurred by half a pixel as it is, and wanted at a scale of 2.
    wanted = 1.6 * 2 ** (1 / 3)
    level = cv2.GaussianBlur(values, (0, 0), np.sqrt(1.6**2 - 0.5**2))
    level = cv2.GaussianBlur(level, (0, 0), np.sqrt(wanted**2 - 1.6**2)).astype(float)
    histogram = np.zeros((3, 3, directions))
    for row in range(41):
        for col in range(41):
            i, j = x + col - 20, y + row - 20
            gx, gy = level[j, i + 1] - level[j, i - 1], level[j + 1, i] - level[j - 1, i]
            strength, angle = np.hypot(gx, gy), np.arctan2(gy, gx) % np.pi
            for cell_row in range(3):
                for cell_col in range(3):
                    down = 1 - abs((row + 0.5) * 3 / 41 - 0.5 - cell_row)
                    right = 1 - abs((col + 0.5) * 3 / 41 - 0.5 - cell_col)
                    share = max(down, 0) * max(right, 0)
                    for number in range(directions):
                        away = abs(angle * directions / np.pi - number)
                        near = max(1 - min(away, directions - away), 0)
                        histogram[cell_row, cell_col, number] += strength * share * near
    return histogram.ravel() / np.linalg.norm(histogram)


@pytest.mark.parametrize("directions", [9, 7])
@pytest.mark.slow
def test_values_are_those_of_the_definition(directions: int) -> None:
    values = image()
    descriptor = HogDescriptor(directions)
    _, found = descriptor.describe(whole(values), points((101, 87, 5.0, 0)))
    assert found.shape == (1, {9: 81, 7: 63}[directions])
    np.testing.assert_allclose(found[0], directly(values, 101, 87, directions), atol=1e-4)


def test_patches_of_one_size_lie_on_whole_pixels() -> None:
    values = image()
    _, found = HogDescriptor().describe(whole(values), points((101.4, 86.6, 5.0, 0)))
    np.testing.assert_allclose(found[0], directly(values, 101, 87, 9), atol=1e-4)


@pytest.mark.slow
def test_it_does_not_matter_in_which_band_of_rows_a_feature_lies() -> None:
    values = image()
    border = hog._BAND_ROWS
    rows = (border + 1, 40, border, border - 1, SIDE - 30)
    spots = points(*((60 + 10 * k, row, 2.0, 0) for k, row in enumerate(rows)))
    _, found = HogDescriptor().describe(whole(values), spots)
    for k, row in enumerate(rows):
        np.testing.assert_allclose(found[k], directly(values, 60 + 10 * k, row, 9), atol=1e-4)


def test_beyond_the_image_there_is_nothing() -> None:
    """At a corner, three quarters of the patch see no pixel."""
    _, found = HogDescriptor().describe(whole(image()), points((0, 0, 2, 0)))
    cells = found.reshape(3, 3, 9)
    assert np.abs(cells[:1]).max() == np.abs(cells[:, :1]).max() == 0
    assert np.linalg.norm(cells[1:, 1:]) == pytest.approx(1, abs=1e-5)


def test_inverted_contrast_does_not_count() -> None:
    spots = points((70, 90, 2, 0), (120, 101, 3, 0))
    _, first = HogDescriptor().describe(whole(image()), spots)
    _, second = HogDescriptor().describe(whole(1 - 4 * image()), spots)
    np.testing.assert_allclose(first, second, atol=1e-4)


def test_masked_pixels_tell_nothing() -> None:
    values, valid = image(), np.ones((SIDE, SIDE), bool)
    valid[:, 100:] = False
    spots = points((92, 90, 2, 0))
    one, other = (
        HogDescriptor().describe(Patch(np.where(valid, values, fill), valid), spots)[1]
        for fill in (np.float32(-50), np.float32(80))
    )
    np.testing.assert_array_equal(one, other)
    assert np.abs(one).max() > 0


def test_no_features_have_no_descriptors() -> None:
    found, values = HogDescriptor(7).describe(whole(image()), Keypoints.none())
    assert len(found) == 0
    assert values.shape == (0, 63)
