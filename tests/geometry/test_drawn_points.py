"""Layers of tie points that a person edited: lines that were moved, drawn or exported by QGIS."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fiona
import numpy as np
import pytest
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.errors import TransformFileError
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.tie_point_files import read_tie_points, write_tie_points
from groundtie.geometry.tie_points import EDITED, TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, reproject

GRID = utm_grid(400, 300)
PLAIN = Grid(PIXEL_COORDINATES, None, 400, 300)
LON_LAT = CRS.from_epsg(4326)
SHIFT = np.array([20.0, -30.0])
COUNT = 8
LAYERS = (".gpkg", ".geojson")


def write(path: Path, crs: CRS | None = UTM, grid: Grid = GRID) -> TiePoints:
    px = np.random.default_rng(0).uniform(10, 290, (COUNT, 2))
    nominal = Transform.nominal(crs, grid).nominal_xy(px)
    points = TiePoints(
        reference_xy=nominal - SHIFT,
        input_px=px,
        score=np.ones(COUNT),
        covariance_px2=np.tile(np.eye(2), (COUNT, 1, 1)),
        forward_backward_error_px=np.zeros(COUNT),
        is_check=np.arange(COUNT) % 3 == 0,
        state=np.full(COUNT, "used"),
    )
    transform = Transform(fit_model("translation", nominal - SHIFT, nominal), crs, grid)
    write_tie_points(path, points, transform)
    return points


def edit(path: Path, change: Callable[[list[dict[str, Any]]], None]) -> None:
    """Change the features of a layer as GeoJSON has them; columns are left alone."""
    with fiona.open(path) as layer:
        features = [json.loads(fiona.model.ObjectEncoder().encode(f)) for f in layer]
        profile = dict(layer.profile, crs_wkt=layer.crs_wkt)
    change(features)
    path.unlink()
    profile.pop("crs", None)
    with fiona.open(path, "w", **profile) as layer:
        layer.writerecords(features)


def move(features: list[dict[str, Any]], index: int, vertex: int, by: tuple[float, float]) -> None:
    place = features[index]["geometry"]["coordinates"][vertex]
    features[index]["geometry"]["coordinates"][vertex] = [place[0] + by[0], place[1] + by[1]]


@pytest.mark.parametrize("suffix", LAYERS)
def test_what_nobody_edited_is_as_it_was_written(tmp_path: Path, suffix: str) -> None:
    points = write(tmp_path / f"a{suffix}")
    found = read_tie_points(tmp_path / f"a{suffix}", GRID)
    assert not found.more[EDITED].any()
    np.testing.assert_array_equal(found.reference_xy, points.reference_xy)


def test_a_vertex_on_the_reference_counts_over_its_columns(tmp_path: Path) -> None:
    points = write(tmp_path / "a.gpkg")
    edit(tmp_path / "a.gpkg", lambda features: move(features, 2, 1, (50.0, -7.0)))
    found = read_tie_points(tmp_path / "a.gpkg", GRID)
    expected = points.reference_xy.copy()
    expected[2] += [50, -7]
    np.testing.assert_allclose(found.reference_xy, expected, atol=1e-6)
    np.testing.assert_allclose(found.input_px, points.input_px, atol=1e-6)
    np.testing.assert_array_equal(found.more[EDITED], np.arange(COUNT) == 2)


def test_a_vertex_in_the_input_counts_over_its_columns(tmp_path: Path) -> None:
    points = write(tmp_path / "a.gpkg")
    edit(tmp_path / "a.gpkg", lambda features: move(features, 5, 0, (50.0, 20.0)))
    found = read_tie_points(tmp_path / "a.gpkg", GRID)
    expected = points.input_px.copy()
    expected[5] += [5, -2]  # pixels of 10 m, rows to the south
    np.testing.assert_allclose(found.input_px, expected, atol=1e-6)
    np.testing.assert_array_equal(found.reference_xy, points.reference_xy)


def test_geojson_moves_in_degrees(tmp_path: Path) -> None:
    points = write(tmp_path / "a.geojson")
    edit(tmp_path / "a.geojson", lambda features: move(features, 0, 1, (1e-3, 0.0)))
    found = read_tie_points(tmp_path / "a.geojson", GRID)
    start = reproject(points.reference_xy[:1], UTM, LON_LAT)
    moved = reproject(start + [1e-3, 0], LON_LAT, UTM)
    np.testing.assert_allclose(found.reference_xy[:1], moved, atol=1e-3)
    assert found.crs == UTM
    assert found.more[EDITED].sum() == 1


def test_geojson_with_a_crs_as_qgis_exports_it(tmp_path: Path) -> None:
    points = write(tmp_path / "a.geojson")
    path = tmp_path / "a.geojson"
    collection = json.loads(path.read_text())
    collection["crs"] = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32632"}}
    for feature in collection["features"]:
        line = np.array(feature["geometry"]["coordinates"])
        feature["geometry"]["coordinates"] = reproject(line, LON_LAT, UTM).tolist()
    move(collection["features"], 1, 1, (30.0, 0.0))
    path.write_text(json.dumps(collection))
    found = read_tie_points(path, GRID)
    np.testing.assert_allclose(found.reference_xy[1], points.reference_xy[1] + [30, 0], atol=1e-5)
    assert found.more[EDITED].tolist() == [0, 1, 0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize("suffix", LAYERS)
def test_a_drawn_line_is_a_point_of_the_fit(tmp_path: Path, suffix: str) -> None:
    """QGIS leaves all columns of a new feature empty."""
    path = tmp_path / f"a{suffix}"
    points = write(path)

    def draw(features: list[dict[str, Any]]) -> None:
        new = json.loads(json.dumps(features[3]))
        new["properties"] = dict.fromkeys(new["properties"])
        features.append(new)

    edit(path, draw)
    found = read_tie_points(path, GRID)
    np.testing.assert_allclose(found.reference_xy[-1], points.reference_xy[3], atol=1e-4)
    np.testing.assert_allclose(found.input_px[-1], points.input_px[3], atol=1e-4)
    assert found.used[-1] and not found.is_check[-1]
    assert found.crs == UTM
    assert found.more[EDITED].tolist() == [0] * COUNT + [1]


def test_a_layer_of_drawn_lines_alone(tmp_path: Path) -> None:
    path = tmp_path / "mine.gpkg"
    schema = {"geometry": "MultiLineString", "properties": {"name": "str"}}
    line = [[(500_105, 4_999_895), (500_300, 4_999_700), (500_085, 4_999_925)]]
    with fiona.open(path, "w", driver="GPKG", crs_wkt=UTM.to_wkt(), schema=schema) as layer:
        geometry = {"type": "MultiLineString", "coordinates": line}
        layer.write({"type": "Feature", "geometry": geometry, "properties": {"name": "bridge"}})
    found = read_tie_points(path, GRID)
    assert found.reference_xy.tolist() == [[500_085, 4_999_925]]
    np.testing.assert_allclose(found.input_px, GRID.map_to_pixel([[500_105, 4_999_895]]))
    assert found.crs == UTM


def test_an_empty_crs_is_that_of_the_layer(tmp_path: Path) -> None:
    write(tmp_path / "a.gpkg")

    def clear(features: list[dict[str, Any]]) -> None:
        for number, feature in enumerate(features):
            feature["properties"]["reference_crs"] = "" if number % 2 else None

    edit(tmp_path / "a.gpkg", clear)
    found = read_tie_points(tmp_path / "a.gpkg", GRID)
    assert found.crs == UTM
    assert not found.more[EDITED].any()


@pytest.mark.parametrize("suffix", LAYERS)
def test_lines_on_an_image_without_georeferencing(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    points = write(path, None, PLAIN)
    edit(path, lambda features: move(features, 4, 0, (3.0, 5.0)))
    found = read_tie_points(path, PLAIN)
    expected = points.input_px.copy()
    expected[4] += [3, 5]
    np.testing.assert_allclose(found.input_px, expected, atol=1e-6)
    assert found.crs is None


def test_a_start_that_has_no_place_in_the_image_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.gpkg")
    edit(tmp_path / "a.gpkg", lambda features: move(features, 4, 0, (3.0, 5.0)))
    with pytest.raises(TransformFileError, match="fill input_col and input_row"):
        read_tie_points(tmp_path / "a.gpkg", PLAIN)


def test_a_drawn_line_may_have_no_properties(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    points = write(path)
    collection = json.loads(path.read_text())
    drawn = {"type": "Feature", "geometry": collection["features"][0]["geometry"]}
    collection["features"] += [drawn | {"properties": None}, drawn]
    path.write_text(json.dumps(collection))
    found = read_tie_points(path, GRID)
    np.testing.assert_allclose(found.reference_xy[-2:], points.reference_xy[[0, 0]], atol=0.1)


def test_a_line_of_several_parts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    write(path)
    collection = json.loads(path.read_text())
    line = collection["features"][0]["geometry"]
    line |= {"type": "MultiLineString", "coordinates": [line["coordinates"]] * 2}
    path.write_text(json.dumps(collection))
    with pytest.raises(TransformFileError, match="several parts"):
        read_tie_points(path, GRID)


def test_the_line_of_a_collection_counts(tmp_path: Path) -> None:
    for name in ("a.geojson", "b.geojson"):
        write(tmp_path / name)
    for name in ("a.geojson", "b.geojson"):
        collection = json.loads((tmp_path / name).read_text())
        move(collection["features"], 0, 1, (1e-3, 0.0))
        if name == "b.geojson":
            feature = collection["features"][0]
            inner = {"type": "GeometryCollection", "geometries": [feature["geometry"]]}
            point = {"type": "Point", "coordinates": [0, 0]}
            feature["geometry"] = {"type": "GeometryCollection", "geometries": [point, inner]}
        (tmp_path / name).write_text(json.dumps(collection))
    line, within = (read_tie_points(tmp_path / name, GRID) for name in ("a.geojson", "b.geojson"))
    assert within.more[EDITED].sum() == 1
    np.testing.assert_array_equal(within.reference_xy, line.reference_xy)


def test_a_collection_of_two_lines_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    write(path)
    collection = json.loads(path.read_text())
    feature = collection["features"][0]
    feature["geometry"] = {"type": "GeometryCollection", "geometries": [feature["geometry"]] * 2}
    path.write_text(json.dumps(collection))
    with pytest.raises(TransformFileError, match="several parts"):
        read_tie_points(path, GRID)


@pytest.mark.parametrize(
    ("kind", "coordinates"),
    [("LineString", []), ("MultiLineString", []), ("MultiLineString", [[]])],
)
def test_an_empty_line_is_none(tmp_path: Path, kind: str, coordinates: list[Any]) -> None:
    path = tmp_path / "a.geojson"
    points = write(path)
    collection = json.loads(path.read_text())
    collection["features"][0]["geometry"] = {"type": kind, "coordinates": coordinates}
    path.write_text(json.dumps(collection))
    found = read_tie_points(path, GRID)
    np.testing.assert_array_equal(found.reference_xy, points.reference_xy)
    assert not found.more[EDITED].any()


def test_an_empty_line_of_a_geopackage_is_none(tmp_path: Path) -> None:
    path = tmp_path / "a.gpkg"
    points = write(path)
    edit(path, lambda features: features[0]["geometry"].update(coordinates=[]))
    found = read_tie_points(path, GRID)
    np.testing.assert_array_equal(found.reference_xy, points.reference_xy)
    assert not found.more[EDITED].any()


def test_positions_of_one_number_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    write(path)
    collection = json.loads(path.read_text())
    collection["features"][0]["geometry"]["coordinates"] = [[5], [6]]
    path.write_text(json.dumps(collection))
    with pytest.raises(TransformFileError, match="cannot read the tie points"):
        read_tie_points(path, GRID)


def test_points_count_by_their_columns(tmp_path: Path) -> None:
    """Points on the reference, or anywhere: which of both images they lie in is not known."""
    path = tmp_path / "a.geojson"
    points = write(path)
    collection = json.loads(path.read_text())
    for feature in collection["features"]:
        feature["geometry"] = {"type": "Point", "coordinates": [0, 0]}
    path.write_text(json.dumps(collection))
    found = read_tie_points(path, GRID)
    np.testing.assert_array_equal(found.reference_xy, points.reference_xy)
