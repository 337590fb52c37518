from __future__ import annotations

from pathlib import Path
from typing import Any

import fiona
import numpy as np
import pytest
from affine import Affine
from raster_files import UTM, utm_grid, write_raster
from rasterio.warp import transform

from groundtie.errors import GeoreferencingError, VectorLayerError
from groundtie.masks.layer import read_layer
from groundtie.masks.scene import Scene
from groundtie.rasters.grid import LON_LAT, Grid
from groundtie.rasters.reading import Window, open_raster

GRID = utm_grid(80, 60, 2.0)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    image = np.ones((60, 80), np.uint8)
    image[:5] = 0
    return Scene.of(open_raster(write_raster(tmp_path / "a.tif", image, GRID, nodata=0)))


def layer_of(
    path: Path, geometry: dict[str, Any], crs: str | None = UTM.to_wkt(), driver: str = "GeoJSON"
) -> Path:
    schema = {"geometry": geometry["type"], "properties": {}}
    with fiona.open(path, "w", driver=driver, crs_wkt=crs, schema=schema) as layer:
        layer.write({"type": "Feature", "geometry": geometry, "properties": {}})
    return path


def on_map(px: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in GRID.pixel_to_map(px)]


def test_a_polygon_takes_in_the_pixels_whose_centres_it_covers(
    scene: Scene, tmp_path: Path
) -> None:
    ring = on_map([(9.6, 19.6), (30.4, 19.6), (30.4, 40.4), (9.6, 40.4), (9.6, 19.6)])
    path = layer_of(tmp_path / "a.gpkg", {"type": "Polygon", "coordinates": [ring]}, driver="GPKG")
    chosen = read_layer(path, scene, 5.0).select(scene.whole)
    expected = np.zeros((60, 80), bool)
    expected[20:41, 10:31] = True
    np.testing.assert_array_equal(chosen.part, expected)
    assert not chosen.valid[:5].any() and chosen.valid[5:].all()


def test_areas_and_lines_of_a_collection_count(scene: Scene, tmp_path: Path) -> None:
    ring = on_map([(9.6, 19.6), (30.4, 19.6), (30.4, 40.4), (9.6, 40.4), (9.6, 19.6)])
    parts = [
        {"type": "Polygon", "coordinates": [ring]},
        {"type": "LineString", "coordinates": on_map([(60, -20), (60, 100)])},
    ]
    path = layer_of(
        tmp_path / "a.gpkg", {"type": "GeometryCollection", "geometries": parts}, driver="GPKG"
    )
    expected = np.zeros((60, 80), bool)
    expected[20:41, 10:31] = True
    # 10 m are 5 px.
    expected[5:, 58:63] = True
    chosen = read_layer(path, scene, 10.0).select(scene.whole).part
    np.testing.assert_array_equal(chosen, expected)


def test_a_line_is_as_wide_as_told_and_holds_for_every_window(scene: Scene, tmp_path: Path) -> None:
    line = on_map([(-20, 30), (100, 30)])
    path = layer_of(tmp_path / "a.gpkg", {"type": "LineString", "coordinates": line}, driver="GPKG")
    mask = read_layer(path, scene, 10.0)
    chosen = mask.select(scene.whole).part
    # 10 m are 5 px.
    expected = np.zeros((60, 80), bool)
    expected[28:33] = True
    np.testing.assert_array_equal(chosen, expected)
    part = mask.select(Window(13, 25, 40, 6)).part
    np.testing.assert_array_equal(part, expected[25:31, 13:53])


@pytest.mark.parametrize(("latitude", "across"), [(0.0, 11), (60.0, 23)])
def test_a_line_is_as_wide_in_degrees(tmp_path: Path, latitude: float, across: int) -> None:
    """At 60° a pixel's width is half of its height; lines have odd numbers of pixels."""
    step = 1 / 111_195
    grid = Grid(Affine(step, 0, 10, 0, -step, latitude + 50 * step), LON_LAT, 101, 101)
    image = write_raster(tmp_path / "a.tif", np.ones((101, 101), np.uint8), grid)
    scene = Scene.of(open_raster(image))
    for end, axis, wide_px in (((50, 100), 1, across), ((100, 50), 0, 11)):
        start = (end[0] % 100, end[1] % 100)
        line = [(float(x), float(y)) for x, y in grid.pixel_to_map([start, end])]
        path = layer_of(
            tmp_path / f"{axis}.geojson", {"type": "LineString", "coordinates": line}, "EPSG:4326"
        )
        chosen = read_layer(path, scene, 11.2).select(scene.whole).part
        assert np.take(chosen, 50, axis=1 - axis).sum() == wide_px


def test_a_layer_in_another_crs_lies_where_it_should(scene: Scene, tmp_path: Path) -> None:
    ring = on_map([(10, 10), (50, 10), (50, 50), (10, 50), (10, 10)])
    degrees = list(zip(*transform(UTM, "EPSG:4326", *zip(*ring, strict=True)), strict=True))
    geometry = {"type": "Polygon", "coordinates": [degrees]}
    chosen = read_layer(layer_of(tmp_path / "a.geojson", geometry, "EPSG:4326"), scene, 5.0).select(
        scene.whole
    )
    assert chosen.part[12:49, 12:49].all()
    assert chosen.part.sum() == pytest.approx(40 * 40, abs=90)


@pytest.mark.slow
def test_what_cannot_be_a_mask_is_an_error(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "a.gpkg").write_text("nothing")
    with pytest.raises(VectorLayerError, match="cannot read the vector layer"):
        read_layer(tmp_path / "a.gpkg", scene, 5.0)
    point = {"type": "Point", "coordinates": on_map([(10, 10)])[0]}
    path = layer_of(tmp_path / "b.gpkg", point, driver="GPKG")
    with pytest.raises(VectorLayerError, match="neither polygons nor lines"):
        read_layer(path, scene, 5.0)
    line = {"type": "LineString", "coordinates": on_map([(0, 0), (9, 9)])}
    path = layer_of(tmp_path / "c.gpkg", line, driver="GPKG")
    bare = Scene.of(open_raster(write_raster(tmp_path / "bare.tif", np.ones((9, 9), np.uint8))))
    with pytest.raises(GeoreferencingError, match="only one of"):
        read_layer(path, bare, 5.0)
