"""Against the definition of generalised partial volume estimation, pixel by pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import BSpline

from groundtie.context import threads
from groundtie.similarity import joint_histogram
from groundtie.similarity.binning import MASKED
from groundtie.similarity.joint_histogram import (
    ORDERS,
    JointHistogramVolume,
    count_joint_histograms,
    kernel,
    support,
)

RADIUS, MARGIN = 3, 4
BINS = (5, 6)


def spline(order: int, x: np.ndarray) -> np.ndarray:
    """The centred B-spline of an order, degree order - 1, as a sum of truncated powers."""
    total = np.zeros(np.shape(x))
    for k in range(order + 1):
        power = np.maximum(np.asarray(x) + order / 2 - k, 0) ** (order - 1)
        total += (-1) ** k * math.comb(order, k) * power
    return np.where(np.abs(x) < order / 2, total, 0) / math.factorial(order - 1)


def windows(
    masked: bool, shape: tuple[int, int] = (11, 13), bins: tuple[int, int] = BINS, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    reach = RADIUS + MARGIN
    template = rng.integers(0, bins[0], shape).astype(np.uint8)
    size = shape[0] + 2 * reach, shape[1] + 2 * reach
    search = rng.integers(0, bins[1], size).astype(np.uint8)
    if masked:
        template[rng.random(shape) < 0.2] = MASKED
        search[rng.random(size) < 0.1] = MASKED
    return template, search


def gpve(
    template: np.ndarray, search: np.ndarray, shift: tuple[float, float], order: int
) -> np.ndarray:
    """S eq 3.34: each template pixel adds β to the bins of the search pixels around its place."""
    histogram = np.zeros(BINS)
    reach = RADIUS + MARGIN
    rows, cols = np.arange(search.shape[0]), np.arange(search.shape[1])
    seen = search != MASKED
    for (row, col), own in np.ndenumerate(template):
        if own == MASKED:
            continue
        along_y = spline(order, rows - (row + reach + shift[0]))
        along_x = spline(order, cols - (col + reach + shift[1]))
        np.add.at(histogram[own], search[seen], np.outer(along_y, along_x)[seen])
    return histogram


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("masked", [False, True])
def test_sub_pixel_histograms_are_those_of_the_definition(order: int, masked: bool) -> None:
    template, search = windows(masked)
    volume = count_joint_histograms(template, search, BINS, RADIUS)
    for shift in ((0.3, -0.2), (-2.5, 1.75), (2.99, 0.0)):
        expected = gpve(template, search, shift, order)
        np.testing.assert_allclose(volume.at(shift, order), expected, atol=1e-6)


@pytest.mark.parametrize("order", ORDERS)
def test_surfaces_hold_the_histograms_of_whole_shifts(order: int) -> None:
    template, search = windows(masked=True)
    volume = count_joint_histograms(template, search, BINS, RADIUS)
    histograms = volume.histograms(order)
    assert histograms.shape == (2 * RADIUS + 1, 2 * RADIUS + 1, *BINS)
    for dy, dx in ((0, 0), (-3, 2), (3, 3)):
        expected = gpve(template, search, (dy, dx), order)
        np.testing.assert_allclose(histograms[dy + RADIUS, dx + RADIUS], expected, atol=1e-4)


def with_numpy(template: np.ndarray, search: np.ndarray, bins: tuple[int, int]) -> np.ndarray:
    height, width = template.shape
    span = search.shape[0] - height + 1
    counts = np.zeros((span, span, *bins))
    for dy, dx in np.ndindex(span, span):
        window = search[dy : dy + height, dx : dx + width]
        both = (template != MASKED) & (window != MASKED)
        edges = [np.arange(n + 1) for n in bins]
        counts[dy, dx] = np.histogram2d(template[both], window[both], edges)[0]
    return counts


@pytest.mark.slow
@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("bins", [(5, 6), (2, 2), (16, 16), (15, 17), (40, 30), (255, 255)])
def test_counts_are_those_of_numpy(bins: tuple[int, int], masked: bool) -> None:
    template, search = windows(masked, (12, 9), bins)
    expected = with_numpy(template, search, bins)
    with threads(2) as context:
        for where in (None, context):
            volume = count_joint_histograms(template, search, bins, RADIUS, where)
            np.testing.assert_array_equal(volume.counts, expected)
    assert volume.margin == MARGIN


@pytest.mark.parametrize("shape", [(20, 31), (3, 4), (11, 9)])
@pytest.mark.parametrize(
    "filled",
    [np.s_[3:-7, 5:-4], np.s_[1:-1, 0:-6], np.s_[7:9, 8:9], np.s_[:1, -1:], np.s_[:0, :0]],
)
def test_counts_where_a_search_window_reaches_beyond_its_image(
    monkeypatch: pytest.MonkeyPatch, shape: tuple[int, int], filled: tuple[slice, slice]
) -> None:
    bins = (4, 3)
    template, whole = windows(False, shape, bins)
    search = np.full_like(whole, MASKED)
    search[filled] = whole[filled]
    monkeypatch.setattr(joint_histogram, "_SPECTRAL_COST", 0.0)
    volume = count_joint_histograms(template, search, bins, RADIUS)
    np.testing.assert_array_equal(volume.counts, with_numpy(template, search, bins))


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("shape", [(150, 160), (9, 200), (20, 31)])
def test_all_ways_to_count_agree(
    monkeypatch: pytest.MonkeyPatch, masked: bool, shape: tuple[int, int]
) -> None:
    """Which way is quickest depends on the sizes; what is counted must not."""
    bins = (4, 3)
    template, search = windows(masked, shape, bins)
    expected = with_numpy(template, search, bins)
    for cost in (0.0, 1e9):
        monkeypatch.setattr(joint_histogram, "_SPECTRAL_COST", cost)
        volume = count_joint_histograms(template, search, bins, RADIUS)
        np.testing.assert_array_equal(volume.counts, expected)


@pytest.mark.parametrize("cost", [0.0, 1e9])
def test_stacks_are_counted_window_by_window(monkeypatch: pytest.MonkeyPatch, cost: float) -> None:
    monkeypatch.setattr(joint_histogram, "_SPECTRAL_COST", cost)
    bins = (4, 3)
    pairs = [windows(masked, (12, 20), bins) for masked in (False, True)]
    templates, searches = (np.stack(of) for of in zip(*pairs, strict=True))
    volume = count_joint_histograms(templates, searches, bins, RADIUS)
    for of_one, pair in zip(volume.counts, pairs, strict=True):
        np.testing.assert_array_equal(of_one, with_numpy(*pair, bins))
    alone = [count_joint_histograms(*pair, bins, RADIUS) for pair in pairs]
    np.testing.assert_array_equal(volume.histograms(), [one.histograms() for one in alone])
    shift = (1.3, -0.6)
    np.testing.assert_allclose(volume.at(shift, 4), [one.at(shift, 4) for one in alone])


def test_every_pixel_is_counted_once() -> None:
    template, search = windows(masked=False)
    histograms = count_joint_histograms(template, search, BINS, RADIUS).histograms(4)
    np.testing.assert_allclose(histograms.sum(axis=(-2, -1)), template.size, rtol=1e-6)
    own = np.bincount(template.ravel(), minlength=BINS[0])
    np.testing.assert_allclose(histograms.sum(axis=-1), np.broadcast_to(own, (7, 7, 5)), rtol=1e-5)


@pytest.mark.parametrize("order", [4, 7])
def test_rotated_images_have_the_histogram_of_the_opposite_shift(order: int) -> None:
    template, search = windows(masked=False)
    volume = count_joint_histograms(template, search, BINS, RADIUS)
    rotated = count_joint_histograms(template[::-1, ::-1], search[::-1, ::-1], BINS, RADIUS)
    np.testing.assert_allclose(
        volume.at((1.3, -0.6), order), rotated.at((-1.3, 0.6), order), atol=1e-9
    )


@pytest.mark.parametrize("order", ORDERS)
def test_kernels(order: int) -> None:
    reach = support(order)
    for offset in (-0.5, -0.2, 0.0, 0.35, 0.5):
        weights = kernel(order, offset)
        assert weights.shape == (2 * reach + 1,)
        assert weights.sum() == pytest.approx(1)
        assert weights.min() >= 0
        expected = spline(order, np.arange(-reach, reach + 1) - offset)
        np.testing.assert_allclose(weights, expected, atol=1e-12)
        # From order 2 on, the mean of the weights' places is the offset itself.
        assert weights @ np.arange(-reach, reach + 1) == pytest.approx(offset, abs=1e-12)
    whole = BSpline.basis_element(np.arange(order + 1) - order / 2)(0.0)
    assert kernel(order, 0.0)[reach] == pytest.approx(float(whole))


def test_a_volume_without_margin_refuses_wide_kernels() -> None:
    template, search = windows(masked=False)
    counts = count_joint_histograms(template, search, BINS, RADIUS).counts
    tight = JointHistogramVolume(counts, RADIUS + MARGIN)
    assert tight.margin == 0
    with pytest.raises(ValueError, match="margin of 0"):
        tight.histograms(4)
    with pytest.raises(ValueError, match="margin of 0"):
        tight.at((0.0, 0.0), 2)
