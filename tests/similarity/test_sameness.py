from __future__ import annotations

import numpy as np
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.sameness import reduced, same_lines, same_windows, without


def patch(values: np.ndarray, hidden: tuple[slice, slice] | None = None) -> Patch:
    valid = np.ones(values.shape, bool)
    if hidden is not None:
        valid[hidden] = False
    return Patch(values.astype(np.float32), valid)


def test_lines_and_dots_are_the_same_in_other_colours_and_over_faint_ground() -> None:
    rng = np.random.default_rng(3)
    ground = [rng.normal(size=(90, 90)), rng.normal(size=(90, 90))]
    ground[0][:, :45] *= 0.01
    for values, colour in zip(ground, (8.0, -8.0), strict=True):
        values[40] = colour
        values[10, ::9] = colour
    ground[0][40, :45] = ground[0][10, :45:9] = 0.08
    same = same_lines(*map(patch, ground))
    # Where both kinds of ground are near, the faint line is.
    assert same[40, :30].all() and same[40, 60:].all()
    assert same[10, ::9].mean() > 0.7
    # A tenth of each by definition; a hundredth of both by chance.
    away = np.ones_like(same)
    away[[10, 40]] = False
    assert 0.002 < same[away].mean() < 0.03


def test_invalid_pixels_hold_no_lines() -> None:
    hidden = np.s_[20:30, 20:30]
    same = same_lines(patch(texture(60, 60), hidden), patch(texture(60, 60)))
    assert same.any() and not same[hidden].any()
    everything = np.s_[:, :]
    assert not same_lines(patch(texture(60, 60), everything), patch(texture(60, 60))).any()


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
