"""Against the definition of generalised partial volume estimation, pixel by pixel."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from affine import Affine

from groundtie.context import threads
from groundtie.errors import ParameterError
from groundtie.progress import Progress
from groundtie.rasters.grid import compose
from groundtie.rasters.patch import Patch
from groundtie.rasters.warping import resample
from groundtie.similarity.binning import BINNINGS, MASKED, bin_edges, to_bins
from groundtie.similarity.joint_histogram import count_joint_histograms, gpve_histograms, reach
from groundtie.similarity.measures import normalized_mutual_information
from groundtie.studies import histogramming
from groundtie.studies.histogramming import (
    MASKED_LEVEL,
    joint_histogram_under,
    measure_surface,
    sparse_joint_histogram_under,
    to_levels,
)
from groundtie.studies.measures import HISTOGRAM_MEASURES

BINS = (5, 6)
SHAPE, SIZE = (9, 11), (24, 27)
ORDERS = (2, 3, 4, 5, 6, 7)
TURNED = (
    compose(Affine.translation(5.3, 4.8), Affine.rotation(17), Affine.scale(1.2)),
    Affine(0.8, 0.3, 3.112, -0.2, 1.1, 6.433),
    # Half of the template falls outside.
    compose(Affine.translation(18.6, 3.25), Affine.rotation(-30)),
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
def test_whole_shifts_agree_with_those_counted_at_once(order: int, masked: bool) -> None:
    far = 7
    template, search = windows(masked, size=(SHAPE[0] + 2 * far, SHAPE[1] + 2 * far))
    histograms = gpve_histograms(count_joint_histograms(template, search, BINS), order)
    for dy, dx in ((0, 0), (1, -2), (-3, 3)):
        found = joint_histogram_under(
            template, search, Affine.translation(far + dx, far + dy), BINS, order
        )
        radius = far - reach(order)
        np.testing.assert_allclose(found, histograms[radius + dy, radius + dx], atol=1e-4)


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


@pytest.mark.parametrize("order", [2, 4, 7])
def test_random_offsets_have_the_weights_as_expectation(
    monkeypatch: pytest.MonkeyPatch, order: int
) -> None:
    """Mean and spread over seeds: counts of single pixels vary by p (1 - p)."""
    template, image = windows(masked=True, shape=(40, 50), size=(48, 57))
    to_image = compose(TURNED[0], Affine.scale(0.8))
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


def wide(bins: np.ndarray) -> np.ndarray:
    return np.where(bins == MASKED, MASKED_LEVEL, bins).astype(np.uint16)


@pytest.mark.parametrize("order", [1, 2, 4, 7])
def test_sparse_histograms_and_levels_of_16_bits(order: int) -> None:
    template, image = windows(masked=True)
    for to_image in TURNED:
        expected = joint_histogram_under(template, image, to_image, BINS, order)
        levels = wide(template), wide(image)
        dense = joint_histogram_under(*levels, to_image, BINS, order)
        np.testing.assert_array_equal(dense, expected)
        sparse = sparse_joint_histogram_under(*levels, to_image, BINS, order)
        np.testing.assert_allclose(sparse.toarray(), expected, atol=1e-12)


def grey_pair(size: int = 40) -> tuple[Patch, Patch]:
    """Two related images of 11 bits with a few masked pixels."""
    rng = np.random.default_rng(9)
    first = rng.integers(0, 2048, (size, size)).astype(np.float32)
    second = np.rint(first / 2 + 300 * rng.random((size, size))).astype(np.float32)
    valid = rng.random((2, size, size)) > 0.05
    return Patch(first, valid[0]), Patch(second, valid[1])


def test_all_grey_values_are_levels() -> None:
    first, _ = grey_pair()
    levels, count = to_levels(first)
    occurring = np.unique(first.values[first.valid])
    assert count == len(occurring)
    np.testing.assert_array_equal(occurring[levels[first.valid]], first.values[first.valid])
    assert (levels[~first.valid] == MASKED_LEVEL).all()
    nothing, count = to_levels(Patch(first.values, np.zeros_like(first.valid)))
    assert count == 1 and (nothing == MASKED_LEVEL).all()


@pytest.mark.parametrize("binning", BINNINGS)
@pytest.mark.parametrize("bins", [8, 32, 254, 256, 1000])
def test_levels_are_the_bins_of_any_number(bins: int, binning: str) -> None:
    first, _ = grey_pair(100)
    levels, count = to_levels(first, bins, binning)
    assert count == bins
    counted = np.bincount(levels[first.valid], minlength=bins)
    if bins <= 254:
        narrow = to_bins(first.values, first.valid, bins, binning)
        np.testing.assert_array_equal(levels, wide(narrow))
    # Evenly distributed grey values: both binnings give bins of about the same contents.
    expected = first.valid.sum() / bins
    assert np.abs(counted - expected).max() < 5 * np.sqrt(expected) + 2


def test_measures_of_all_grey_values_are_those_of_a_full_table() -> None:
    first, second = grey_pair()
    a, count_a = to_levels(first)
    b, count_b = to_levels(second)
    sparse = sparse_joint_histogram_under(a, b, Affine.identity(), (count_a, count_b), 1)
    both = first.valid & second.valid
    table = np.zeros((count_a, count_b))
    np.add.at(table, (a[both], b[both]), 1)
    for measure in HISTOGRAM_MEASURES.values():
        assert float(measure(sparse)) == pytest.approx(float(measure(table)), abs=1e-9)


def test_too_many_grey_values() -> None:
    values = np.arange(300 * 300, dtype=np.float32).reshape(300, 300)
    with pytest.raises(ParameterError, match="more than 65535 grey values"):
        to_levels(Patch(values, np.ones(values.shape, bool)))


def two_step_histogram(
    template: np.ndarray,
    image: Patch,
    to_image: Affine,
    edges: np.ndarray,
    template_bins: int,
    interpolation: str,
) -> np.ndarray:
    """What GPVE is better than: the image is interpolated, and one entry counted."""
    rows, cols = np.indices(template.shape)
    places = np.stack([p * cols + q * rows + r for p, q, r in (to_image[:3], to_image[3:6])])
    values, valid = resample(image.values, image.valid, places, interpolation)
    valid = valid & (template < template_bins)
    table = np.zeros((template_bins, len(edges) + 1))
    np.add.at(table, (template[valid], np.searchsorted(edges, values[valid], side="right")), 1)
    return table


def interpolated(image: Patch, x: float, y: float, edges: np.ndarray) -> int | None:
    """The bin of the bilinear value at a place among valid pixels; None elsewhere."""
    left, top = math.floor(x), math.floor(y)
    if not (0 <= left < image.values.shape[1] - 1 and 0 <= top < image.values.shape[0] - 1):
        return None
    around = slice(top, top + 2), slice(left, left + 2)
    if not image.valid[around].all():
        return None
    weights = np.outer([1 - (y - top), y - top], [1 - (x - left), x - left])
    return int(np.sum(edges <= float(np.sum(weights * image.values[around]))))


def test_two_steps_bilinear() -> None:
    template, _ = windows(masked=True)
    image, _ = grey_pair()
    image = Patch(image.values, np.ones_like(image.valid))
    edges = bin_edges(image.values[image.valid], 6, "linear")
    to_image = compose(Affine.translation(9.3, 7.8), Affine.rotation(17))
    expected = np.zeros(BINS)
    for (row, col), own in np.ndenumerate(template):
        x = to_image.a * col + to_image.b * row + to_image.c
        y = to_image.d * col + to_image.e * row + to_image.f
        found = interpolated(image, x, y, edges)
        assert found is not None
        if own != MASKED:
            expected[own, found] += 1
    counted = two_step_histogram(template, image, to_image, edges, BINS[0], "bilinear")
    np.testing.assert_array_equal(counted, expected)


@pytest.mark.parametrize("interpolation", ["nearest", "bilinear", "cubic"])
def test_two_steps_with_masks_and_outside(interpolation: str) -> None:
    """Who takes part is decided by the nearest pixel, and on pixels all interpolations agree."""
    template, _ = windows(masked=True)
    image, _ = grey_pair()
    edges = bin_edges(image.values[image.valid], 6, "equal-frequency")
    bins = to_bins(image.values, image.valid, 6)
    for to_image in (*TURNED, Affine.translation(4, 9), Affine.translation(1e7, 0)):
        near = joint_histogram_under(template, bins, to_image, BINS, 1)
        found = two_step_histogram(template, image, to_image, edges, BINS[0], interpolation)
        np.testing.assert_array_equal(found.sum(axis=1), near.sum(axis=1))
        whole = to_image.a == 1 and to_image.c == int(to_image.c)
        if interpolation == "nearest" or whole:
            np.testing.assert_array_equal(found, near)


@pytest.mark.parametrize("order", [2, 4, 7])
@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.slow
def test_surfaces_of_any_measure(monkeypatch: pytest.MonkeyPatch, order: int, masked: bool) -> None:
    """From the volume, shift by shift and from the definition."""
    radius, margin = 2, reach(order)
    side = [n + 2 * (radius + margin) for n in SHAPE]
    template, search = windows(masked, size=(side[0], side[1]))
    measure = HISTOGRAM_MEASURES["tsallis"]
    with threads(2) as context:
        whole = measure_surface(template, search, BINS, measure, order, context)
        levels = wide(template), wide(search)
        same = measure_surface(*levels, BINS, measure, order, context)
        monkeypatch.setattr(histogramming, "_MOST_VOLUME_BYTES", 0)
        one_by_one = measure_surface(*levels, BINS, measure, order, context)
    np.testing.assert_array_equal(same, whole)
    np.testing.assert_allclose(one_by_one, whole, atol=1e-6)
    for dy, dx in ((-2, -2), (0, 1), (2, -1)):
        to_search = Affine.translation(radius + margin + dx, radius + margin + dy)
        expected = measure(gpve(template, search, to_search, order))
        assert whole[dy + radius, dx + radius] == pytest.approx(float(expected), abs=1e-6)


def test_surfaces_of_more_bins_than_a_byte_numbers() -> None:
    first, second = grey_pair(30)
    own, own_count = to_levels(Patch(first.values[4:-4, 4:-4], first.valid[4:-4, 4:-4]))
    other, other_count = to_levels(second)
    counts = own_count, other_count
    told: list[float] = []
    with threads(2, Progress(lambda done, message: told.append(done))) as context:
        found = measure_surface(own, other, counts, normalized_mutual_information, 4, context)
    assert max(counts) > 255 and found.shape == (7, 7)
    assert told == sorted(told) and told[-1] == 1
    expected = gpve_table(own, other, (4, 4), counts)
    assert found[3, 3] == pytest.approx(float(normalized_mutual_information(expected)), abs=1e-6)


def gpve_table(
    own: np.ndarray, other: np.ndarray, corner: tuple[int, int], counts: tuple[int, int]
) -> np.ndarray:
    """The cubic spline at a whole shift: weights 1/6, 2/3 and 1/6 along both axes."""
    table = np.zeros(counts)
    height, width = own.shape
    for dy, dx in np.ndindex(3, 3):
        top, left = corner[0] + dy - 1, corner[1] + dx - 1
        seen = other[top : top + height, left : left + width]
        both = (own != MASKED_LEVEL) & (seen != MASKED_LEVEL)
        weight = (2 / 3 if dy == 1 else 1 / 6) * (2 / 3 if dx == 1 else 1 / 6)
        np.add.at(table, (own[both], seen[both]), weight)
    return table


# Shifts by eighths of a pixel: a component of period 1 px runs four times through them.
SHIFTS = np.arange(-2, 2, 1 / 8)


def noisy_pair(seed: int, margin: int = 6) -> tuple[Patch, Patch]:
    """A template of radar-like and an image of opposite, optical-like grey values, larger."""
    rng = np.random.default_rng(seed)
    size = 64 + 2 * margin
    scene = cv2.GaussianBlur(rng.normal(size=(size, size)), (0, 0), 1.5)
    scene /= scene.std()
    first, second = scene + 0.7 * rng.normal(size=(2, size, size))
    inner = slice(margin, -margin)
    return (
        Patch(np.exp(first / 2)[inner, inner].astype(np.float32), np.ones((64, 64), bool)),
        Patch(-second.astype(np.float32), np.ones((size, size), bool)),
    )


def artefact(estimator: str | int, seed: int) -> complex:
    """Amplitude of period 1 px in the profile of NMI, over that of the peak itself.

    A window in the shape of a Hann bell keeps the peak, whose periods are longer, apart.
    """
    template, image = noisy_pair(seed)
    counts = (32, 32)
    own = to_bins(template.values, template.valid, 32, "linear")
    bins = to_bins(image.values, image.valid, 32, "linear")
    edges = bin_edges(image.values[image.valid], 32, "linear")
    profile = []
    for shift in SHIFTS:
        to_image = Affine.translation(6 + shift, 6)
        if isinstance(estimator, int):
            table = joint_histogram_under(own, bins, to_image, counts, estimator)
        else:
            table = two_step_histogram(own, image, to_image, edges, 32, estimator)
        profile.append(float(normalized_mutual_information(table)))
    # The first shift becomes phase 0, a whole shift, as are all multiples of the period.
    bell = np.hanning(len(SHIFTS) + 1)[:-1]
    spectrum = np.fft.rfft((np.array(profile) - np.mean(profile)) * bell)
    return complex(spectrum[4] / np.sqrt(np.sum(np.abs(spectrum[1:4]) ** 2)))


@pytest.fixture(scope="module")
def artefacts() -> dict[str | int, np.ndarray]:
    estimators: tuple[str | int, ...] = ("bilinear", "cubic", 2, 3, 4, 5, 6, 7)
    return {e: np.array([artefact(e, seed) for seed in range(5)]) for e in estimators}


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["bilinear", "cubic", 2])
def test_interpolation_artefacts(
    estimator: str | int, artefacts: dict[str | int, np.ndarray]
) -> None:
    """S fig 3.6 and 3.7: the profile swings with the pixels, by a tenth of the peak and more.

    Two steps have their maxima between pixels, where interpolation takes off noise; PVI has them
    on pixels, where it does not spread.
    """
    found = artefacts[estimator]
    assert (np.abs(found) > 0.1).all()
    assert ((found.real > 0) == (estimator == 2)).all()


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 5, 6, 7])
def test_no_artefacts_from_order_4_on(order: int, artefacts: dict[str | int, np.ndarray]) -> None:
    """S fig 3.10: less than a fiftieth of the peak, and less than a hundredth of the energy."""
    found = np.abs(artefacts[order])
    assert (found < 0.02).all()
    for estimator in ("bilinear", "cubic", 2):
        assert (found**2 < np.abs(artefacts[estimator]) ** 2 / 100).all()


@pytest.mark.slow
def test_artefacts_fall_with_the_order(artefacts: dict[str | int, np.ndarray]) -> None:
    means = [np.abs(artefacts[order]).mean() for order in (2, 3, 4, 5)]
    assert means == sorted(means, reverse=True)
