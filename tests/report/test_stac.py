"""The STAC item in a report's numbers: what catalogues and other tools read of it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from contexts import context
from raster_files import utm_grid, write_raster
from rasterio.crs import CRS
from rasterio.warp import transform, transform_bounds
from shapely.geometry import LinearRing, Polygon
from textured_pairs import TexturedPair, shift_on_map
from tools.conftest import textured

from groundtie.context import Context
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.rasters.reading import open_raster
from groundtie.registration.delivery import Call, RegistrationFiles
from groundtie.registration.registered_output import RegisteredOutput
from groundtie.registration.registration import Registration
from groundtie.registration.specification import Specification
from groundtie.registration.verdict import Verdict
from groundtie.report.stac import quality_of, stac_item
from groundtie.stac_items import raster_of_item

__all__ = ["context", "textured"]

VERDICT = Verdict(True, "good", fit_points=7, check_rmse_m=4.0, ce90_m=2.5)
GRID = utm_grid(30, 20)


def item(
    tmp_path: Path, grid: Grid = GRID, name: str = "s2_20240506.tif", output: str = "moved.cog.tif"
) -> dict[str, object]:
    path = write_raster(tmp_path / name, np.ones((20, 30), np.uint8), GRID)
    transform = Transform(shift_on_map(1.0, 2.0), GRID.crs, GRID)
    with open_raster(path) as source:
        path = tmp_path / "out" / output
        return stac_item(source, path, grid, tmp_path / "reports", quality_of(VERDICT, transform))


def test_the_fields_are_those_of_the_extensions(tmp_path: Path) -> None:
    """Types are those of the projection extension's schema (v1.0.0) and of accuracy (v1.0.0)."""
    found = json.loads(json.dumps(item(tmp_path)))
    assert (found["type"], found["stac_version"]) == ("Feature", "1.0.0")
    assert {"id", "geometry", "bbox", "properties", "links", "assets"} <= set(found)
    fields = found["properties"]
    assert fields["datetime"] == "2024-05-06T00:00:00Z"
    assert fields["proj:epsg"] == 32632
    assert fields["proj:shape"] == [20, 30]
    # Rows of the matrix, as rasterio's: (x of a column, x of a row, x of the corner, …).
    assert fields["proj:transform"] == [10, 0, 500_000, 0, -10, 5_000_000]
    assert fields["proj:bbox"] == [500_000, 4_999_800, 500_300, 5_000_000]
    assert (fields["accuracy:geometric_rmse"], fields["groundtie:ce90_m"]) == (4.0, 2.5)
    west, south, east, north = transform_bounds(GRID.crs, "EPSG:4326", *fields["proj:bbox"])
    assert found["bbox"] == pytest.approx([west, south, east, north], abs=1e-5)
    ring = found["geometry"]["coordinates"][0]
    assert found["geometry"]["type"] == "Polygon" and ring[0] == ring[-1]
    asset = found["assets"]["data"]
    assert asset["href"] == "../out/moved.cog.tif"
    assert asset["type"] == "image/tiff; application=geotiff; profile=cloud-optimized"


@pytest.mark.parametrize(
    ("epsg", "place", "tolerance_deg"),
    [
        (32632, Affine(10, 0, 445_200, 0, -10, 5_500_000), 1e-5),  # a tile of Sentinel-2
        (32632, Affine(10, 0, 445_200, 0, 10, 5_500_000), 1e-5),  # the same with y up
        (3413, Affine(100, 0, -500_000, 0, -100, -1_000_000), 1e-2),
    ],
)
def test_the_footprint_holds_all_pixels(
    tmp_path: Path, epsg: int, place: Affine, tolerance_deg: float
) -> None:
    """Borders are curved on the globe, and RFC 7946 has outer rings run counterclockwise."""
    grid = Grid(place, CRS.from_epsg(epsg), 10_980, 10_980)
    found: Any = item(tmp_path, grid)
    bounds = transform_bounds(grid.crs, "EPSG:4326", *found["properties"]["proj:bbox"], 201)
    assert found["bbox"] == pytest.approx(bounds, abs=tolerance_deg)
    (ring,) = found["geometry"]["coordinates"]
    assert LinearRing(ring).is_ccw and LinearRing(ring).is_valid
    places = transform(grid.crs, "EPSG:4326", *grid.pixel_to_map(grid.outline(101)).T)
    whole = Polygon(np.column_stack(places))
    assert whole.difference(Polygon(ring)).area < 1e-3 * whole.area


@pytest.mark.parametrize(
    "text",
    ["+proj=laea +lat_0=48 +lon_0=9 +ellps=GRS80", "+proj=utm +zone=32 +ellps=intl +units=m"],
)
def test_a_crs_without_a_code_is_wkt(tmp_path: Path, text: str) -> None:
    own = CRS.from_proj4(text)
    found = item(tmp_path, replace(GRID, transform=Affine(10, 0, 0, 0, -10, 0), crs=own))
    fields = found["properties"]
    assert isinstance(fields, dict) and fields["proj:epsg"] is None
    assert CRS.from_wkt(fields["proj:wkt2"]) == own


