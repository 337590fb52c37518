from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.in_common import Look, sameness_of
from groundtie.similarity.sameness import Edges, Windows, edges_apart_px
from groundtie.similarity.seams import step_products


def patch(values: np.ndarray, hidden: tuple[slice, slice] | None = None) -> Patch:
    valid = np.ones(values.shape, bool)
    if hidden is not None:
        valid[hidden] = False
    return Patch(values.astype(np.float32), valid)


@pytest.mark.parametrize(("along", "contrast"), [(0.3, 1.0), (-0.45, -0.01)])
def test_edges_are_found_to_a_fraction_of_a_pixel(along: float, contrast: float) -> None:
    """The blurred step of a straight edge: the error function, whose gradient is a Gaussian."""
    rows, cols = np.indices((61, 61))
    normal = np.array([np.cos(0.4), np.sin(0.4)])
    from_edge = (cols - 30) * normal[0] + (rows - 30) * normal[1] - along
    edges = Edges.of(patch(contrast * erf(from_edge)))
    assert edges.strong[30, 30] or edges.strong[30, 31] or edges.strong[30, 29]
    near = edges.strong.copy()
    near[:12], near[-12:], near[:, :12], near[:, -12:] = False, False, False, False
    assert near.sum() > 30
    at = np.stack([cols + edges.offset * edges.x, rows + edges.offset * edges.y], axis=-1)
    off = (at - 30) @ normal - along
    np.testing.assert_allclose(off[near], 0, atol=0.08)


@pytest.mark.parametrize("shift", [0.0, 0.2, 0.4, 1.0, 1.7])
def test_parallel_edges_are_as_far_apart_as_they_are(shift: float) -> None:
    rows, cols = np.indices((80, 80))

    def rings(radius: float) -> Edges:
        distance = np.hypot(cols - 40.0, rows - 40.0)
        return Edges.of(patch(erf(distance - radius)))

    apart = edges_apart_px(rings(25.0), rings(25.0 + shift))
    found = apart[np.isfinite(apart)]
    assert len(found) > 100
    # Parabolas through three points of each edge locate it to 0.08 px (see the test above). The
    # inner edge is brighter on its outer side, where the other edge lies.
    assert np.median(found) == pytest.approx(shift, abs=0.08)


def test_distances_are_negative_on_the_darker_side() -> None:
    """One edge lies 1.5 px on the darker side, one 1 px on the brighter side."""
    cols = np.indices((80, 80))[1]

    def steps(*places: float) -> Edges:
        edges = [erf((cols - place) / 0.6) for place in places]
        return Edges.of(patch(np.sum(edges, axis=0)))

    alone = steps(40.0)
    for place in (38.5, 41.0):
        apart = edges_apart_px(alone, steps(place))[0]
        assert np.median(apart[np.isfinite(apart)]) == pytest.approx(place - 40, abs=0.1)


def test_edges_at_right_angles_are_no_pair() -> None:
    rows, cols = np.indices((60, 60))
    one, other = (Edges.of(patch(erf(along - 30.0))) for along in (rows, cols))
    assert one.found.any() and other.found.any()
    assert not np.isfinite(edges_apart_px(one, other)).any()


@pytest.mark.parametrize("shift", [(0, 0), (7, 0), (-4, 9)])
def test_a_copy_moved_by_whole_pixels_coincides_at_that_shift_alone(
    shift: tuple[int, int],
) -> None:
    values = texture(120, 120)
    one = Edges.of(patch(values)).inner(25)
    other = Edges.of(patch(np.roll(values, (shift[1], shift[0]), (0, 1))))
    apart = edges_apart_px(one, other, np.array([shift, (shift[0] + 5, shift[1] - 3)]))
    assert apart.shape == (2, one.found.sum())
    # New pixels at the rim change which of the faintest gradients are edges.
    assert (np.abs(apart[0]) < 1e-3).mean() > 0.95
    assert (np.abs(apart[1]) < 0.25).mean() < 0.2


def test_the_strongest_edges_are_some_of_all_and_inner_ones_far_from_the_rim() -> None:
    edges = Edges.of(patch(texture(90, 90)))
    strongest = edges.strongest
    assert 0 < strongest.found.sum() < edges.found.sum()
    np.testing.assert_array_equal(strongest.found, edges.strong)
    rows, cols = np.nonzero(edges.inner(20).found)
    assert min(rows.min(), cols.min()) == 20 and max(rows.max(), cols.max()) == 69


def test_invalid_pixels_hold_no_edges() -> None:
    hidden = np.s_[20:30, 20:30]
    found = Edges.of(patch(texture(60, 60), hidden)).found
    assert found.any() and not found[hidden].any()
    assert not Edges.of(patch(texture(60, 60), np.s_[:, :])).found.any()


