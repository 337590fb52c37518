from __future__ import annotations

import numpy as np
from speckled_pairs import radar_image, whole

from groundtie.features.descriptors import LENGTH, SiftDescriptor
from groundtie.features.detectors import SiftOctDetector
from groundtie.features.keypoints import Keypoints
from groundtie.rasters.patch import Patch
from groundtie.studies.sift_variants import SiftVariantDescriptor


def test_the_descriptor_is_the_variant_of_differences_that_keeps_upright() -> None:
    """What OpenCV's descriptor is compared with, and what masks and shifts are tested on."""
    window = whole(radar_image(150, 150))
    found = SiftOctDetector().detect(window)
    points, rows = SiftDescriptor().describe(window, found)
    _, expected = SiftVariantDescriptor("differences", upright=True).describe(window, found)
    np.testing.assert_array_equal(rows, expected)
    np.testing.assert_array_equal(points.position_px, found.position_px)


def test_descriptors_are_of_unit_length_and_flat_ones_zero() -> None:
    window = whole(radar_image(150, 150))
    found = SiftOctDetector().detect(window)
    _, rows = SiftDescriptor().describe(window, found)
    assert rows.shape == (len(found), LENGTH) and rows.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, rtol=1e-5)
    flat = Patch(np.ones((150, 150), np.float32), np.ones((150, 150), bool))
    np.testing.assert_allclose(SiftDescriptor().describe(flat, found)[1], 0, atol=1e-3)


def test_no_keypoints_have_no_descriptors() -> None:
    points, rows = SiftDescriptor().describe(whole(radar_image(60, 60)), Keypoints.none())
    assert len(points) == 0 and rows.shape == (0, LENGTH)
