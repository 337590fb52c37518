from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from speckled_pairs import whole
from textured_pairs import texture

from groundtie.features.keypoints import Keypoints
from groundtie.rasters.patch import Patch
from groundtie.studies.haar import LENGTH, HaarDescriptor

SIDE = 200


def points(*rows: tuple[float, float, float, float]) -> Keypoints:
    """Return features from columns, rows, scales and orientations."""
    table = np.array(rows, float)
    return Keypoints(table[:, :2], table[:, 2], table[:, 3], np.ones(len(table)))


def image(seed: int = 0) -> NDArray[np.float32]:
    # Half of it negative: taken as it is, on a logarithmic scale already.
    return texture(SIDE, SIDE, seed).astype(np.float32)


def directly(values: NDArray[np.float32], x: int, y: int, scale: int) -> NDArray[np.float64]:
    """Return the 64 values of an upright feature of whole scale, sum by sum."""
    found = []
    for cell_row in range(4):
        for cell_col in range(4):
            sums = np.zeros(4)
            for row in range(5):
                for col in range(5):
                    u, v = 5 * cell_col + col - 9.5, 5 * cell_row + row - 9.5
                    # Wavelets lie between pixels.
                    i, j = round(x + scale * u + 0.5), round(y + scale * v + 0.5)
                    box = values[j - scale : j + scale, i - scale : i + scale].astype(float)
                    dx = box[:, scale:].sum() - box[:, :scale].sum()
                    dy = box[scale:].sum() - box[:scale].sum()
                    weight = np.exp(-(u**2 + v**2) / (2 * 3.3**2)) / scale**2
                    sums += weight * np.array([dx, dy, abs(dx), abs(dy)])
            found.extend(sums)
    return np.array(found) / np.linalg.norm(found)


@pytest.mark.parametrize(("x", "y", "scale"), [(100, 90, 2), (81, 120, 4)])
def test_values_are_those_of_the_definition(x: int, y: int, scale: int) -> None:
    values = image()
    _, found = HaarDescriptor().describe(whole(values), points((x, y, scale, 0)))
    assert found.shape == (1, LENGTH)
    np.testing.assert_allclose(found[0], directly(values, x, y, scale), atol=1e-5)


def test_an_edge_points_to_its_brighter_side() -> None:
    values = np.where(np.arange(SIDE)[None] < 100, -1.0, 1.0) * np.ones((SIDE, 1))
    for quarter, angle in enumerate([0, -np.pi / 2, np.pi, np.pi / 2]):
        # Turned counter-clockwise on the screen, directions from columns to rows fall.
        turned = whole(np.rot90(values, quarter))
        found, _ = HaarDescriptor(upright=False).describe(turned, points((99.5, 99.5, 3, 0)))
        assert np.cos(found.orientation_rad[0] - angle) == pytest.approx(1, abs=1e-3)


def test_oriented_descriptors_do_not_mind_quarter_turns() -> None:
    values = image()
    spots = points((70, 90, 2, 0), (120, 101, 3, 0), (88, 60, 4, 0))
    describe = HaarDescriptor(upright=False).describe
    _, first = describe(whole(values), spots)
    turned = np.column_stack([spots.position_px[:, 1], SIDE - 1 - spots.position_px[:, 0]])
    _, second = describe(whole(np.rot90(values)), replace(spots, position_px=turned))
    assert (np.sum(first * second, axis=1) > 0.98).all()
    _, upright = HaarDescriptor().describe(whole(np.rot90(values)), spots)
    assert (np.sum(first * upright, axis=1) < 0.9).all()


def test_contrast_and_brightness_do_not_count() -> None:
    values = image()
    spots = points((70, 90, 2, 0), (120, 101, 3, 0))
    _, first = HaarDescriptor().describe(whole(values), spots)
    _, second = HaarDescriptor().describe(whole(5 * values - 2), spots)
    np.testing.assert_allclose(first, second, atol=1e-4)


def test_masked_pixels_tell_nothing() -> None:
    values, valid = image(), np.ones((SIDE, SIDE), bool)
    valid[:, 100:] = False
    spots = points((92, 90, 2, 0))
    one, other = (
        HaarDescriptor().describe(Patch(np.where(valid, values, fill), valid), spots)[1]
        for fill in (np.float32(-50), np.float32(80))
    )
    np.testing.assert_array_equal(one, other)
    assert np.abs(one).max() > 0


def test_no_features_have_no_descriptors() -> None:
    found, values = HaarDescriptor().describe(whole(image()), Keypoints.none())
    assert len(found) == 0
    assert values.shape == (0, LENGTH)