def test_longitudes_beyond_the_antimeridian_are_those_of_geojson(tmp_path: Path) -> None:
    beyond = Grid(Affine(0.1, 0, 190, 0, -0.1, 50), CRS.from_epsg(4326), 30, 20)
    assert item(tmp_path, beyond)["bbox"] == pytest.approx([-170, 48, -167, 50])
    across = Grid(Affine(0.1, 0, 179, 0, -0.1, 50), CRS.from_epsg(4326), 30, 20)
    assert item(tmp_path, across) == {}
    assert item(tmp_path, Grid(Affine(1, 0, 0, 0, -1, 50), CRS.from_epsg(4326), 360, 20)) == {}


def test_where_there_can_be_none(tmp_path: Path) -> None:
    assert not item(tmp_path, name="untimed.tif")
    assert not item(tmp_path, replace(GRID, crs=None))
    wide = Grid(Affine(1, 0, -170, 0, -1, 10), CRS.from_epsg(4326), 340, 20)
    assert not item(tmp_path, wide)


def test_the_time_is_that_of_the_metadata_before_that_of_the_name(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "s2_20240506.tif", np.ones((20, 30), np.uint8), GRID)
    with rasterio.open(path, "r+") as dataset:
        dataset.update_tags(ns="IMAGERY", ACQUISITIONDATETIME="2023-01-02T03:04:05")
    transform = Transform(shift_on_map(1.0, 2.0), GRID.crs, GRID)
    with open_raster(path) as source:
        found = stac_item(
            source, tmp_path / "o.tif", GRID, tmp_path, quality_of(VERDICT, transform)
        )
    assert found["properties"]["datetime"] == "2023-01-02T03:04:05Z"


def test_metadata_that_are_no_time_leave_it_to_the_name(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "s2_20240506.tif", np.ones((20, 30), np.uint8), GRID)
    with rasterio.open(path, "r+") as dataset:
        dataset.update_tags(ns="IMAGERY", ACQUISITIONDATETIME="15.06.2020")
    with open_raster(path) as source:
        found = stac_item(source, tmp_path / "o.tif", GRID, tmp_path, {})
    assert found["properties"]["datetime"] == "2024-05-06T00:00:00Z"


def test_the_asset_of_any_name_is_a_url_that_leads_to_it(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "s2_20240506.tif", np.ones((20, 30), np.uint8), GRID)
    output = tmp_path / "r ü#1 100%.tif"
    with open_raster(path) as source:
        other = stac_item(source, tmp_path / "\udcff.tif", GRID, tmp_path, {})
        assert other["assets"]["data"]["href"] == "%FF.tif"  # a byte that is no UTF-8
        found = stac_item(source, output, GRID, tmp_path, {})
    href = found["assets"]["data"]["href"]
    assert href == "r%20%C3%BC%231%20100%25.tif"
    stored = tmp_path / "item.json"
    stored.write_text(json.dumps(found))
    assert raster_of_item(stored) == output
    # Others write names as they are: a file of that very name is theirs, if there is no other.
    literal, decoded = tmp_path / "a%20b.tif", tmp_path / "a b.tif"
    literal.touch()
    found["assets"]["data"]["href"] = literal.name
    stored.write_text(json.dumps(found))
    assert raster_of_item(stored) == literal
    decoded.touch()
    assert raster_of_item(stored) == decoded


@pytest.mark.slow
def test_the_numbers_of_a_report_are_an_item_that_tools_read(
    textured: TexturedPair, tmp_path: Path, context: Context
) -> None:
    dated = tmp_path / "input_20240506.tif"
    dated.write_bytes(textured.input.read_bytes())
    output = RegisteredOutput(tmp_path / "moved.tif", "reference", "cubic")
    files = RegistrationFiles(output, report=tmp_path / "r.html")
    spec = Specification(similarity="orientation", search_radius_m=200.0)
    with Call(textured.reference, dated, files).register(spec) as found:
        assert isinstance(found, Registration)
    stored = json.loads((tmp_path / "r.json").read_text())
    assert stored["verdict"]["accepted"] is True
    fields = stored["properties"]
    assert fields["accuracy:geometric_rmse"] == stored["verdict"]["check_rmse_m"]
    assert math.isfinite(fields["groundtie:ce90_m"])
    assert raster_of_item(tmp_path / "r.json") == tmp_path / "moved.tif"
    with rasterio.open(tmp_path / "moved.tif") as raster:
        assert fields["proj:transform"] == list(raster.transform[:6])
        assert fields["proj:shape"] == list(raster.shape)


@pytest.mark.parametrize("suffix", [".tif", ".TIFF", ".cog.tif", ".vrt"])
def test_the_id_is_the_name_with_all_its_dots(tmp_path: Path, suffix: str) -> None:
    """As scenes of HLS have them: cut at the first dot, all would have one id."""
    name = "HLS.S30.T32TPS.2024127T102031.v2.0"
    assert item(tmp_path, output=name + suffix)["id"] == name
