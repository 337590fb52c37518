from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from speckled_pairs import whole
from textured_pairs import texture

from groundtie.features.detectors import SiftDetector
from groundtie.features.keypoints import Keypoints
from groundtie.rasters.patch import Patch
from groundtie.studies.repeatability import repeatability
from groundtie.studies.surf import SurfDetector

FloatArray = NDArray[np.float64]

SIDE = 300


def blob(x: float, y: float, sigma: float, sign: float = 1.0) -> NDArray[np.float32]:
    rows, cols = np.mgrid[:160, :160]
    around = np.exp(-((cols - x) ** 2 + (rows - y) ** 2) / (2 * sigma**2))
    return (0.5 + sign * 0.4 * around).astype(np.float32)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("sigma", [3.0, 4.0, 6.5])
def test_a_blob_is_found_where_it_is(sigma: float, sign: float) -> None:
    best = SurfDetector().detect_image(blob(81.3, 76.8, sigma, sign)).strongest(1)
    np.testing.assert_allclose(best.position_px[0], [81.3, 76.8], atol=0.25)


def test_scales_grow_with_the_blob() -> None:
    small, large = (
        SurfDetector().detect_image(blob(80, 80, sigma)).strongest(1).scale_px[0]
        for sigma in (3.5, 7.0)
    )
    assert large / small == pytest.approx(2, rel=0.1)


def test_weak_features_fall_below_the_threshold() -> None:
    image = (0.5 + 0.1 * texture(SIDE, SIDE)).astype(np.float32)
    few, many = (SurfDetector(least).detect_image(image) for least in (0.002, 0.0002))
    assert 0 < len(few) < len(many)
    assert few.response.min() >= 0.0015
    assert len(SurfDetector(1.0).detect_image(image)) == 0


def test_flat_and_tiny_images_have_none() -> None:
    assert len(SurfDetector().detect(whole(np.full((50, 50), 7.0)))) == 0
    assert len(SurfDetector().detect(whole(texture(6, 7) + 10))) == 0


def test_features_that_see_masked_pixels_are_left_out() -> None:
    values = (1000 + 100 * texture(SIDE, SIDE)).astype(np.float32)
    valid = np.ones((SIDE, SIDE), bool)
    valid[:, :120] = False
    found = SurfDetector().detect(Patch(values, valid))
    assert len(found) > 20
    assert (found.position_px[:, 0] - 3 * found.scale_px > 117).all()


CHANGES = {
    "shift": ((3.3, -5.6), 0.0, 1.0, 1.0),
    "rotation": ((0.0, 0.0), 20.0, 1.0, 1.0),
    "scale": ((0.0, 0.0), 0.0, 1.2, 1.0),
    "brightness": ((0.0, 0.0), 0.0, 1.0, 0.7),
}


def scene() -> FloatArray:
    """Return fields and houses on uneven ground, without noise."""
    random = np.random.default_rng(3)
    image = 0.5 + 0.08 * texture(SIDE, SIDE)
    for _ in range(60):
        centre, size = random.uniform(0, SIDE, 2), random.uniform(4, 30, 2)
        box = cv2.boxPoints(((centre[0], centre[1]), (size[0], size[1]), random.uniform(0, 180)))
        shown = cv2.fillPoly(np.zeros(image.shape), [box.astype(int)], 1.0)
        image += shown * random.uniform(-0.2, 0.2)
    return cv2.GaussianBlur(image, (0, 0), 1.2)


def repeated(detector: SurfDetector | SiftDetector, change: str) -> float:
    """Return the share of features that overlap by at least 60 % in the changed image."""
    shift, angle, scale, gain = CHANGES[change]
    image = scene()
    matrix = cv2.getRotationMatrix2D(((SIDE - 1) / 2,) * 2, angle, scale)
    matrix[:, 2] += shift
    changed = cv2.warpAffine(image, matrix, (SIDE, SIDE), flags=cv2.INTER_CUBIC) * gain
    # Both are stretched by the same percentiles: equal images but for the change.
    first, second = (detector.detect(whole(each * 255)) for each in (image, changed))
    inverse = cv2.invertAffineTransform(matrix)
    back = replace(
        second,
        position_px=second.position_px @ inverse[:, :2].T + inverse[:, 2],
        scale_px=second.scale_px / scale,
    )
    ahead = first.position_px @ matrix[:, :2].T + matrix[:, 2]
    return float(repeatability(inner(first, ahead), inner(back, second.position_px))[:4].sum())


def inner(found: Keypoints, elsewhere: FloatArray) -> Keypoints:
    """Return the features that lie well inside both images."""
    both = np.hstack([found.position_px, elsewhere])
    return found.take(np.all((both > 40) & (both < SIDE - 40), axis=1))


@pytest.mark.parametrize("change", CHANGES)
def test_features_repeat_as_those_of_sift_do(change: str) -> None:
    surf, sift = repeated(SurfDetector(), change), repeated(SiftDetector(0.03), change)
    assert surf > sift - 0.1
    assert surf > 0.5
