from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.special import erf
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.sameness import (
    Edges,
    Gradients,
    count_same,
    edges_apart_px,
    reduced,
    same_windows,
    without,
)


def patch(values: np.ndarray, hidden: tuple[slice, slice] | None = None) -> Patch:
    valid = np.ones(values.shape, bool)
    if hidden is not None:
        valid[hidden] = False
    return Patch(values.astype(np.float32), valid)


def test_all_gradients_of_an_array_and_its_offset_copy_are_the_same() -> None:
    one = texture(60, 60)
    gradients = [Gradients.of(patch(values)) for values in (one, one + 100.0)]
    same, every = count_same(*gradients, (0.1, 0.1))
    assert same == every > 1000


def test_gradients_of_two_places_are_rarely_the_same() -> None:
    """Two vectors of like lengths in any directions: within a quarter of the length, a few %."""
    gradients = [Gradients.of(patch(texture(200, 200, seed))) for seed in (1, 2)]
    limit = float(np.median(gradients[0].length))
    same, every = count_same(*gradients, (limit, limit))
    assert 0 < same < 0.03 * every


def test_gradients_beside_invalid_pixels_do_not_count() -> None:
    one = texture(60, 60)
    hidden = np.s_[20:30, 20:30]
    counts = [
        count_same(Gradients.of(patch(one, where)), Gradients.of(patch(one)), (0.0, 0.0))[1]
        for where in (None, hidden)
    ]
    assert counts[0] - counts[1] == 12 * 12


@pytest.mark.parametrize(("along", "contrast"), [(0.3, 1.0), (-0.45, -0.01)])
def test_edges_are_found_to_a_fraction_of_a_pixel(along: float, contrast: float) -> None:
    """The blurred step of a straight edge: the error function, whose gradient is a Gaussian's."""
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


@pytest.mark.parametrize("shift", [0.0, 0.2, 0.4])
def test_parallel_edges_are_as_far_apart_as_they_are(shift: float) -> None:
    rows, cols = np.indices((80, 80))

    def rings(radius: float) -> Edges:
        distance = np.hypot(cols - 40.0, rows - 40.0)
        return Edges.of(patch(erf(distance - radius)))

    apart = edges_apart_px(rings(25.0), rings(25.0 + shift))
    found = apart[np.isfinite(apart)]
    assert len(found) > 100
    # Parabolas through three points of each place it to 0.08 px (see the test above).
    assert np.median(found) == pytest.approx(shift, abs=0.08)


def test_edges_at_right_angles_are_no_pair() -> None:
    rows, cols = np.indices((60, 60))
    one, other = (Edges.of(patch(erf(along - 30.0))) for along in (rows, cols))
    assert one.found.any() and other.found.any()
    assert not np.isfinite(edges_apart_px(one, other)).any()


def test_weak_edges_pair_with_strong_ones_alone_and_only_if_asked_for() -> None:
    """A copy: each edge lies on itself, if it is a strong one, though beside weaker ones."""
    values = texture(90, 90) + 0.1 * np.random.default_rng(5).normal(size=(90, 90))
    edges = Edges.of(patch(values))
    assert 0 < edges.strong.sum() < edges.found.sum()
    both, one = (np.isfinite(edges_apart_px(edges, edges, which)) for which in (True, False))
    np.testing.assert_array_equal(both, edges.strong)
    beside_weaker = one & ~edges.strong
    assert one[edges.strong].all() and not one[~edges.found].any()
    near_strong = cv2.dilate(edges.strong.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    assert near_strong[beside_weaker].all()


def test_invalid_pixels_hold_no_edges() -> None:
    hidden = np.s_[20:30, 20:30]
    found = Edges.of(patch(texture(60, 60), hidden)).found
    assert found.any() and not found[hidden].any()
    assert not Edges.of(patch(texture(60, 60), np.s_[:, :])).found.any()


def test_windows_are_the_same_where_one_thing_is_drawn_into_both() -> None:
    one, other = texture(120, 120, 1), texture(120, 120, 2)
    drawn = 5 * texture(120, 120, 3)
    where = np.s_[40:80, 40:80]
    one[where], other[where] = drawn[where], drawn[where]
    same = same_windows(patch(one), patch(other))
    assert same[46:74, 46:74].all()
    outside = np.ones(same.shape, bool)
    outside[34:86, 34:86] = False
    assert same[outside].mean() < 0.1


def test_noise_within_a_fifth_of_what_varies_leaves_windows_the_same() -> None:
    rng = np.random.default_rng(4)
    one = texture(120, 120)
    # The difference varies by 2 · 0.2² = 0.08 of what one varies, a 25th of both.
    other = one + 0.2 * rng.normal(size=one.shape)
    assert same_windows(patch(one), patch(other)).mean() > 0.95


def test_invalid_pixels_are_no_part_of_windows() -> None:
    one = texture(60, 60)
    spoilt = one.copy()
    hidden = np.s_[20:40, 20:40]
    spoilt[hidden] = 1e6
    same = same_windows(patch(one), patch(spoilt, hidden))
    assert not same[hidden].any()
    assert same[:20].all()


def test_reduced_pixels_are_means_of_valid_ones() -> None:
    values = np.arange(80.0).reshape(8, 10)
    smaller = reduced(patch(values, np.s_[:4, :3]), 4)
    assert smaller.values.shape == (2, 2)
    # A quarter of the first square is left: the column 3 of the rows 0 to 3.
    np.testing.assert_allclose(smaller.values[0, 0], np.mean([3, 13, 23, 33]))
    np.testing.assert_allclose(smaller.values[1, 1], values[4:8, 4:8].mean())
    assert smaller.valid.all()
    assert not reduced(patch(values, np.s_[:4, :4]), 4).valid[0, 0]


def test_pixels_can_be_hidden() -> None:
    hidden = np.zeros((8, 10), bool)
    hidden[2, 3] = True
    assert not without(patch(np.zeros((8, 10))), hidden).valid[2, 3]
