from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from speckled_pairs import radar_image, speckled, whole
from textured_pairs import texture

from groundtie.features.descriptors import LENGTH
from groundtie.features.keypoints import Keypoints
from groundtie.rasters.patch import Patch
from groundtie.studies.gradients import GRADIENTS
from groundtie.studies.matching import match
from groundtie.studies.sift_variants import SiftVariantDescriptor, sift_detector

_REAL = ("so-fields", "ss-ponds", "ss-yellow-b", "oo-lakes")


def by_opencv(image: NDArray[np.uint8], upright: bool) -> tuple[Keypoints, NDArray[np.float32]]:
    """Return OpenCV's features beyond the first octave, and its descriptors of unit length."""
    sift = cv2.SIFT.create()
    points = [point for point in sift.detect(image, None) if (point.octave & 0xFF) < 128]
    if upright:
        for point in points:
            point.angle = 0.0
    points, raw = sift.compute(image, points)
    # Its directions run from columns towards negative rows.
    theirs = raw.reshape(-1, 16, 8)[:, :, -np.arange(8) % 8].reshape(-1, LENGTH)
    found = Keypoints(
        np.array([point.pt for point in points]),
        np.array([point.size / 2 for point in points]),
        np.deg2rad([point.angle for point in points]),
        np.array([point.response for point in points]),
    )
    return found, theirs / np.linalg.norm(theirs, axis=1, keepdims=True)


def cosines(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    found, theirs = by_opencv(image, upright=True)
    valid = np.ones(image.shape, bool)
    points, ours = SiftVariantDescriptor().describe_image(image.astype(np.float32), valid, found)
    np.testing.assert_array_equal(points.position_px, found.position_px)
    return (ours * theirs).sum(axis=1)


@pytest.mark.parametrize("name", _REAL)
@pytest.mark.slow
def test_differences_give_opencv_s_descriptor_on_real_images(name: str, real_data: Path) -> None:
    path = next(
        p
        for p in sorted((real_data / name).iterdir())
        if p.suffix in (".png", ".jpg", ".bmp", ".tif", ".tiff")
    )
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)[:600, :600]
    assert np.median(cosines(np.ascontiguousarray(image))) > 0.98


def test_differences_give_opencv_s_descriptor() -> None:
    image = np.clip(radar_image(200, 220) / 5, 0, 255).astype(np.uint8)
    found = cosines(image)
    assert len(found) > 100
    assert np.median(found) > 0.98
    assert np.quantile(found, 0.05) > 0.9


def test_orientations_are_opencv_s() -> None:
    image = np.clip(radar_image(200, 220) / 5, 0, 255).astype(np.uint8)
    theirs, their_descriptors = by_opencv(image, upright=False)
    _, first = np.unique(theirs.position_px, axis=0, return_index=True)
    valid = np.ones(image.shape, bool)
    ours, descriptors = SiftVariantDescriptor(upright=False).describe_image(
        image.astype(np.float32), valid, theirs.take(first)
    )
    same = (ours.position_px[:, None] == theirs.position_px[None]).all(axis=2)
    off = np.angle(np.exp(1j * (ours.orientation_rad[:, None] - theirs.orientation_rad[None])))
    hit = same & (np.abs(off) < np.deg2rad(5))
    # Whether a lower peak counts may be a matter of a hair; a single one is not.
    single = (same.sum(axis=1) == 1) & (
        (ours.position_px[:, None] == ours.position_px).all(axis=2).sum(axis=1) == 1
    )
    assert single.sum() > 50
    assert hit[single].any(axis=1).mean() > 0.97
    one, other = np.nonzero(hit)
    assert np.median((descriptors[one] * their_descriptors[other]).sum(axis=1)) > 0.97


