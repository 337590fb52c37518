"""Joint histograms against the definition of generalised partial volume estimation, by pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest

from groundtie.context import threads
from groundtie.similarity import joint_histogram
from groundtie.similarity.binning import MASKED
from groundtie.similarity.joint_histogram import count_joint_histograms, gpve_histograms, reach

ORDERS = (2, 3, 4, 5, 6, 7)
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
def test_histograms_are_those_of_the_definition(order: int, masked: bool) -> None:
    template, search = windows(masked)
    histograms = gpve_histograms(count_joint_histograms(template, search, BINS), order)
    radius = RADIUS + MARGIN - reach(order)
    assert histograms.shape == (2 * radius + 1, 2 * radius + 1, *BINS)
    for dy, dx in ((0, 0), (-3, 2), (3, 3)):
        expected = gpve(template, search, (dy, dx), order)
        np.testing.assert_allclose(histograms[dy + radius, dx + radius], expected, atol=1e-4)


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
            counts = count_joint_histograms(template, search, bins, where)
            np.testing.assert_array_equal(counts, expected)


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
    counts = count_joint_histograms(template, search, bins)
    np.testing.assert_array_equal(counts, with_numpy(template, search, bins))


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("shape", [(150, 160), (9, 200), (20, 31)])
def test_all_ways_to_count_agree(
    monkeypatch: pytest.MonkeyPatch, masked: bool, shape: tuple[int, int]
) -> None:
    """The fastest way depends on the sizes; the counts must not."""
    bins = (4, 3)
    template, search = windows(masked, shape, bins)
    expected = with_numpy(template, search, bins)
    for cost in (0.0, 1e9):
        monkeypatch.setattr(joint_histogram, "_SPECTRAL_COST", cost)
        counts = count_joint_histograms(template, search, bins)
        np.testing.assert_array_equal(counts, expected)


@pytest.mark.parametrize("cost", [0.0, 1e9])
def test_stacks_are_counted_window_by_window(monkeypatch: pytest.MonkeyPatch, cost: float) -> None:
    monkeypatch.setattr(joint_histogram, "_SPECTRAL_COST", cost)
    bins = (4, 3)
    pairs = [windows(masked, (12, 20), bins) for masked in (False, True)]
    templates, searches = (np.stack(of) for of in zip(*pairs, strict=True))
    counts = count_joint_histograms(templates, searches, bins)
    for of_one, pair in zip(counts, pairs, strict=True):
        np.testing.assert_array_equal(of_one, with_numpy(*pair, bins))
    alone = [gpve_histograms(count_joint_histograms(*pair, bins)) for pair in pairs]
    np.testing.assert_array_equal(gpve_histograms(counts), alone)


def test_every_pixel_is_counted_once() -> None:
    template, search = windows(masked=False)
    histograms = gpve_histograms(count_joint_histograms(template, search, BINS), 4)
    np.testing.assert_allclose(histograms.sum(axis=(-2, -1)), template.size, rtol=1e-6)
    own = np.bincount(template.ravel(), minlength=BINS[0])
    found = histograms.sum(axis=-1)
    np.testing.assert_allclose(found, np.broadcast_to(own, found.shape), rtol=1e-5)


@pytest.mark.parametrize("order", [4, 7])
def test_rotated_images_have_the_histogram_of_the_opposite_shift(order: int) -> None:
    template, search = windows(masked=False)
    counts = count_joint_histograms(template, search, BINS)
    rotated = count_joint_histograms(template[::-1, ::-1], search[::-1, ::-1], BINS)
    opposite = gpve_histograms(rotated, order)[::-1, ::-1]
    np.testing.assert_allclose(gpve_histograms(counts, order), opposite, atol=1e-4)
