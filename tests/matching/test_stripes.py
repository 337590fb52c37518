from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from scipy import ndimage
from textured_pairs import shift_on_map

from groundtie.context import Context
from groundtie.geometry.judging import RIVAL_HEIGHT
from groundtie.geometry.transform import Transform
from groundtie.matching.stripes import find_stripes, survey_stripes
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster

SIDE, RADIUS_PX, ELSEWHERE_PX = 300, 16, 4.0
CANVAS = ndimage.gaussian_filter(np.random.default_rng(7).normal(size=(SIDE + 80,) * 2), 1.5)


def patch(seed: int, shift: tuple[int, int] = (0, 0), margin: int = 0) -> Patch:
    """Return what is seen of the ground (x, y) px off, with a noise of its own."""
    first_row, first_col = 40 - margin - shift[1], 40 - margin - shift[0]
    side = SIDE + 2 * margin
    ground = CANVAS[first_row : first_row + side, first_col : first_col + side] / CANVAS.std()
    noise = np.random.default_rng(seed).normal(size=ground.shape)
    return Patch((10 + ground + noise).astype(np.float32), np.ones(ground.shape, bool))


def striped(angle_deg: float, period: float, share: float, shift: tuple[int, int]) -> Patch:
    """Return the input, of which stripes show the ground `shift` px off."""
    rows, cols = np.indices((SIDE, SIDE))
    angle = np.radians(angle_deg)
    across = np.cos(angle) * rows + np.sin(angle) * cols
    moved = across % period < share * period
    here, there = patch(2), patch(3, shift)
    return Patch(np.where(moved, there.values, here.values), here.valid)


@pytest.mark.parametrize("shift", [(9, -4), (0, 6), (-12, 0)])
@pytest.mark.parametrize(("angle_deg", "period"), [(0, 40), (90, 25), (12, 60), (60, 40)])
def test_stripes_that_lie_elsewhere_are_found(
    angle_deg: float, period: float, shift: tuple[int, int], context: Context
) -> None:
    """A quarter of each chip of 60 px shows other ground."""
    image = striped(angle_deg, period, 0.25, shift)
    found = find_stripes(patch(1, margin=RADIUS_PX), image, RADIUS_PX, ELSEWHERE_PX, context)
    assert found.height > 2 * max(found.own_height, 3)
    assert found.shift_px == pytest.approx(shift, abs=1)


@pytest.mark.parametrize("shift", [(0, 0), (1, -1)])
def test_stripes_in_their_place_do_not_match_elsewhere(
    shift: tuple[int, int], context: Context
) -> None:
    """Neither those with a noise of their own, nor those as far off as matches scatter."""
    image = striped(0, 40, 0.25, shift)
    found = find_stripes(patch(1, margin=RADIUS_PX), image, RADIUS_PX, ELSEWHERE_PX, context)
    assert found.height < 5


def test_images_that_show_nothing_have_no_stripes(context: Context) -> None:
    wide, narrow = ((SIDE + more,) * 2 for more in (2 * RADIUS_PX, 0))
    for valid in (True, False):
        empty = [Patch(np.ones(size, np.float32), np.full(size, valid)) for size in (wide, narrow)]
        found = find_stripes(*empty, RADIUS_PX, ELSEWHERE_PX, context)
        assert found.height == 0


@pytest.mark.parametrize("size", [(3, 200), (200, 5), (1, 1)])
def test_narrow_images_are_compared_too(size: tuple[int, int], context: Context) -> None:
    def part(image: Patch, more: int) -> Patch:
        rows, cols = (slice(side + more) for side in size)
        return Patch(image.values[rows, cols], image.valid[rows, cols])

    one, other = part(patch(1, margin=RADIUS_PX), 2 * RADIUS_PX), part(patch(2), 0)
    found = find_stripes(one, other, RADIUS_PX, ELSEWHERE_PX, context)
    assert found.own_height > found.height or found.height < 5


def test_stripes_without_data_are_no_evidence(context: Context) -> None:
    """Gaps are filled with anything, here with one value, and masked."""
    image = striped(0, 40, 0.25, (9, -4))
    gaps = np.indices(image.valid.shape)[0] % 40 < 10
    masked = Patch(np.where(gaps, np.float32(0), image.values), image.valid & ~gaps)
    found = find_stripes(patch(1, margin=RADIUS_PX), masked, RADIUS_PX, ELSEWHERE_PX, context)
    assert found.height < 5


@pytest.mark.parametrize("is_left", [True, False])
def test_narrow_stripes_in_half_of_a_large_scene_are_found(
    is_left: bool, tmp_path: Path, context: Context
) -> None:
    """Of 10 px, in an image of 1800 px that is displaced as a whole, too."""
    size, whole, off = (600, 1800), (7, -3), (-9, 12)
    ground = ndimage.gaussian_filter(np.random.default_rng(3).normal(size=(700, 1900)), 1.5)

    def seen(seed: int, shift: tuple[int, int]) -> np.ndarray:
        noise = np.random.default_rng(seed).normal(size=size)
        first_col, first_row = 50 - shift[0], 50 - shift[1]
        piece = ground[first_row : first_row + size[0], first_col : first_col + size[1]]
        return 200 + 20 * (piece / ground.std() + noise)

    rows, cols = np.indices(size)
    moved = (rows % 40 < 10) & ((cols < 900) == is_left)
    there = whole[0] + off[0], whole[1] + off[1]
    input = np.where(moved, seen(2, there), seen(1, whole))
    paths = [
        write_raster(tmp_path / f"{n}.tif", image.astype(np.float32), utm_grid(*size[::-1]))
        for n, image in enumerate((seen(0, (0, 0)), input))
    ]
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=500.0)
        # Pixels of 10 m; the map's y axis points up.
        model = shift_on_map(10.0 * whole[0], -10.0 * whole[1])
        transform = Transform(model, pair.grid.crs, other.grid)
        found = survey_stripes(pair, pair.grid, transform, ELSEWHERE_PX, context)
    assert found.height > max(found.own_height / RIVAL_HEIGHT, 6)
    assert found.shift_px == pytest.approx(off, abs=2)