@pytest.mark.parametrize("scale", [1.0, 1 / 255, 257.0])
def test_windows_are_the_same_where_one_thing_is_drawn_into_both(scale: float) -> None:
    """Whatever the unit of grey values: 8 bits, 16 bits, reflectances."""
    one, other = texture(120, 120, 1), texture(120, 120, 2)
    drawn = 5 * texture(120, 120, 3)
    where = np.s_[40:80, 40:80]
    one[where], other[where] = drawn[where], drawn[where]
    same = Windows.of(patch(one), patch(scale * other)).same
    assert same[46:74, 46:74].all()
    outside = np.ones(same.shape, bool)
    outside[34:86, 34:86] = False
    assert same[outside].mean() < 0.1


def test_windows_of_one_grey_value_in_both_are_the_same() -> None:
    """Even if they are most of the images, whose rounding is then no scale."""
    one, other = np.full((120, 120), 40_000.0), np.full((120, 120), 0.3)
    one[40:80, 40:80] += 500 * texture(40, 40)
    other[40:80, 40:80] += 0.01 * texture(40, 40)
    assert Windows.of(patch(one), patch(other)).same.mean() > 0.95


@pytest.mark.parametrize("strong", [1e2, 1e3, 1e4])
def test_a_strong_scatterer_makes_no_window_the_same(strong: float) -> None:
    """Powers of two radar images with one pixel 33 to 53 dB above the others."""
    rng = np.random.default_rng(0)
    one, other = rng.exponential(0.05, (2, 100, 100))
    one[50, 50] = other[50, 50] = strong
    assert Windows.of(patch(one), patch(other)).same.mean() == pytest.approx(0.0081, abs=0.001)


def test_noise_within_a_fifth_of_what_varies_leaves_windows_the_same() -> None:
    rng = np.random.default_rng(4)
    one = texture(120, 120)
    # The variance of the difference is 2 · 0.2² = 0.08 of one image's, a 25th of both.
    other = one + 0.2 * rng.normal(size=one.shape)
    assert Windows.of(patch(one), patch(other)).same.mean() > 0.95


@pytest.mark.parametrize(("gain", "noise", "least", "most"), [(-1.5, 0.3, 0.9, 1), (1, 2, 0, 0.1)])
def test_windows_are_related_as_far_as_one_explains_the_other(
    gain: float, noise: float, least: float, most: float
) -> None:
    """For unit variance, noise leaves 1 / (1 + noise² / gain²): 0.96 of it, and 0.2."""
    rng = np.random.default_rng(4)
    one = texture(120, 120)
    other = 50 + gain * one + noise * rng.normal(size=one.shape)
    assert least <= Windows.of(patch(one), patch(other)).related.mean() <= most


def test_windows_of_two_places_are_rarely_related() -> None:
    related = Windows.of(*(patch(texture(200, 200, seed)) for seed in (1, 2))).related
    assert 0 < related.mean() < 0.25


def test_no_window_of_one_grey_value_is_related_to_one_that_varies() -> None:
    """Nothing of the one follows from the other, which shows nothing, such as a sea."""
    one, other = texture(120, 120, 1), texture(120, 120, 2)
    other[:, 40:] = 5
    constant = np.s_[:, 44:]
    for pair in ((one, other), (other, one)):
        assert not Windows.of(*map(patch, pair)).related[constant].any()
    # Where both hold one grey value, as copies may, they are still related.
    one[:, 40:] = 300
    assert Windows.of(patch(one), patch(other)).related[constant].all()


def test_invalid_pixels_are_no_part_of_windows() -> None:
    one = texture(60, 60)
    spoilt = one.copy()
    hidden = np.s_[20:40, 20:40]
    spoilt[hidden] = 1e6
    same = Windows.of(patch(one), patch(spoilt, hidden)).same
    assert not same[hidden].any()
    assert same[:20].all()


@pytest.mark.parametrize("level", [40.0, -40.0])
def test_what_varies_alike_is_as_much_brighter_as_it_is(level: float) -> None:
    """Two levels with shares p and 1 − p are 1 / √(p (1 − p)) standard deviations apart."""
    random, shape, width = np.random.default_rng(0), (200, 200), 60
    common = random.normal(size=shape)
    images = []
    for gain in (1.0, 3.0):
        image = random.normal(size=shape)
        image[:, :width] = common[:, :width] + level
        images.append(patch(gain * image + 7))
    found = sameness_of([Look.of(*images)], [step_products(*images)])
    share = width / shape[1]
    expected = np.sign(level) / np.sqrt(share * (1 - share))
    assert found.brighter == pytest.approx(expected, rel=0.05)
