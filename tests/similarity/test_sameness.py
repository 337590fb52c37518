from __future__ import annotations

import numpy as np
import pytest
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.sameness import (
    Gradients,
    count_same,
    lines,
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


def test_lines_and_dots_are_found_in_any_colour_and_over_faint_ground() -> None:
    ground = np.random.default_rng(3).normal(size=(90, 90))
    ground[:, :45] *= 0.01
    for colour in (8.0, -8.0):
        values = ground.copy()
        values[40, 45:] = values[10, 45::9] = colour
        values[40, :45] = values[10, :45:9] = colour / 100
        found = lines(patch(values))
        # Where both kinds of ground are near, the faint line is.
        assert found[40, :30].all() and found[40, 60:].all()
        assert found[10, 0:30:9].all() and found[10, 63::9].all()
        assert found.mean() == pytest.approx(0.1, abs=0.01)


def test_invalid_pixels_hold_no_lines() -> None:
    hidden = np.s_[20:30, 20:30]
    found = lines(patch(texture(60, 60), hidden))
    assert found.any() and not found[hidden].any()
    assert not lines(patch(texture(60, 60), np.s_[:, :])).any()


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
