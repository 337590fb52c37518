from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from speckled_pairs import whole
from textured_pairs import texture

from groundtie.features.hog import HogDescriptor
from groundtie.features.keypoints import Keypoints
from groundtie.rasters.patch import Patch
from groundtie.studies.scaled_hog import ScaledHogDescriptor

SIDE = 200


def points(*rows: tuple[float, float, float, float]) -> Keypoints:
    """Return features from columns, rows, scales and orientations."""
    table = np.array(rows, float)
    return Keypoints(table[:, :2], table[:, 2], table[:, 3], np.ones(len(table)))


def image(seed: int = 0) -> NDArray[np.float32]:
    # Half of it negative: taken as it is, on a logarithmic scale already.
    return texture(SIDE, SIDE, seed).astype(np.float32)


def test_inverted_contrast_does_not_count() -> None:
    spots = points((70, 90, 2, 0), (120, 101, 3, 0))
    _, first = ScaledHogDescriptor().describe(whole(image()), spots)
    _, second = ScaledHogDescriptor().describe(whole(1 - 4 * image()), spots)
    np.testing.assert_allclose(first, second, atol=1e-4)


def test_another_place_is_another_descriptor() -> None:
    _, found = ScaledHogDescriptor().describe(
        whole(image()), points((70, 90, 2, 0), (120, 101, 2, 0))
    )
    assert found[0] @ found[1] < 0.95
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, rtol=1e-5)


def test_scaled_patches_grow_with_the_feature() -> None:
    values = image()
    large = cv2.resize(values, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    spots, twice = points((70, 90, 3, 0)), points((140.5, 180.5, 6, 0))
    for descriptor, alike in ((ScaledHogDescriptor(), True), (HogDescriptor(), False)):
        _, first = descriptor.describe(whole(values), spots)
        _, second = descriptor.describe(whole(large), twice)
        assert bool(first[0] @ second[0] > 0.98) == alike


def test_oriented_descriptors_do_not_mind_quarter_turns() -> None:
    values = image()
    spots = points((70, 90, 2, 0), (120, 101, 3, 0))
    first, one = ScaledHogDescriptor(upright=False).describe(whole(values), spots)
    turned = np.column_stack([spots.position_px[:, 1], SIDE - 1 - spots.position_px[:, 0]])
    second, other = ScaledHogDescriptor(upright=False).describe(
        whole(np.rot90(values)), replace(spots, position_px=turned)
    )
    assert len(first) == len(second)
    # Features with several orientations come in the order of these, which begins elsewhere.
    assert (np.max(one @ other.T, axis=1) > 0.999).all()


def test_masked_pixels_tell_nothing() -> None:
    values, valid = image(), np.ones((SIDE, SIDE), bool)
    valid[:, 100:] = False
    spots = points((92, 90, 2, 0))
    one, other = (
        ScaledHogDescriptor().describe(Patch(np.where(valid, values, fill), valid), spots)[1]
        for fill in (np.float32(-50), np.float32(80))
    )
    np.testing.assert_array_equal(one, other)
    assert np.abs(one).max() > 0


def test_no_features_have_no_descriptors() -> None:
    found, values = ScaledHogDescriptor(7).describe(whole(image()), Keypoints.none())
    assert len(found) == 0
    assert values.shape == (0, 63)
