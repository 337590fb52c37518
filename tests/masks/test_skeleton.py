from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, label

from groundtie.masks.skeleton import pruned, skeleton

EIGHT = np.ones((3, 3))


def blobs(seed: int) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=(150, 170)).astype(np.float32)
    return cv2.GaussianBlur(noise, (0, 0), 5) > 0.02


def neighbours(lines: np.ndarray) -> np.ndarray:
    counts = cv2.filter2D(lines.astype(np.uint8), -1, EIGHT, borderType=cv2.BORDER_CONSTANT)
    return np.where(lines, counts.astype(int) - 1, 0)


def removable_one_by_one(image: np.ndarray, second: bool) -> np.ndarray:
    """Return what a subiteration of Zhang and Suen's paper removes, pixel by pixel."""
    padded = np.pad(image, 1).astype(int)
    gone = np.zeros(image.shape, bool)
    for row, col in np.argwhere(image):
        r, c = row + 1, col + 1
        p2, p3, p4, p5 = (
            padded[r - 1, c],
            padded[r - 1, c + 1],
            padded[r, c + 1],
            padded[r + 1, c + 1],
        )
        p6, p7, p8, p9 = (
            padded[r + 1, c],
            padded[r + 1, c - 1],
            padded[r, c - 1],
            padded[r - 1, c - 1],
        )
        circle = [p2, p3, p4, p5, p6, p7, p8, p9]
        rises = sum(a == 0 and b == 1 for a, b in zip(circle, circle[1:] + circle[:1], strict=True))
        products = (p2 * p4 * p8, p2 * p6 * p8) if second else (p2 * p4 * p6, p4 * p6 * p8)
        gone[row, col] = 2 <= sum(circle) <= 6 and rises == 1 and products == (0, 0)
    return gone


@pytest.mark.parametrize("seed", [0, 1])
def test_it_is_what_the_paper_says_pixel_by_pixel(seed: int) -> None:
    image = blobs(seed)[:70, :60]
    expected, changed = image.copy(), True
    while changed:
        changed = False
        for second in (False, True):
            gone = removable_one_by_one(expected, second)
            expected &= ~gone
            changed |= bool(gone.any())
    np.testing.assert_array_equal(skeleton(image), expected)


@pytest.mark.parametrize("seed", [2, 3])
def test_what_hangs_together_still_does(seed: int) -> None:
    image = blobs(seed)
    lines = skeleton(image)
    assert not (lines & ~image).any()
    parts, count = label(image, EIGHT)
    assert label(lines, EIGHT)[1] == count
    assert set(np.unique(parts[lines])) == set(range(1, count + 1))


def test_a_ribbon_becomes_its_middle_line() -> None:
    image = np.zeros((120, 200), np.uint8)
    cv2.line(image, (20, 30), (180, 90), 1, 15)
    lines = skeleton(image > 0)
    distance = distance_transform_edt(image)
    # The middle, but for both ends.
    inner = np.argwhere(lines & (np.arange(200) > 35) & (np.arange(200) < 165))
    off = (inner[:, 0] - 30) * 160 - (inner[:, 1] - 20) * 60
    assert np.abs(off / np.hypot(160, 60)).max() <= 1.5
    assert distance[tuple(inner.T)].min() > 5


def test_pruning_takes_twigs_and_shortens_ends() -> None:
    lines = np.zeros((40, 60), bool)
    lines[20, 5:55] = True
    lines[15:20, 30] = True
    left = pruned(lines, 6)
    expected = np.zeros_like(lines)
    expected[20, 11:49] = True
    left[19, 30] = False  # the foot of the twig belongs to the junction
    np.testing.assert_array_equal(left, expected)
    ring = np.zeros((20, 20), np.uint8)
    cv2.circle(ring, (10, 10), 6, 1, 1)
    np.testing.assert_array_equal(pruned(ring > 0, 50), ring > 0)


def test_nothing_stays_nothing() -> None:
    assert not skeleton(np.zeros((9, 9), bool)).any()
