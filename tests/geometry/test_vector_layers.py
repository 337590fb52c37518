"""Vector layers are read where a crash ends another process only."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import fiona
import numpy as np
import pytest
from affine import Affine
from raster_files import utm_grid
from rasterio.crs import CRS

from groundtie.errors import GeoreferencingError, VectorLayerError
from groundtie.geometry import layer_reader, vector_layers
from groundtie.geometry.vector_layers import read_vector_layer
from groundtie.rasters.grid import Grid

# 100 km wide and high, with the ring in it.
BESIDE = utm_grid(100, 100, 1000.0)
RING = [(9.0, 45.0), (9.1, 45.0), (9.1, 45.1), (9.0, 45.0)]


@pytest.fixture
def layer(tmp_path: Path) -> Path:
    path = tmp_path / "areas.gpkg"
    schema = {"geometry": "Polygon", "properties": {"class": "int", "day": "date"}}
    with fiona.open(path, "w", driver="GPKG", crs="EPSG:4326", schema=schema) as file:
        for geometry in ({"type": "Polygon", "coordinates": [RING]}, None):
            properties = {"class": 3, "day": "2026-11-22"}
            file.write({"type": "Feature", "geometry": geometry, "properties": properties})
    return path


def started_as(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, source: str) -> None:
    """Let another script run in place of the reader."""
    script = tmp_path / "reader.py"
    script.write_text(source)
    monkeypatch.setattr(layer_reader, "__file__", str(script))


def never(path: str) -> dict[str, object]:
    raise AssertionError("the layer is read in this process")


def test_what_a_layer_holds(layer: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layer_reader, "layer_of", never)
    found = read_vector_layer(layer)
    assert found.crs == CRS.from_epsg(4326)
    assert found.fields == ("class", "day")
    first, second = found.features
    assert first["geometry"]["coordinates"] == [[list(corner) for corner in RING]]
    assert (first["properties"]["class"], second["geometry"]) == (3, None)
    (moved,) = found.on_map(BESIDE).features
    assert moved["geometry"]["coordinates"][0][0] == pytest.approx((500_000, 4_982_950), abs=5)
    with pytest.raises(GeoreferencingError, match="only one of"):
        found.on_map(Grid(Affine.identity(), None, 10, 10))


@pytest.mark.parametrize(
    ("kind", "nest"),
    [("Polygon", lambda ring: [ring]), ("MultiPolygon", lambda ring: [[ring]]), ("Point", None)],
)
def test_longitudes_are_counted_as_the_grids_are(tmp_path: Path, kind: str, nest: Any) -> None:
    """West of the antimeridian the grid goes on beyond 180°."""
    ring = [[-179.98, 0.0], [-179.96, 0.0], [-179.96, 0.01], [-179.98, 0.0]]
    geometry = {"type": kind, "coordinates": ring[0] if nest is None else nest(ring)}
    path = tmp_path / "a.geojson"
    feature = {"type": "Feature", "geometry": geometry, "properties": {"a": 1}}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    grid = Grid(Affine(0.001, 0, 179.95, 0, -0.001, 0.05), CRS.from_epsg(4326), 100, 100)
    (found,) = read_vector_layer(path).on_map(grid).features
    first = np.ravel(found["geometry"]["coordinates"])[:2]
    assert first == pytest.approx([180.02, 0.0])
    near = Grid(Affine(0.001, 0, -179.99, 0, -0.001, 0.05), CRS.from_epsg(4326), 100, 100)
    (found,) = read_vector_layer(path).on_map(near).features
    np.testing.assert_array_equal(
        np.ravel(found["geometry"]["coordinates"]), np.ravel(geometry["coordinates"])
    )


def test_collections_are_taken_apart_with_their_attributes(tmp_path: Path) -> None:
    """GeoJSON may nest them (RFC 7946, 3.1.8)."""
    point = {"type": "Point", "coordinates": [9.0, 45.0]}
    area = {"type": "Polygon", "coordinates": [RING]}
    inner = {"type": "GeometryCollection", "geometries": [area]}
    empty = {"type": "GeometryCollection", "geometries": []}
    outer = {"type": "GeometryCollection", "geometries": [point, inner, empty]}
    path = tmp_path / "a.geojson"
    features = [
        {"type": "Feature", "geometry": geometry, "properties": {"number": number}}
        for number, geometry in enumerate([outer, empty, area])
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    found = read_vector_layer(path).on_map(BESIDE)
    kinds = [(one["geometry"]["type"], one["properties"]["number"]) for one in found.features]
    assert kinds == [("Point", 0), ("Polygon", 0), ("Polygon", 2)]
    first, last = (found.features[index]["geometry"]["coordinates"] for index in (1, 2))
    assert first == last
    assert found.features[0]["geometry"]["coordinates"] == pytest.approx(
        (500_000, 4_982_950), abs=5
    )


def test_a_crash_is_an_error_of_the_layer(
    layer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    crash = "import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n"
    started_as(monkeypatch, tmp_path, crash)
    with pytest.raises(VectorLayerError, match=r"areas\.gpkg: it is damaged: GDAL crashes on it"):
        read_vector_layer(layer)


def test_one_that_takes_too_long(
    layer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started_as(monkeypatch, tmp_path, "import time\ntime.sleep(60)\n")
    monkeypatch.setattr(vector_layers, "_PATIENCE_S", 0.3)
    with pytest.raises(VectorLayerError, match=r"took more than 0\.3 s"):
        read_vector_layer(layer)


def test_without_an_interpreter_it_is_read_here(
    layer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As in a program that embeds Python, and where the interpreter finds no fiona.
    monkeypatch.setattr(vector_layers, "interpreter", lambda: None)
    assert len(read_vector_layer(layer).features) == 2
    monkeypatch.undo()
    started_as(monkeypatch, tmp_path, "import nothing_of_that_name\n")
    assert len(read_vector_layer(layer).features) == 2


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\0", b"{}", b"x" * 1000])
def test_what_is_no_layer(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.gpkg"
    path.write_bytes(content)
    with pytest.raises(VectorLayerError, match=r"cannot read the vector layer .*a\.gpkg"):
        read_vector_layer(path)


def test_another_encoding_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    feature = {"type": "Feature", "properties": {"Größe": 1}, "geometry": None}
    collection = {"type": "FeatureCollection", "features": [feature]}
    path.write_text(json.dumps(collection, ensure_ascii=False), encoding="latin-1")
    with pytest.raises(VectorLayerError, match="its texts are not in UTF-8"):
        read_vector_layer(path)


def test_a_crs_that_is_no_maps(tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    collection = {"type": "FeatureCollection", "features": []}
    path.write_text(json.dumps(collection | {"crs": {"type": "name", "properties": {
        "name": "urn:ogc:def:crs:EPSG::4978"}}}))  # fmt: skip
    with pytest.raises(VectorLayerError, match="neither projected nor geographic"):
        read_vector_layer(path)