@pytest.mark.parametrize("estimator", GRADIENTS)
@pytest.mark.parametrize("upright", [True, False])
def test_a_shift_of_the_image_changes_no_descriptor(estimator: str, upright: bool) -> None:
    image = radar_image(260, 260)
    found = sift_detector("sift-oct").detect(whole(image[40:220, 40:220]))
    inner = found.take(np.abs(found.position_px - 90).max(axis=1) < 40)
    descriptor = SiftVariantDescriptor(estimator, upright)
    points, here = descriptor.describe(whole(image[40:220, 40:220]), inner)
    # By whole pixels of the octaves in use.
    shift = (8, 16)
    shifted = replace(inner, position_px=inner.position_px + shift)
    moved, there = descriptor.describe(whole(image[24:236, 32:240]), shifted)

    def key(of: Keypoints, by: tuple[int, int] = (0, 0)) -> NDArray[np.float64]:
        turn = of.orientation_rad
        return np.column_stack([of.position_px - by, np.cos(turn), np.sin(turn)])

    apart = np.abs(key(moved, shift)[:, None] - key(points)[None]).max(axis=2)
    one, other = np.nonzero(apart < 0.05)
    # Grey values are compressed by their median, which differs a little: a second orientation
    # may count here and not there.
    assert len(one) > 0.9 * max(len(points), len(moved)) > 20
    assert np.median((there[one] * here[other]).sum(axis=1)) > 0.99


@pytest.mark.parametrize("estimator", GRADIENTS)
def test_descriptors_are_of_unit_length_and_flat_ones_zero(estimator: str) -> None:
    window = whole(radar_image(150, 150))
    found = sift_detector("sift-oct").detect(window)
    _, rows = SiftVariantDescriptor(estimator).describe(window, found)
    assert rows.shape == (len(found), LENGTH) and rows.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, rtol=1e-5)
    assert rows.min() >= 0
    flat = Patch(np.ones((150, 150), np.float32), np.ones((150, 150), bool))
    _, nothing = SiftVariantDescriptor(estimator).describe(flat, found)
    np.testing.assert_allclose(nothing, 0, atol=1e-3)


def test_no_features_have_no_descriptors() -> None:
    points, rows = SiftVariantDescriptor().describe(whole(radar_image(60, 60)), Keypoints.none())
    assert len(points) == 0 and rows.shape == (0, LENGTH)


@pytest.mark.parametrize("estimator", GRADIENTS)
def test_masked_pixels_tell_nothing(estimator: str) -> None:
    image = radar_image(150, 150)
    valid = np.ones(image.shape, bool)
    valid[50:80, 60:90] = False
    found = sift_detector("sift-oct").detect(Patch(image, valid))
    _, seen = SiftVariantDescriptor(estimator).describe(Patch(image, valid), found)
    spoiled = np.where(valid, image, np.float32(1e5))
    _, still = SiftVariantDescriptor(estimator).describe(Patch(spoiled, valid), found)
    # Recursive filters reach far, but what they carry is less than rounding shows.
    np.testing.assert_allclose(still, seen, atol=1e-5)


def right_after_a_turn(estimator: str, quarter_turns: int) -> int:
    """Return how many matches are right between two speckled images, one of them turned."""
    scene = 300 * np.exp(0.6 * texture(300, 300, 4))
    one, other = (speckled(scene, 8.0, seed) for seed in (1, 2))
    turned = np.rot90(other, quarter_turns).copy()
    descriptor = SiftVariantDescriptor(estimator, upright=False)
    described = [
        descriptor.describe(whole(image), sift_detector("sift-oct").detect(whole(image)))
        for image in (one, turned)
    ]
    (points, rows), (turned_points, turned_rows) = described
    found = match(rows, turned_rows, 0.9, method="exact")
    x, y = points.take(found.first).position_px.T
    # Counter-clockwise: what lay right lies on top.
    expected = np.column_stack([y, 299 - x]) if quarter_turns else np.column_stack([x, y])
    off = turned_points.take(found.second).position_px - expected
    return int((np.hypot(*off.T) < 2).sum())


@pytest.mark.slow
def test_ratios_with_a_sign_survive_a_quarter_turn_and_those_without_do_not() -> None:
    kept = {
        name: right_after_a_turn(name, 1) / right_after_a_turn(name, 0)
        for name in ("roewa", "roewa-unsigned", "differences")
    }
    assert kept["roewa"] > 0.8
    assert kept["differences"] > 0.8
    assert kept["roewa-unsigned"] < 0.5


def test_ratios_of_decibels_are_those_of_amplitudes() -> None:
    image = radar_image(150, 150)
    found = sift_detector("sift-oct").detect(whole(image))
    descriptor = SiftVariantDescriptor("roewa")
    _, amplitudes = descriptor.describe(whole(image), found)
    _, decibels = descriptor.describe(whole(20 * np.log10(image / image.max())), found)
    assert np.median((amplitudes * decibels).sum(axis=1)) > 0.98
