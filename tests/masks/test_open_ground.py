"""Ground without texture: fields and their borders take part, forests do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from canopies import Country, draw_country
from raster_files import utm_grid, write_raster
from scipy.ndimage import distance_transform_edt

from groundtie.masks.open_ground import OpenGround
from groundtie.masks.scene import Scene
from groundtie.rasters.reading import Window, open_raster

SIZE = 300


def ground_of(path: Path, image: np.ndarray, pixel_m: float = 1.0) -> OpenGround:
    write_raster(path, image, utm_grid(image.shape[1], image.shape[0], pixel_m), nodata=0)
    return OpenGround.of(Scene.of(open_raster(path)))


@pytest.fixture(scope="module")
def country() -> Country:
    return draw_country(SIZE, 0.4)


@pytest.mark.parametrize("looks", [1.0, 2.0, 4.0])
def test_fields_and_borders_take_part_and_forests_do_not(
    country: Country, tmp_path: Path, looks: float
) -> None:
    ground = ground_of(tmp_path / "a.tif", country.seen(0, looks, 1))
    assert ground.looks == pytest.approx(looks, rel=0.15)
    part, valid = ground.select(ground.scene.whole)
    assert valid.all()
    beside_m = distance_transform_edt(~country.is_forest)
    assert part[country.is_forest].mean() < 0.01
    # Layover and shadow of trees reach 15 m.
    assert part[(beside_m > 0) & (beside_m < 10)].mean() < 0.05
    fields = beside_m > 25
    assert part[fields].mean() > 0.95
    assert part[fields & country.is_border].mean() > 0.9


def test_any_window_of_it_is_the_same(country: Country, tmp_path: Path) -> None:
    ground = ground_of(tmp_path / "a.tif", country.seen(0, 2.0, 1))
    whole = ground.select(ground.scene.whole).part
    window = Window(70, 110, 90, 50)
    assert np.array_equal(ground.select(window).part, whole[window.slices_in(ground.scene.whole)])
    piece = ground.scene.grid.window(*window)
    assert np.array_equal(~ground(piece), whole[window.slices_in(ground.scene.whole)])
    # A reduced grid's pixel is the mean of nine, all of which must take part.
    nine = whole.reshape(SIZE // 3, 3, SIZE // 3, 3).all(axis=(1, 3))
    reduced = ground.scene.grid.scaled(3.0).window(20, 40, 30, 10)
    assert np.array_equal(~ground(reduced), nine[40:50, 20:50])


def test_trees_reach_fewer_of_larger_pixels(country: Country, tmp_path: Path) -> None:
    image = country.seen(0, 2.0, 1)
    beside_px = distance_transform_edt(~country.is_forest)
    # The same image in pixels of 1 m and of 3 m: 15 m are 15 px and 5 px.
    fine, coarse = (
        beside_px[g.select(g.scene.whole).part].min()
        for g in (ground_of(tmp_path / f"{m:g}.tif", image, m) for m in (1.0, 3.0))
    )
    assert 6 < fine - coarse < 14


def test_invalid_pixels_take_no_part_and_have_no_texture(country: Country, tmp_path: Path) -> None:
    image = country.seen(0, 2.0, 1)
    image[200:, 200:] = 0
    ground = ground_of(tmp_path / "a.tif", image)
    part, valid = ground.select(ground.scene.whole)
    assert not valid[200:, 200:].any() and not part[200:, 200:].any()
    beside = np.zeros(image.shape, bool)
    beside[170:200, 200:] = True
    assert part[beside].mean() > 0.9
