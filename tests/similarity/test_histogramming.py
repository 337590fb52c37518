"""Against the definition of generalised partial volume estimation, pixel by pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from affine import Affine

from groundtie.similarity import histogramming
from groundtie.similarity.binning import MASKED
from groundtie.similarity.histogramming import joint_histogram_under
from groundtie.similarity.joint_histogram import ORDERS, count_joint_histograms

BINS = (5, 6)
SHAPE, SIZE = (9, 11), (24, 27)
TURNED = (
    Affine.translation(5.3, 4.8) * Affine.rotation(17) * Affine.scale(1.2),
    Affine(0.8, 0.3, 3.112, -0.2, 1.1, 6.433),
    # Half of the template falls outside.
    Affine.translation(18.6, 3.25) * Affine.rotation(-30),
    Affine.translation(-6.4, -4.9),
)


def spline(order: int, x: np.ndarray) -> np.ndarray:
    """The centred B-spline of an order, degree order - 1, as a sum of truncated powers."""
    total = np.zeros(np.shape(x))
    for k in range(order + 1):
        power = np.maximum(np.asarray(x) + order / 2 - k, 0) ** (order - 1)
        total += (-1) ** k * math.comb(order, k) * power
    return np.where(np.abs(x) < order / 2, total, 0) / math.factorial(order - 1)


def windows(
    masked: bool, shape: tuple[int, int] = SHAPE, size: tuple[int, int] = SIZE
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    template = rng.integers(0, BINS[0], shape).astype(np.uint8)
    image = rng.integers(0, BINS[1], size).astype(np.uint8)
    if masked:
        template[rng.random(shape) < 0.2] = MASKED
        image[rng.random(size) < 0.1] = MASKED
    return template, image


def gpve(template: np.ndarray, image: np.ndarray, to_image: Affine, order: int) -> np.ndarray:
    """S eq 3.34: each template pixel adds β to the bins of the image pixels around its place."""
    histogram = np.zeros(BINS)
    rows, cols = np.arange(image.shape[0]), np.arange(image.shape[1])
    seen = image != MASKED
    for (row, col), own in np.ndenumerate(template):
        if own != MASKED:
            x = to_image.a * col + to_image.b * row + to_image.c
            y = to_image.d * col + to_image.e * row + to_image.f
            weights = np.outer(spline(order, rows - y), spline(order, cols - x))
            np.add.at(histogram[own], image[seen], weights[seen])
    return histogram


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("masked", [False, True])
def test_histograms_are_those_of_the_definition(order: int, masked: bool) -> None:
    template, image = windows(masked)
    for to_image in TURNED:
        found = joint_histogram_under(template, image, to_image, BINS, order)
        expected = gpve(template, image, to_image, order)
        np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("masked", [False, True])
def test_shifts_agree_with_the_volume(order: int, masked: bool) -> None:
    reach = 7
    template, search = windows(masked, size=(SHAPE[0] + 2 * reach, SHAPE[1] + 2 * reach))
    volume = count_joint_histograms(template, search, BINS, 3)
    for dy, dx in ((0.0, 0.0), (0.3, -0.2), (-2.5, 1.75), (2.99, 0.5)):
        to_image = Affine.translation(reach + dx, reach + dy)
        found = joint_histogram_under(template, search, to_image, BINS, order)
        np.testing.assert_allclose(found, volume.at((dy, dx), order), atol=1e-8)


def nearest(template: np.ndarray, image: np.ndarray, to_image: Affine) -> np.ndarray:
    histogram = np.zeros(BINS)
    for (row, col), own in np.ndenumerate(template):
        x = round(to_image.a * col + to_image.b * row + to_image.c)
        y = round(to_image.d * col + to_image.e * row + to_image.f)
        inside = 0 <= y < image.shape[0] and 0 <= x < image.shape[1]
        if own != MASKED and inside and image[y, x] != MASKED:
            histogram[own, image[y, x]] += 1
    return histogram


@pytest.mark.parametrize("masked", [False, True])
def test_order_1_is_the_nearest_neighbour(masked: bool) -> None:
    template, image = windows(masked)
    for to_image in TURNED[:3]:
        found = joint_histogram_under(template, image, to_image, BINS, order=1)
        np.testing.assert_array_equal(found, nearest(template, image, to_image))


def test_far_outside_there_is_nothing_to_count() -> None:
    template, image = windows(masked=False)
    for shift in (1e3, -1e3, 1e12, -1e12):
        for order in (1, 4):
            found = joint_histogram_under(
                template, image, Affine.translation(shift, 2), BINS, order
            )
            assert not found.any()


def test_a_sample_counts_its_own_pixels_alone() -> None:
    template, image = windows(masked=True)
    sample = np.array([3, 17, 40, 41, 98])
    others = np.full_like(template, MASKED)
    others.flat[sample] = template.flat[sample]
    for order in (1, 4, 7):
        found = joint_histogram_under(template, image, TURNED[0], BINS, order, sample=sample)
        expected = joint_histogram_under(others, image, TURNED[0], BINS, order)
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("order", [2, 4, 7])
def test_random_offsets_have_the_weights_as_expectation(
    monkeypatch: pytest.MonkeyPatch, order: int
) -> None:
    """Mean and spread over seeds: counts of single pixels vary by p (1 - p)."""
    template, image = windows(masked=True, shape=(40, 50), size=(48, 57))
    to_image = TURNED[0] * Affine.scale(0.8)
    expected = joint_histogram_under(template, image, to_image, BINS, order)
    monkeypatch.setattr(histogramming, "_EXACT_PIXELS", 0)
    seeds = 200
    found = np.stack(
        [joint_histogram_under(template, image, to_image, BINS, order, s) for s in range(seeds)]
    )
    assert (found.var(axis=0) <= 1.5 * expected + 1).all()
    deviation = (found.mean(axis=0) - expected) / np.sqrt((expected + 1) / seeds)
    # 30 normal variates of at most unit variance.
    assert np.abs(deviation).max() < 4
    assert np.mean(deviation**2) < 1.8


def test_large_templates_are_repeatable() -> None:
    template, image = windows(masked=False, shape=(150, 151), size=(160, 161))
    runs = [joint_histogram_under(template, image, TURNED[1], BINS, 4, seed) for seed in (5, 5, 6)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert (runs[0] != runs[2]).any()
    assert runs[0].sum() == int(runs[0].sum())
