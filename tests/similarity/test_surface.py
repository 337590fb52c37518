from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, median_filter
from speckled_pairs import whole
from textured_pairs import texture

from groundtie.context import threads
from groundtie.rasters.patch import Patch
from groundtie.similarity.description import BORDER_PX
from groundtie.similarity.measures import MEASURES, of_histograms
from groundtie.similarity.surface import (
    SIMILARITIES,
    SimilaritySettings,
    describe,
    detrend,
    normalise,
    similarity_surface,
)
from groundtie.studies.measures import HISTOGRAM_MEASURES

CHIP, RADIUS = 48, 7
SPAN = 2 * RADIUS + 1
SIDE = CHIP + 2 * BORDER_PX

# Measures that studies compare, registered here like new ones.
STUDIED = tuple(name for name in HISTOGRAM_MEASURES if name not in SIMILARITIES)
EVERY = (*SIMILARITIES, *STUDIED)


@pytest.fixture(autouse=True)
def _studied_measures(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in STUDIED:
        monkeypatch.setitem(MEASURES, name, of_histograms(HISTOGRAM_MEASURES[name]))


def patches(
    shift: tuple[int, int] = (0, 0), seed: int = 0, noise: float = 0.2
) -> tuple[Patch, Patch]:
    """Return a template and a search window whose content is displaced by `shift` (x, y)."""
    rng = np.random.default_rng(seed)
    scene = texture(SIDE + 4 * RADIUS, SIDE + 4 * RADIUS, seed)
    x, y = shift
    start = 2 * RADIUS
    own = scene[start : start + SIDE, start : start + SIDE]
    reach = start - RADIUS
    other = scene[
        reach - y : reach - y + SIDE + 2 * RADIUS, reach - x : reach - x + SIDE + 2 * RADIUS
    ]
    template = 500 + 100 * (own + noise * rng.normal(size=own.shape))
    search = 2000 + 300 * (other + noise * rng.normal(size=other.shape))
    return whole(template), whole(search)


def stacked(windows: Sequence[Patch]) -> Patch:
    values, valid = ([getattr(w, of) for w in windows] for of in ("values", "valid"))
    return Patch(np.stack(values), np.stack(valid))


def inverted(patch: Patch) -> Patch:
    return Patch(np.float32(4000) - patch.values, patch.valid)


def surface_of(template: Patch, search: Patch, settings: SimilaritySettings) -> np.ndarray:
    windows = [describe(patch, CHIP**2, settings) for patch in (template, search)]
    return similarity_surface(*windows, RADIUS, settings)


def peak_of(surface: np.ndarray) -> tuple[int, int]:
    row, col = np.unravel_index(surface.argmax(), surface.shape)
    return int(col) - RADIUS, int(row) - RADIUS


@pytest.mark.parametrize("similarity", EVERY)
@pytest.mark.parametrize("shift", [(0, 0), (3, -5), (-6, 1)])
def test_the_peak_is_where_the_content_lies_further_right_and_down(
    similarity: str, shift: tuple[int, int]
) -> None:
    template, search = patches(shift)
    surface = surface_of(template, search, SimilaritySettings(similarity))
    assert surface.shape == (SPAN, SPAN)
    assert surface.dtype == np.float32
    assert peak_of(surface) == shift
    assert surface.max() > 6


@pytest.mark.parametrize("similarity", ["fused", "nmi", "orientation", "edge-strength"])
def test_inverted_contrast_is_as_similar(similarity: str) -> None:
    template, search = patches((2, 3))
    settings = SimilaritySettings(similarity)
    surface = surface_of(template, inverted(search), settings)
    assert peak_of(surface) == (2, 3)
    assert surface.max() > 0.7 * surface_of(template, search, settings).max()


def test_correlation_of_grey_values_finds_no_inverted_contrast() -> None:
    template, search = patches((2, 3))
    surface = surface_of(template, inverted(search), SimilaritySettings("ncc"))
    assert peak_of(surface) != (2, 3)


@pytest.mark.parametrize("similarity", EVERY)
def test_the_way_back_peaks_at_the_opposite_shift(similarity: str) -> None:
    settings = SimilaritySettings(similarity)
    scene = texture(SIDE + 2 * RADIUS, SIDE + 2 * RADIUS)
    here, there = whole(500 + 100 * scene), whole(300 * np.roll(scene, (-2, 4), (0, 1)))
    assert peak_of(surface_of(here.inner(RADIUS), there, settings)) == (4, -2)
    assert peak_of(surface_of(there.inner(RADIUS), here, settings)) == (-4, 2)


@pytest.mark.parametrize("similarity", EVERY)
def test_surfaces_of_different_places_are_background(similarity: str) -> None:
    template, _ = patches(seed=1)
    _, search = patches(seed=2)
    assert surface_of(template, search, SimilaritySettings(similarity)).max() < 6


@pytest.mark.parametrize("similarity", EVERY)
@pytest.mark.parametrize("which", ["template", "search"])
def test_masked_pixels_do_not_count(similarity: str, which: str) -> None:
    """The content of masked pixels does not matter; the rest still finds the peak."""
    settings = SimilaritySettings(similarity)
    pair = dict(zip(("template", "search"), patches((3, -2)), strict=True))
    valid = np.ones(pair[which].valid.shape, bool)
    valid[: SIDE // 2, 20:] = False
    found = []
    for junk in (0.0, 9e4):
        values = np.where(valid, pair[which].values, np.float32(junk))
        found.append(surface_of(**(pair | {which: Patch(values, valid)}), settings=settings))
    np.testing.assert_array_equal(found[0], found[1])
    assert peak_of(found[0]) == (3, -2)


@pytest.mark.parametrize("similarity", EVERY)
def test_shifts_with_little_overlap_are_background(similarity: str) -> None:
    template, search = patches((0, 0))
    valid = np.zeros(search.valid.shape, bool)
    valid[:, : BORDER_PX + RADIUS + 20] = True
    surface = surface_of(template, Patch(search.values, valid), SimilaritySettings(similarity))
    assert np.isfinite(surface).all()
    # At shift x, 20 - x of 48 columns overlap: less than 30 % from x = 6 on.
    assert not surface[:, RADIUS + 6 :].any()
    assert surface[:, : RADIUS + 5].any()


@pytest.mark.parametrize("similarity", EVERY)
def test_windows_without_content_are_finite(similarity: str) -> None:
    template, search = patches()
    settings = SimilaritySettings(similarity)
    constant = Patch(np.full_like(search.values, 7), search.valid)
    nothing = Patch(search.values, np.zeros_like(search.valid))
    for other in (constant, nothing):
        assert np.isfinite(surface_of(template, other, settings)).all()
    half = np.where(np.arange(SIDE) < 0.7 * SIDE, np.float32(0), template.values)
    surface = surface_of(Patch(half, template.valid), search, settings)
    assert np.isfinite(surface).all()


def test_threads_change_nothing() -> None:
    settings = SimilaritySettings("fused")
    windows = [describe(patch, CHIP**2, settings) for patch in patches((1, 1))]
    with threads(2) as context:
        threaded = similarity_surface(*windows, RADIUS, settings, context)
    alone = similarity_surface(*windows, RADIUS, settings)
    np.testing.assert_array_equal(threaded, alone)


@pytest.mark.parametrize("similarity", EVERY)
@pytest.mark.parametrize("masked", ["none", "one", "all"])
def test_windows_of_a_stack_have_the_surfaces_that_they_have_alone(
    similarity: str, masked: str
) -> None:
    settings = SimilaritySettings(similarity)
    pairs = [patches(shift, seed) for seed, shift in enumerate([(2, 3), (-4, 0), (5, -6)])]
    if masked != "none":
        pairs[0][0].valid[:20, :30] = False
        pairs[0][1].valid[-25:, -20:] = False
    if masked == "all":
        pairs[1][0].valid[:, -30:] = False
        pairs[2][1].valid[10:20] = False
    found = surface_of(*(stacked(of) for of in zip(*pairs, strict=True)), settings)
    assert found.shape == (3, SPAN, SPAN)
    for surface, (template, search) in zip(found, pairs, strict=True):
        np.testing.assert_array_equal(surface, surface_of(template, search, settings))


def test_normalised_surfaces_count_in_robust_standard_deviations() -> None:
    rng = np.random.default_rng(0)
    surface = (40 + 3 * rng.normal(size=(101, 101))).astype(np.float32)
    surface[:2] += 500
    found = normalise(surface)
    assert np.median(found) == pytest.approx(0, abs=1e-5)
    assert found[2:].std() == pytest.approx(1, rel=0.05)
    np.testing.assert_allclose(normalise(7 * surface + 3), found, atol=1e-3)
    assert not normalise(np.full((9, 9), 5, np.float32)).any()


@pytest.mark.parametrize("make", [normalise, detrend])
def test_what_is_not_known_of_a_surface_changes_nothing_of_the_rest(make: Callable) -> None:
    """Where most shifts are unknown, the rest is normalised by its own standard deviation."""
    rng = np.random.default_rng(1)
    surfaces = (300 + rng.normal(size=(2, 49, 49))).astype(np.float32)
    known = np.ones(surfaces.shape, bool)
    known[1, :, :30] = False
    found = make(surfaces, known)
    np.testing.assert_array_equal(found[0], make(surfaces[0]))
    assert found[1][known[1]].std() == pytest.approx(1, rel=0.1)
    assert not found[1][~known[1]].any()
    other = np.where(known, surfaces, np.float32(9e3))
    np.testing.assert_array_equal(make(other, known), found)
    assert not make(surfaces, np.zeros(surfaces.shape, bool)).any()


def test_few_valid_pixels_in_thin_strips_make_no_peak_of_hundreds() -> None:
    """Wide filters have no valid pixel at most shifts: their surface is 0 except at a few."""
    heights = []
    for seed in range(20):
        template, search = patches(seed=seed)
        _, search = patches(seed=seed + 100)
        columns = np.arange(template.valid.shape[1])
        template.valid[:, columns % 24 > 8] = False
        search.valid[:, : search.valid.shape[1] // 3] = False
        heights.append(np.abs(surface_of(template, search, SimilaritySettings("fused"))).max())
    # The highest of some 250 independent values exceeds 6 once in a hundred thousand surfaces.
    assert max(heights) < 10


def test_the_trend_goes_and_the_peak_stays() -> None:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[-20:21, -20:21]
    peak = 8 * np.exp(-((x - 3) ** 2 + (y + 4) ** 2) / 4)
    slope = 0.3 * x + 0.02 * y**2
    surface = (peak + slope + rng.normal(size=x.shape)).astype(np.float32)
    found = detrend(surface)
    assert np.unravel_index(found.argmax(), found.shape) == (16, 23)
    # No slope remains inside.
    smooth = median_filter(found, 9)[8:-8, 8:-8]
    assert np.abs(smooth).max() < 2
    assert np.ptp(gaussian_filter(surface, 5.0)[8:-8, 8:-8]) > 6


def test_more_pixels_get_more_bins() -> None:
    settings = SimilaritySettings()
    bins = [settings.bins_for(side**2) for side in (20, 61, 100, 200, 500, 1000)]
    assert bins == sorted(bins)
    assert 5 <= bins[0] <= 16
    assert 20 <= bins[-1] <= 64
    assert SimilaritySettings(bins=77).bins_for(61**2) == 77
