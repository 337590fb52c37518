from __future__ import annotations

import pytest
from speckled_pairs import radar_image, whole

from groundtie.features.detectors import SiftDetector, SiftOctDetector
from groundtie.features.presets import optical_keypoints, sar_keypoints
from groundtie.features.tiles import Describing, Detecting


def test_radar_images_are_looked_at_without_the_octave_of_their_speckle() -> None:
    assert sar_keypoints()[0] == SiftOctDetector(0.03)
    assert optical_keypoints()[0] == SiftDetector(0.03)


@pytest.mark.parametrize(("preset", "length"), [(sar_keypoints(), 128), (optical_keypoints(), 81)])
def test_presets_find_and_describe(preset: tuple[Detecting, Describing], length: int) -> None:
    detector, descriptor = preset
    window = whole(radar_image(150, 150))
    points, rows = descriptor.describe(window, detector.detect(window))
    assert rows.shape == (len(points), length) and len(points) > 100
