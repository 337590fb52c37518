from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from speckled_pairs import radar_image, whole

from groundtie.features.detectors import SiftOctDetector, to_grey
from groundtie.features.keypoints import Keypoints
from groundtie.rasters.patch import Patch
from groundtie.studies.sift_variants import DETECTORS, sift_detector

FloatImage = NDArray[np.float32]


def blob(x: float, y: float, sigma: float, side: int = 160) -> Patch:
    """Return a dark Gaussian in decibels, which are not compressed any further."""
    rows, cols = np.mgrid[:side, :side]
    image = -10 - 5 * np.exp(-((cols - x) ** 2 + (rows - y) ** 2) / (2 * sigma**2))
    # Grey values are stretched between what the darkest and the brightest percent has.
    image[:4], image[-4:] = -16, -9
    return whole(image)


def octaves(found: Keypoints) -> NDArray[np.int_]:
    """Return the octaves of OpenCV's keypoints; -1: on the image at twice its size."""
    # The first of an octave's three layers has at least 2^(1/6) times its scale.
    return np.floor(np.log2(found.scale_px / 1.6) - 1 / 6 + 1e-6).astype(int)


def nearest(found: Keypoints, x: float, y: float) -> Keypoints:
    return found.take([int(np.argmin(np.hypot(*(found.position_px - [x, y]).T)))])


@pytest.mark.parametrize("name", DETECTORS)
@pytest.mark.parametrize("sigma", [3.0, 5.8, 12.0])
def test_a_blob_is_found_where_it_is(name: str, sigma: float) -> None:
    x, y = 81.3, 76.8
    found = nearest(sift_detector(name).detect(blob(x, y, sigma)), x, y)
    # Without the quarter of a pixel that OpenCV is off, half a one at half the size.
    np.testing.assert_allclose(found.position_px[0], [x, y], atol=0.12)


# What an image is smoothed by before OpenCV gets it, a Gaussian and the mean of two pixels, and
# what OpenCV believes instead: half a pixel of its own. Variances in pixels of the image.
_SMOOTHED = {"sift": (0.0, 0.5**2), "sift-oct": (1.6**2 + 0.5**2, 1.0**2)}


@pytest.mark.parametrize("name", _SMOOTHED)
@pytest.mark.parametrize("sigma", [4.0, 8.0, 12.0])
def test_scales_are_all_that_an_image_was_smoothed_by(name: str, sigma: float) -> None:
    found = nearest(sift_detector(name).detect(blob(80.3, 79.8, sigma)), 80.3, 79.8)
    # Gaussians of s and of 2^(1/3) s differ most on a blob of 2^(1/6) s.
    before, believed = _SMOOTHED[name]
    by_opencv = (sigma**2 + before - believed) / 2 ** (1 / 3)
    expected = np.sqrt(by_opencv + before - believed) if before else np.sqrt(by_opencv)
    np.testing.assert_allclose(found.scale_px[0], expected, rtol=0.03)


def test_smoothing_before_makes_scales_larger() -> None:
    scales = [
        nearest(sift_detector(name).detect(blob(80.3, 79.8, 6.0)), 80.3, 79.8).scale_px[0]
        for name in DETECTORS
    ]
    assert scales == sorted(scales)
    assert scales[-1] < 1.25 * scales[0]


def test_sift_is_opencv_s_without_its_repetitions_and_offset() -> None:
    window = whole(radar_image(150, 170))
    grey = to_grey(np.log(window.values / np.median(window.values) + np.float32(0.1)), window.valid)
    theirs = cv2.SIFT.create(0, 3, 0.04, 10.0, 1.6).detect(grey, None)
    expected = np.unique([(*k.pt, k.size) for k in theirs], axis=0)
    found = sift_detector("sift").detect(window)
    assert len(found) == len(expected) < len(theirs)
    np.testing.assert_allclose(found.position_px + 0.25, expected[:, :2])
    np.testing.assert_allclose(2 * found.scale_px, expected[:, 2])
    np.testing.assert_array_equal(np.unique(octaves(found))[:3], [-1, 0, 1])


