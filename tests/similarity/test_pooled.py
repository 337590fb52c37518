from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, uniform_filter
from scipy.stats import spearmanr
from sklearn.metrics import mutual_info_score

from groundtie.rasters.patch import Patch
from groundtie.similarity.peak import find_peak
from groundtie.similarity.pooled import BINS, PooledHistogram, smooth
from groundtie.similarity.surface import normalise

RADIUS = 8


def patch(values: np.ndarray, valid: np.ndarray | None = None) -> Patch:
    known = np.ones(values.shape, bool) if valid is None else valid
    return Patch(np.asarray(values, np.float32), known)


def ground_chips(
    count: int, share: float, shift: tuple[int, int] = (0, 0), looks: float = 2.0
) -> list[tuple[Patch, Patch]]:
    """Chips of a speckled image with a share left by a mask, and the other image around them."""
    random = np.random.default_rng(3)
    chips = []
    for _ in range(count):
        cover = gaussian_filter(random.normal(size=(60, 60)), 3.0)
        cover = np.digitize(cover, np.quantile(cover, [0.3, 0.7]))
        here = np.array([300.0, 120.0, 220.0])[cover] + random.normal(0, 15, cover.shape)
        power = np.array([1.0, 3.0, 8.0])[cover] * random.gamma(looks, 1 / looks, cover.shape)
        inside = (slice(RADIUS, -RADIUS),) * 2
        there = np.roll(np.sqrt(power), (-shift[1], -shift[0]), axis=(0, 1))[inside]
        chips.append((patch(there, random.random(there.shape) < share), patch(here)))
    return chips


def on_each_other(chips: list[tuple[Patch, Patch]]) -> list[tuple[Patch, Patch]]:
    return [(template, search.inner(RADIUS)) for template, search in chips]


def levels_of(chips: list[tuple[Patch, Patch]]) -> tuple[PooledHistogram, list[np.ndarray]]:
    """Return the pooled histogram of aligned chips, and their grey values."""
    sides = [
        np.concatenate([smooth(template).values[template.valid] for template, _ in chips]),
        np.concatenate([search.values[template.valid] for template, search in chips]),
    ]
    return PooledHistogram.of(*sides), sides


def test_the_mean_is_mutual_information() -> None:
    """As computed by scikit-learn from the same grey levels."""
    levels, values = levels_of(on_each_other(ground_chips(40, 1.0)))
    edges = levels.template_edges, levels.search_edges
    sides = [np.searchsorted(e, v, side="right") for e, v in zip(edges, values, strict=True)]
    mean = float(levels.information[sides[0], sides[1]].mean())
    assert mean == pytest.approx(mutual_info_score(*sides), abs=1e-3)
    assert mean > 0.1
    for side in sides:
        assert np.bincount(side, minlength=BINS).min() > 0.9 * side.size / BINS


def test_a_surface_sums_the_information_of_pixels() -> None:
    [(template, search)] = ground_chips(1, 0.3)
    search.valid[10:20, 15:30] = False
    levels, _ = levels_of(on_each_other(ground_chips(5, 0.5)))
    surface = levels.surface(template, search)
    there = np.searchsorted(levels.template_edges, smooth(template).values, side="right")
    here = np.searchsorted(levels.search_edges, search.values, side="right")
    height, width = template.values.shape
    for row, col in [(0, 0), (8, 8), (3, 16), (16, 1)]:
        window = np.s_[row : row + height, col : col + width]
        counted = template.valid & search.valid[window]
        expected = levels.information[there, here[window]][counted].sum()
        assert surface[row, col] == pytest.approx(expected, rel=1e-4, abs=1e-2)


def test_chips_with_little_ground_find_their_place_together() -> None:
    """Their joint histogram is estimated 2 px off; each chip has 1 % of its pixels."""
    chips = ground_chips(100, 0.01, shift=(2, -1))
    levels, _ = levels_of(on_each_other(chips))
    stacks = (
        Patch(np.stack([p.values for p in side]), np.stack([p.valid for p in side]))
        for side in zip(*chips, strict=True)
    )
    surfaces = levels.surface(*stacks)
    together = find_peak(normalise(surfaces.sum(axis=0))).shift_px
    assert together == pytest.approx((2, -1), abs=0.3)
    alone = np.array([find_peak(normalise(surface)).shift_px for surface in surfaces])
    assert np.mean(np.hypot(*(alone - [2, -1]).T) < 1) < 0.7


def test_speckle_is_averaged_over_what_is_valid_alone() -> None:
    values = np.full((9, 9), 3.0)
    values[:, 5:] = 1000.0
    ground = np.zeros((9, 9), bool)
    ground[:, :5] = True
    np.testing.assert_allclose(smooth(patch(values, ground)).values[ground], 3.0, rtol=1e-5)


@pytest.mark.parametrize("mean_db", [-40.0, -12.0, 0.0, 12.0])
def test_decibels_of_either_sign_keep_their_order(mean_db: float) -> None:
    """As by the mean of decibels: 3 dB below 0 is not 3 dB above 0."""
    random = np.random.default_rng(5)
    decibels = mean_db + 4 * gaussian_filter(random.normal(size=(90, 90)), 2.0) / 0.14
    found = smooth(patch(decibels)).values
    assert spearmanr(found, uniform_filter(decibels, 3), axis=None).statistic > 0.98
    np.testing.assert_allclose(smooth(patch(-decibels)).values, -found, atol=1e-3)
    np.testing.assert_allclose(smooth(patch(np.full((9, 9), -8.0))).values, -8.0, rtol=1e-5)


def test_what_rounding_leaves_of_nothing_is_no_power() -> None:
    random = np.random.default_rng(0)
    ground = np.zeros((72, 72), bool)
    ground[5:17, 28:39] = True
    with np.errstate(invalid="raise"):
        found = smooth(patch(10 ** random.uniform(-3, 4, ground.shape), ground))
    assert np.isfinite(found.values).all()
    assert (found.values >= 0).all()
