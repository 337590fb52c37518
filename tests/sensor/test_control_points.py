from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rasterio.crs import CRS
from rpc_models import camera_rpc, write_dem, write_positions

from groundtie.errors import OutputError, TransformFileError
from groundtie.geometry.tie_points import TiePoints
from groundtie.rasters.grid import Grid
from groundtie.rasters.reading import open_raster
from groundtie.sensor.control_points import ControlPoints, read_control_points
from groundtie.sensor.orientation import Orientation, orient

RPC = camera_rpc()
UTM = CRS.from_epsg(32632)


@pytest.fixture
def located(tmp_path: Path) -> Iterator[tuple[Orientation, Grid]]:
    image, dem = write_positions(tmp_path / "image.tif", RPC), write_dem(tmp_path / "dem.tif")
    with (
        open_raster(image, allow_sensor_geometry=True) as source,
        open_raster(dem) as terrain,
    ):
        yield orient(source, RPC, UTM, terrain), source.grid


def some_points(orientation: Orientation, count: int = 12) -> ControlPoints:
    random = np.random.default_rng(0)
    px = random.uniform(50, 450, (count, 2))
    roots = random.uniform(-1, 1, (count, 2, 2))
    state = np.array(["used"] * (count - 1) + ["rejected: blunder"])
    points = TiePoints(
        orientation.to_map(px),
        px + random.normal(size=px.shape),
        random.uniform(3, 9, count),
        roots @ roots.swapaxes(1, 2) + 0.1 * np.eye(2),
        random.uniform(0, 2, count),
        np.arange(count) % 4 == 0,
        state,
    )
    return ControlPoints(points, orientation.heights_at(points.reference_xy) + 2.5, UTM)


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".csv"])
def test_points_come_back_with_height_and_covariance(
    tmp_path: Path, located: tuple[Orientation, Grid], suffix: str
) -> None:
    points = some_points(located[0])
    points.write(tmp_path / f"points{suffix}", *located)
    found = read_control_points(tmp_path / f"points{suffix}", *located)
    np.testing.assert_allclose(found.points.input_px, points.points.input_px, atol=1e-6)
    np.testing.assert_allclose(found.points.reference_xy, points.points.reference_xy, atol=1e-6)
    np.testing.assert_allclose(found.height_m, points.height_m, atol=1e-6)
    np.testing.assert_allclose(found.points.covariance_px2, points.points.covariance_px2, rtol=1e-6)
    np.testing.assert_array_equal(found.points.is_check, points.points.is_check)
    np.testing.assert_array_equal(found.points.used, points.points.used)
    assert found.crs == UTM


def test_the_georeferencers_points_get_the_grounds_height(
    tmp_path: Path, located: tuple[Orientation, Grid]
) -> None:
    points = some_points(located[0])
    points.write(tmp_path / "a.points", *located)
    found = read_control_points(tmp_path / "a.points", *located)
    np.testing.assert_allclose(found.points.input_px, points.points.input_px, atol=1e-6)
    np.testing.assert_allclose(found.height_m, points.height_m - 2.5, atol=1e-6)
    np.testing.assert_allclose(found.points.covariance_px2, [np.eye(2)] * len(points))
    # It knows no check points: they are switched off.
    assert found.points.used.tolist() == (points.points.used & ~points.points.is_check).tolist()


def test_gdal_takes_its_options(tmp_path: Path, located: tuple[Orientation, Grid]) -> None:
    """Columns and rows count from the corner, as GDAL has them."""
    points = some_points(located[0])
    points.write(tmp_path / "gcps.txt", *located)
    words = [line.split() for line in (tmp_path / "gcps.txt").read_text().splitlines()]
    kept = points.take(points.points.used & ~points.points.is_check)
    assert words[0] == ["-a_srs", "EPSG:32632"]
    numbers = np.array([line[1:] for line in words[1:]], float)
    assert {line[0] for line in words[1:]} == {"-gcp"}
    np.testing.assert_allclose(numbers[:, :2], kept.points.input_px + 0.5, atol=1e-5)
    np.testing.assert_allclose(numbers[:, 2:4], kept.points.reference_xy, atol=1e-6)
    np.testing.assert_allclose(numbers[:, 4], kept.height_m, atol=1e-3)


def test_lines_lead_from_where_the_rpcs_see_a_point(
    tmp_path: Path, located: tuple[Orientation, Grid]
) -> None:
    import fiona

    points = some_points(located[0])
    points.write(tmp_path / "a.gpkg", *located)
    with fiona.open(tmp_path / "a.gpkg") as layer:
        ends = np.array([feature["geometry"]["coordinates"] for feature in layer])
    np.testing.assert_allclose(ends[:, 0], located[0].to_map(points.points.input_px), atol=1e-6)
    np.testing.assert_allclose(ends[:, 1], points.points.reference_xy, atol=1e-6)


def test_a_table_needs_positions_alone(tmp_path: Path, located: tuple[Orientation, Grid]) -> None:
    points = some_points(located[0])
    rows = np.column_stack([points.lon_lat, points.points.input_px])
    table = tmp_path / "a.csv"
    lines = ["reference_x,reference_y,input_col,input_row,reference_crs"]
    lines += [",".join(f"{value:.12f}" for value in row) + ",EPSG:4326" for row in rows]
    table.write_text("\n".join(lines))
    found = read_control_points(table, *located)
    np.testing.assert_allclose(found.lon_lat, points.lon_lat, atol=1e-10)
    np.testing.assert_allclose(found.height_m, points.height_m - 2.5, atol=1e-4)


def test_points_off_the_terrain_are_rejected(
    tmp_path: Path, located: tuple[Orientation, Grid]
) -> None:
    table = tmp_path / "a.csv"
    table.write_text(
        "reference_x,reference_y,input_col,input_row,reference_crs\n9.0,45.15,1,2,EPSG:4326\n"
        "20.0,45.15,1,2,EPSG:4326\n"
    )
    found = read_control_points(table, *located)
    assert found.points.state.tolist() == ["used", "rejected: no height"]


@pytest.mark.parametrize(
    "text", ["", "reference_x,reference_y,input_col,input_row\n", "a,b\n1,2\n"]
)
def test_what_holds_no_points_is_said(
    tmp_path: Path, located: tuple[Orientation, Grid], text: str
) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(TransformFileError, match=r"a\.csv"):
        read_control_points(tmp_path / "a.csv", *located)


def test_other_formats_are_not_written(tmp_path: Path, located: tuple[Orientation, Grid]) -> None:
    with pytest.raises(OutputError, match="written as"):
        some_points(located[0]).write(tmp_path / "a.xls", *located)
