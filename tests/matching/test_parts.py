"""Parts are found by what rectangles of chips show together, not by single peaks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from raster_files import utm_grid

from groundtie.matching.parts import (
    LEAST_EXCESS,
    excess_if_weak,
    find_parts,
    highest_part,
)
from groundtie.matching.survey import Survey

RADIUS = 24
COLS, ROWS = 7, 6
SIDE = 2 * RADIUS + 1
GRID = utm_grid(COLS * 50, ROWS * 50)
CENTRES = np.stack(np.meshgrid(np.arange(COLS) * 50 + 25, np.arange(ROWS) * 50 + 25), -1).reshape(
    -1, 2
)


def noise(seed: int = 0) -> np.ndarray:
    """Return surfaces of noise, one for each chip."""
    return np.random.default_rng(seed).normal(size=(len(CENTRES), SIDE, SIDE)).astype(np.float32)


def raised(surfaces: np.ndarray, chips: np.ndarray, shift: tuple[int, int], by: float) -> None:
    surfaces[np.flatnonzero(chips), RADIUS + shift[1], RADIUS + shift[0]] += by


@pytest.mark.parametrize("seed", range(5))
def test_noise_has_no_part(seed: int) -> None:
    assert find_parts(GRID, CENTRES, noise(seed)) == []


@pytest.mark.parametrize(
    ("lower", "left", "where"), [(3, 7, "lower"), (0, 3, "left"), (3, 3, "lower left")]
)
def test_a_part_is_found_though_no_chip_of_it_stands_out(lower: int, left: int, where: str) -> None:
    """Each chip is raised by less than noise is high somewhere; together they are evident."""
    surfaces = noise()
    inside = (CENTRES[:, 1] // 50 >= lower) & (CENTRES[:, 0] // 50 < left)
    by = 4.0
    assert by < surfaces.max()
    raised(surfaces, inside, (9, -6), by)
    (part,) = find_parts(GRID, CENTRES, surfaces)
    assert part.shift_px == (9.0, -6.0)
    assert part.distance_px == pytest.approx(np.hypot(9, 6))
    assert part.where == where
    wrong = set(part.members) ^ set(np.flatnonzero(inside).tolist())
    assert len(wrong) <= 0.15 * inside.sum() + 1
    # The sum of n surfaces, over the square root of n, is as high as one by the square root of n.
    assert part.height == pytest.approx(by * np.sqrt(inside.sum()), abs=2.5)


def test_two_parts_share_no_chip() -> None:
    surfaces = noise()
    raised(surfaces, CENTRES[:, 0] < 150, (9, -6), 6.0)
    raised(surfaces, CENTRES[:, 0] > 200, (-12, 3), 6.0)
    first, second = find_parts(GRID, CENTRES, surfaces)
    assert {first.shift_px, second.shift_px} == {(9.0, -6.0), (-12.0, 3.0)}
    assert not set(first.members) & set(second.members)


def test_what_the_model_has_is_no_part() -> None:
    """Buildings match elsewhere, too, among as much that matches where the model has it."""
    surfaces = noise()
    raised(surfaces, CENTRES[:, 0] < 150, (9, -6), 5.0)
    raised(surfaces, CENTRES[:, 0] < 150, (0, 0), 5.0)
    assert find_parts(GRID, CENTRES, surfaces) == []


@pytest.mark.parametrize(("chips", "found"), [(2, 0), (3, 1)])
def test_two_chips_are_no_part_however_high(chips: int, found: int) -> None:
    surfaces = np.zeros_like(noise())
    raised(surfaces, np.arange(len(CENTRES)) < chips, (9, -6), 100.0)
    assert len(find_parts(GRID, CENTRES, surfaces)) == found


def test_one_chip_counts_for_so_much_at_most() -> None:
    surfaces = noise()
    raised(surfaces, np.arange(len(CENTRES)) == 10, (9, -6), 1000.0)
    part = highest_part(GRID, CENTRES, surfaces, np.arange(len(CENTRES)))
    assert part is not None
    assert part.excess < LEAST_EXCESS


def test_chips_may_be_missing() -> None:
    kept = np.delete(np.arange(len(CENTRES)), [3, 11, 17])
    surfaces = noise()
    raised(surfaces, CENTRES[:, 0] < 150, (9, -6), 6.0)
    (part,) = find_parts(GRID, CENTRES[kept], surfaces[kept])
    assert (CENTRES[kept][list(part.members), 0] < 150).all()
    assert find_parts(GRID, CENTRES[:0], surfaces[:0]) == []


def test_less_speaks_for_a_part_where_less_speaks_for_the_model() -> None:
    surfaces = noise()
    raised(surfaces, np.isin(np.arange(len(CENTRES)), [0, 1, 2, 7, 8, 9]), (9, -6), 4.1)
    part = highest_part(GRID, CENTRES, surfaces, np.arange(len(CENTRES)))
    assert part is not None
    weak = excess_if_weak(len(CENTRES), False)
    assert weak <= part.excess < LEAST_EXCESS
    shifts = np.zeros((len(CENTRES), 2))
    confirmed = Survey(GRID, CENTRES, shifts, surfaces, excess_if_weak=weak)
    assert confirmed.parts == []
    shifts[: len(CENTRES) // 2 + 1] = 5.0
    assert [one.members for one in replace(confirmed, shifts_px=shifts).parts] == [part.members]


def test_what_a_weakly_confirmed_part_needs_grows_with_the_chips() -> None:
    """As the sum of chips that are all one standard deviation higher, over that of noise."""
    assert excess_if_weak(49, is_masked=False) == excess_if_weak(9, is_masked=True) == 7.0
    assert excess_if_weak(36, is_masked=False) == 6.0
    assert excess_if_weak(9, is_masked=False) == 5.0
    assert excess_if_weak(100, is_masked=False) == 7.0