@pytest.mark.slow
def test_without_the_first_octave_the_features_of_larger_ones_are_found() -> None:
    shares = []
    for seed in range(3):
        window = whole(radar_image(400, 400, speckle_seed=seed))
        by_opencv = sift_detector("sift", 0.04).detect(window)
        found = sift_detector("sift-oct", 0.02).detect(window)
        assert found.scale_px.min() > 1.6
        octave = octaves(by_opencv)
        assert (octave == -1).mean() > 0.6
        larger, first = octave >= 1, octave == -1
        shares.append([share_found(by_opencv.take(which), found) for which in (larger, first)])
    # Some appear and some vanish with what is rounded on the way.
    of_larger, of_first = np.mean(shares, axis=0)
    assert of_larger > 0.8
    assert of_first < 0.05


def share_found(of: Keypoints, found: Keypoints) -> float:
    apart = np.linalg.norm(of.position_px[:, None] - found.position_px[None], axis=2)
    growth = np.abs(np.log(of.scale_px[:, None] / found.scale_px[None]))
    return float(((apart < 0.3 * of.scale_px[:, None]) & (growth < 0.25)).any(axis=1).mean())


def test_features_of_two_images_with_other_speckle_are_the_same_beyond_the_first_octave() -> None:
    one, other = (
        sift_detector("sift-oct").detect(whole(radar_image(300, 300, speckle_seed=seed)))
        for seed in (1, 2)
    )
    apart = np.linalg.norm(one.position_px[:, None] - other.position_px[None], axis=2)
    chance = 1 - np.exp(-len(other) * np.pi * 1.5**2 / 300**2)
    assert (apart.min(axis=1) < 1.5).mean() > max(5 * chance, 0.35)


def test_brightness_and_contrast_of_amplitudes_change_nothing() -> None:
    image = radar_image(200, 200)
    found, brighter = (SiftOctDetector(0.075).detect(whole(image * gain)) for gain in (1.0, 7.0))
    # But for how quantiles are rounded.
    np.testing.assert_allclose(brighter.position_px, found.position_px, atol=0.02)


def test_nothing_is_found_near_masked_pixels_nor_told_by_them() -> None:
    image = radar_image(200, 200)
    valid = np.ones(image.shape, bool)
    valid[60:120, 80:150] = False
    found = SiftOctDetector(0.075).detect(Patch(image, valid))
    spoiled = SiftOctDetector(0.075).detect(Patch(np.where(valid, image, np.float32(9999)), valid))
    np.testing.assert_array_equal(found.position_px, spoiled.position_px)
    distance = np.maximum(np.abs(found.position_px - [114.5, 89.5]) - [34.5, 29.5], 0)
    assert len(found) > 50
    assert (np.hypot(*distance.T) > 2 * found.scale_px).all()


def test_a_lower_contrast_finds_more() -> None:
    window = whole(radar_image(200, 200))
    few, many = (sift_detector("sift-oct", contrast).detect(window) for contrast in (0.09, 0.03))
    assert len(few) < len(many)


@pytest.mark.parametrize("valid", [True, False])
def test_a_constant_or_masked_window_has_no_features(valid: bool) -> None:
    window = Patch(np.full((64, 64), 5, np.float32), np.full((64, 64), valid))
    assert len(SiftOctDetector(0.075).detect(window)) == 0


def test_the_strongest_are_kept_in_their_order() -> None:
    found = SiftOctDetector(0.075).detect(whole(radar_image(200, 200)))
    kept = found.strongest(10)
    assert len(kept) == 10
    assert kept.response.min() >= np.sort(found.response)[-10]
    rows = [np.nonzero((found.position_px == p).all(axis=1))[0][0] for p in kept.position_px]
    assert rows == sorted(rows)
    assert found.strongest(10**6) is found
