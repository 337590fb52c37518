from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from masks.scenes import scene_of
from masks.town import Town, draw_town
from scipy.ndimage import distance_transform_edt

from groundtie.errors import RasterContentError
from groundtie.masks import reduced
from groundtie.masks.regions import GroundRegions, find_regions
from groundtie.rasters.reading import Window


@pytest.fixture(scope="module")
def town() -> Town:
    return draw_town()


@pytest.fixture(scope="module")
def ground(town: Town, tmp_path_factory: pytest.TempPathFactory) -> GroundRegions:
    return find_regions(scene_of(tmp_path_factory.mktemp("town") / "a.tif", town.amplitude))


def test_ground_is_found_and_roofs_and_shadows_are_not(town: Town, ground: GroundRegions) -> None:
    for name in ("road", "river", "park"):
        assert ground.regions.blocks[getattr(town, name)].mean() > 0.75, name
    assert ground.regions.blocks[town.roofs].mean() < 0.03
    assert ground.regions.blocks[town.shadow].mean() < 0.03


@pytest.mark.parametrize("looks", [1.0, 8.0])
def test_it_holds_for_other_speckle(town: Town, tmp_path: Path, looks: float) -> None:
    other = draw_town(looks=looks, seed=3)
    found = find_regions(scene_of(tmp_path / "a.tif", other.amplitude))
    assert found.regions.blocks[other.ground].mean() > 0.7
    assert found.regions.blocks[other.roofs | other.shadow].mean() < 0.05


def test_the_skeleton_runs_along_the_middle_of_the_road(town: Town, ground: GroundRegions) -> None:
    inside = distance_transform_edt(town.road)[ground.skeleton.blocks & town.road]
    # The road is 12 px wide.
    assert np.median(inside) > 4
    along = np.hypot(400, 60) + np.hypot(150, 30) + np.hypot(250, 70)
    assert 0.7 * along < ground.skeleton_m < 1.3 * along


def test_the_skeleton_is_broadened_by_the_window(town: Town, tmp_path: Path) -> None:
    scene = scene_of(tmp_path / "a.tif", town.amplitude)
    # Where nothing but the road is near.
    alone = distance_transform_edt(~(town.river | town.park)) > 40
    for width_m in (15.0, 19.0):
        found = find_regions(scene, width_m)
        away = distance_transform_edt(~found.skeleton.blocks)
        # Half the window, and a border of 3 m.
        assert found.part.blocks[away < width_m / 2 + 2].all()
        near_road = alone & (distance_transform_edt(~town.road) < 30)
        assert away[found.part.blocks & near_road].max() < width_m / 2 + 3 + 1.5


def test_the_brightest_inside_take_no_part(town: Town, tmp_path: Path) -> None:
    scene = scene_of(tmp_path / "a.tif", town.amplitude)
    shares = []
    for percent in (0.0, 10.0, 30.0):
        found = find_regions(scene, high_percent=percent)
        shares.append(found.select(scene.whole).part.sum() / found.part.blocks.sum())
    np.testing.assert_allclose(shares, [1.0, 0.9, 0.7], atol=0.02)


def test_windows_are_cut_from_one_and_the_same_mask(ground: GroundRegions) -> None:
    whole = ground.part.select(ground.part.scene.whole).part
    np.testing.assert_array_equal(whole, ground.part.blocks)
    window = Window(35, 120, 90, 77)
    part = ground.part.select(window).part
    np.testing.assert_array_equal(part, whole[120:197, 35:125])
    beyond = ground.part.select(Window(-20, 390, 50, 40)).part
    assert not beyond[:, :20].any() and not beyond[10:].any()


def test_the_brightest_inside_are_the_same_in_every_window(ground: GroundRegions) -> None:
    whole = ground.select(ground.part.scene.whole).part
    halves = [ground.select(Window(col, 0, 200, 400)).part for col in (0, 200)]
    np.testing.assert_array_equal(np.hstack(halves), whole)


def test_larger_scenes_are_looked_at_with_larger_pixels(
    town: Town, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reduced, "_MOST_PIXELS", 100 * 100 * 4)
    found = find_regions(scene_of(tmp_path / "a.tif", town.amplitude))
    assert found.part.factor == 2 and found.part.blocks.shape == (200, 200)
    chosen = found.select(found.part.scene.whole)
    assert chosen.part.shape == (400, 400)
    assert chosen.part[town.river].mean() > 0.5
    assert chosen.part[town.roofs].mean() < 0.1


@pytest.mark.parametrize("factor", [1, 2, 3, 4, 5])
def test_as_many_percent_take_no_part_in_larger_scenes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, factor: int
) -> None:
    """Fields under speckle of three looks, of four levels."""
    random = np.random.default_rng(0)
    side, fields = 960, 6
    levels = np.array([0.5, 1, 2, 4])[random.integers(0, 4, (fields, fields))]
    power = np.kron(levels, np.ones((side // fields,) * 2)) * random.gamma(3, 1 / 3, (side, side))
    scene = scene_of(tmp_path / "a.tif", (100 * np.sqrt(power)).astype(np.float32))
    monkeypatch.setattr(reduced, "_MOST_PIXELS", (side // factor) ** 2)
    found = find_regions(scene, high_percent=10.0)
    assert found.part.factor == factor
    inside = found.part.cut(scene.whole)
    assert inside.mean() > 0.2
    assert found.select(scene.whole).part.sum() / inside.sum() == pytest.approx(0.9, abs=0.02)


def test_what_holds_no_data_takes_no_part(town: Town, tmp_path: Path) -> None:
    image = town.amplitude.copy()
    image[:, :100] = 0
    scene = scene_of(tmp_path / "a.tif", image, nodata=0)
    assert not find_regions(scene).select(scene.whole).part[:, :100].any()
    with pytest.raises(RasterContentError, match="no valid pixels"):
        find_regions(scene_of(tmp_path / "b.tif", np.zeros_like(image), nodata=0))


def test_without_any_ground_nothing_takes_part(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).lognormal(5, 1.5, (200, 200)).astype(np.float32)
    found = find_regions(scene_of(tmp_path / "a.tif", noise))
    assert found.part.blocks.mean() < 0.02 and found.skeleton_m < 50
