"""Parts are found by the joint evidence of chips, not by single peaks."""

from __future__ import annotations

import numpy as np
import pytest
from raster_files import utm_grid

from groundtie.matching.parts import LEAST_EXCESS, find_parts, largest_group

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


def highest_of_noise() -> float:
    """Return the mean height of noise within 2 px: the highest of 13 values."""
    return float(np.random.default_rng(1).normal(size=(10_000, 13)).max(axis=1).mean())


@pytest.mark.parametrize("seed", range(5))
def test_noise_has_no_part(seed: int) -> None:
    assert list(find_parts(GRID, CENTRES, noise(seed))) == []


@pytest.mark.parametrize(
    ("lower", "left", "where"), [(3, 7, "bottom"), (0, 3, "left side"), (2, 4, "lower left")]
)
def test_a_part_is_found_though_no_chip_of_it_stands_out(lower: int, left: int, where: str) -> None:
    """Each chip is raised by less than the highest noise; together they are evident."""
    surfaces = noise()
    inside = (CENTRES[:, 1] // 50 >= lower) & (CENTRES[:, 0] // 50 < left)
    by = 4.3
    assert by < surfaces.max()
    raised(surfaces, inside, (9, -6), by)
    (part,) = find_parts(GRID, CENTRES, surfaces)
    assert part.shift_px == (9.0, -6.0)
    assert part.distance_px == pytest.approx(np.hypot(9, 6))
    assert part.where == where
    members = set(np.flatnonzero(inside).tolist())
    assert len(set(part.members) - members) <= 1
    # In one chip of six, noise at the model's place leaves it less than half the mean.
    assert len(members - set(part.members)) <= inside.sum() / 3
    # All but one confirm it: their sum over √n is √n times as high as one of them.
    confirming = inside.sum() - 1
    assert part.excess == pytest.approx((by - highest_of_noise()) * np.sqrt(confirming), rel=0.3)


def test_two_parts_share_no_chip() -> None:
    surfaces = noise()
    raised(surfaces, CENTRES[:, 0] < 150, (9, -6), 6.0)
    raised(surfaces, CENTRES[:, 0] > 200, (-12, 3), 6.0)
    first, second = find_parts(GRID, CENTRES, surfaces)
    assert {first.shift_px, second.shift_px} == {(9.0, -6.0), (-12.0, 3.0)}
    assert not set(first.members) & set(second.members)


def test_what_the_model_has_is_no_part() -> None:
    """Buildings match elsewhere, too, but about as much matches at the model's place."""
    surfaces = noise()
    raised(surfaces, CENTRES[:, 0] < 150, (9, -6), 5.0)
    raised(surfaces, CENTRES[:, 0] < 150, (0, 0), 5.0)
    assert list(find_parts(GRID, CENTRES, surfaces)) == []


@pytest.mark.parametrize(("chips", "found"), [(2, 0), (3, 1)])
def test_two_chips_are_no_part_however_high(chips: int, found: int) -> None:
    surfaces = np.zeros_like(noise())
    raised(surfaces, np.arange(len(CENTRES)) < chips, (9, -6), 100.0)
    assert len(list(find_parts(GRID, CENTRES, surfaces))) == found


def test_one_chip_counts_for_so_much_at_most() -> None:
    surfaces = noise()
    raised(surfaces, np.arange(len(CENTRES)) == 10, (9, -6), 1000.0)
    assert next(find_parts(GRID, CENTRES, surfaces, -np.inf)).excess < LEAST_EXCESS


def test_chips_may_be_missing() -> None:
    kept = np.delete(np.arange(len(CENTRES)), [3, 11, 17])
    surfaces = noise()
    raised(surfaces, CENTRES[:, 0] < 150, (9, -6), 6.0)
    (part,) = find_parts(GRID, CENTRES[kept], surfaces[kept])
    assert (CENTRES[kept][list(part.members), 0] < 150).all()
    assert list(find_parts(GRID, CENTRES[:0], surfaces[:0])) == []


def test_tiles_are_parts_wherever_they_lie() -> None:
    """Two tiles of another date, of 2 × 2 chips each."""
    surfaces = noise()
    col, row = (CENTRES // 50).T
    first, second = (col < 2) & (row < 2), (col > 3) & (col < 6) & (row > 2) & (row < 5)
    raised(surfaces, first | second, (9, -6), 8.0)
    parts = list(find_parts(GRID, CENTRES, surfaces))
    assert {part.shift_px for part in parts} == {(9.0, -6.0)}
    found = [set(part.members) for part in parts]
    for tile in (first, second):
        assert any(set(np.flatnonzero(tile)) <= members for members in found)


def test_scattered_chips_are_no_part() -> None:
    """Canopies are displaced all over a scene, where they fill most of a chip."""
    surfaces = noise()
    col, row = (CENTRES // 50).T
    raised(surfaces, (col % 2 == 0) & (row % 2 == 0), (9, -6), 6.0)
    assert list(find_parts(GRID, CENTRES, surfaces)) == []


@pytest.mark.parametrize(
    ("right", "rows", "found"), [(18, 2, 1), (22, 2, 0), (22, 3, 1), (18, 6, 1), (22, 6, 1)]
)
def test_few_chips_that_are_highest_farther_off_are_no_part(
    right: int, rows: int, found: int
) -> None:
    """Canopies of 30 m are displaced so far, and their peaks extend nearer: 4 of 42 chips, or 6."""
    surfaces = noise()
    at = np.arange(-RADIUS, RADIUS + 1)
    peak = 12 * np.exp(-((at - right) ** 2 + at[:, None] ** 2) / 18)
    surfaces[((100, 50 * rows) > CENTRES).all(axis=1)] += peak.astype(np.float32)
    assert len(list(find_parts(GRID, CENTRES, surfaces))) == found


@pytest.mark.parametrize("seed", range(5))
def test_no_other_set_of_neighbours_is_higher(seed: int) -> None:
    """Tried exhaustively: all five sets of at least three of four chips."""
    four = np.flatnonzero((CENTRES < 100).all(axis=1))
    off = np.hypot(*np.meshgrid(*2 * [np.arange(-RADIUS, RADIUS + 1)]))
    surfaces = np.where(off <= 20, np.minimum(2 * noise(seed)[four], 7.0), -9.0)
    part = next(find_parts(GRID, CENTRES[four], surfaces, -np.inf))
    elsewhere = (off > 4) & (off <= 20)
    higher = surfaces[:, elsewhere] - surfaces[:, off <= 2].max(axis=1)[:, None]
    sets = [np.flatnonzero(bits >> np.arange(4) & 1) for bits in range(16)]
    highest = max(
        float((higher[of].sum(axis=0) - higher[of].max(axis=0)).max() / np.sqrt(len(of) - 1))
        for of in sets
        if len(of) >= 3
    )
    assert part.excess == pytest.approx(highest)


@pytest.mark.parametrize("missing", [0, 1, 3])
def test_chips_on_both_sides_of_a_gap_are_no_neighbours(missing: int) -> None:
    """Three chips in a row make a part; not if water lies between them."""
    kept = (CENTRES[:, 0] // 50 < 2) | (CENTRES[:, 0] // 50 >= 2 + missing)
    row = (CENTRES[:, 1] // 50 == 2) & kept
    three = np.flatnonzero(row)[:3]
    surfaces = noise()
    raised(surfaces, np.isin(np.arange(len(CENTRES)), three), (9, 0), 9.0)
    found = list(find_parts(GRID, CENTRES[kept], surfaces[kept]))
    assert len(found) == (missing == 0)
    chips = np.isin(np.flatnonzero(kept), three)
    assert len(largest_group(CENTRES[kept], chips)) == (3 if missing == 0 else 2)
