from __future__ import annotations

import numpy as np
from scipy.ndimage import label

from groundtie.masks.growing import Shape, grow_regions

TOLERANCE = 2.0


def painted(level: np.ndarray, regions: list) -> np.ndarray:
    numbers = np.zeros(level.shape, int)
    for number, region in enumerate(regions, start=1):
        box = region.box
        part = numbers[box.row : box.row + box.height, box.col : box.col + box.width]
        assert not part[region.mask].any()
        part[region.mask] = number
    return numbers


def grown(level: np.ndarray, variation2: np.ndarray | None = None, smallest: int = 1) -> list:
    if variation2 is None:
        variation2 = np.zeros(level.shape, np.float32)
    valid = np.ones(level.shape, bool)
    return list(grow_regions(level, variation2, valid, 0.5, TOLERANCE, smallest))


def test_regions_are_the_connected_parts_of_like_level() -> None:
    level = np.full((64, 96), -20, np.float32)
    level[:, 40:60] = -12
    level[10:30, 70:90] = -12
    level += np.random.default_rng(0).uniform(-0.9, 0.9, level.shape).astype(np.float32)
    numbers = painted(level, grown(level))
    expected = label(level > -16)[0] + 10 * label(level <= -16)[0]
    pairs = set(zip(numbers.ravel(), expected.ravel(), strict=True))
    assert (numbers > 0).all()
    assert len(pairs) == len(np.unique(expected)) == len(np.unique(numbers))


def test_a_region_ends_where_the_level_leaves_the_tolerance() -> None:
    """A slope is not followed for ever: the seed's level counts, not the neighbour's."""
    level = np.tile(np.linspace(0, 40, 200, dtype=np.float32), (32, 1))
    for region in grown(level):
        box = region.box
        inside = level[box.row : box.row + box.height, box.col : box.col + box.width][region.mask]
        assert inside.max() - inside.min() <= 2 * TOLERANCE


def test_only_homogeneous_places_are_seeds() -> None:
    level = np.zeros((64, 64), np.float32)
    level[:, 32:] = 10
    variation2 = np.where(level > 5, 0.9, 0.1).astype(np.float32)
    (region,) = grown(level, variation2)
    assert region.level_db == 0 and region.mask.sum() == 64 * 32


def test_small_regions_and_invalid_pixels_are_left_out() -> None:
    level = np.zeros((64, 64), np.float32)
    level[8:16, 8:16] = 20
    valid = np.ones(level.shape, bool)
    valid[40:] = False
    variation2 = np.zeros_like(level)
    regions = list(grow_regions(level, variation2, valid, 0.5, TOLERANCE, 100))
    assert (painted(level, regions) > 0).sum() == 40 * 64 - 64


class TestShape:
    def test_a_rectangle_has_its_own_sides(self) -> None:
        mask = np.zeros((60, 80), bool)
        mask[10:22, 5:65] = True
        shape = Shape.of(mask)
        np.testing.assert_allclose([shape.area, shape.length, shape.width], [720, 60, 12])
        assert abs(shape.elongation - 5) < 1e-6

    def test_turning_changes_nothing(self) -> None:
        cols, rows = np.meshgrid(np.arange(200), np.arange(200))
        along = (cols - 100) * np.cos(0.6) + (rows - 100) * np.sin(0.6)
        across = (rows - 100) * np.cos(0.6) - (cols - 100) * np.sin(0.6)
        shape = Shape.of((np.abs(along) < 60) & (np.abs(across) < 10))
        np.testing.assert_allclose([shape.length, shape.width], [120, 20], rtol=0.02)
