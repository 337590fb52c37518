from __future__ import annotations

import csv
import json
import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.shutil
import rasterio.warp
from affine import Affine
from rasterio.control import GroundControlPoint
from rasterio.crs import CRS
from rpc_models import camera_rpc, write_dem, write_positions

from groundtie.errors import GeoreferencingError, OutputError, TransformFileError
from groundtie.geometry.tie_points import TiePoints
from groundtie.rasters.grid import LON_LAT, Grid, reproject
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
    return ControlPoints.of(points, orientation.heights_at(points.reference_xy) + 2.5, UTM)


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".csv"])
def test_points_come_back_with_height_and_covariance(
    tmp_path: Path, located: tuple[Orientation, Grid], suffix: str
) -> None:
    points = some_points(located[0])
    points.write(tmp_path / f"points{suffix}", *located)
    found = read_control_points(tmp_path / f"points{suffix}", *located)
    np.testing.assert_allclose(found.input_px, points.input_px, atol=1e-6)
    np.testing.assert_allclose(found.reference_xy, points.reference_xy, atol=1e-6)
    np.testing.assert_allclose(found.height_m, points.height_m, atol=1e-6)
    np.testing.assert_allclose(found.covariance_px2, points.covariance_px2, rtol=1e-6)
    np.testing.assert_array_equal(found.is_check, points.is_check)
    np.testing.assert_array_equal(found.used, points.used)
    assert found.crs == UTM


def test_the_georeferencers_points_get_the_grounds_height(
    tmp_path: Path, located: tuple[Orientation, Grid]
) -> None:
    points = some_points(located[0])
    points.write(tmp_path / "a.points", *located)
    found = read_control_points(tmp_path / "a.points", *located)
    np.testing.assert_allclose(found.input_px, points.input_px, atol=1e-6)
    np.testing.assert_allclose(found.height_m, points.height_m - 2.5, atol=1e-6)
    np.testing.assert_allclose(found.covariance_px2, [np.eye(2)] * len(points))
    lines = (tmp_path / "a.points").read_text().splitlines()[2:]
    numbers = np.array([line.split(",")[5:] for line in lines], float)
    residual = points.input_px - located[0].to_px(points.reference_xy)
    # Its rows count upwards.
    np.testing.assert_allclose(numbers[:, :2], residual * [1, -1], atol=1e-6)
    np.testing.assert_allclose(numbers[:, 2], np.hypot(*residual.T), atol=1e-6)
    assert numbers[:, 2].max() < 5
    # It knows no check points: they are switched off.
    assert found.used.tolist() == (points.used & ~points.is_check).tolist()


def test_the_georeferencer_has_an_images_own_geotransform(
    tmp_path: Path, located: tuple[Orientation, Grid]
) -> None:
    """Where it shows an image that has one besides RPCs: source positions are on that map."""
    orientation, grid = located
    nominal = Grid(Affine(0.5, 0, 10, 0, -0.5, 50), CRS.from_epsg(4326), grid.width, grid.height)
    points = some_points(orientation)
    points.write(tmp_path / "a.points", orientation, nominal)
    _, *lines = (tmp_path / "a.points").read_text().splitlines()
    source_x, source_y = np.loadtxt(lines[1:], delimiter=",")[:, 2:4].T
    col, row = points.input_px.T
    np.testing.assert_allclose(source_x, 10 + 0.5 * (col + 0.5), atol=1e-6)
    np.testing.assert_allclose(source_y, 50 - 0.5 * (row + 0.5), atol=1e-6)
    found = read_control_points(tmp_path / "a.points", orientation, nominal)
    np.testing.assert_allclose(found.input_px, points.input_px, atol=1e-6)
    # Without a CRS of its own, the file's map is that of the orientation.
    (tmp_path / "a.points").write_text("\n".join(lines))
    bare = read_control_points(tmp_path / "a.points", orientation, nominal)
    assert bare.crs == orientation.crs
    np.testing.assert_allclose(bare.input_px, points.input_px, atol=1e-6)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:3857", "EPSG:32633", "EPSG:3035", "EPSG:4937"])
@pytest.mark.parametrize("suffix", ["geojson", "csv", "points"])
def test_residuals_do_not_depend_on_the_map_that_the_points_lie_on(
    tmp_path: Path, located: tuple[Orientation, Grid], crs: str, suffix: str
) -> None:
    points = some_points(located[0])
    xy = np.column_stack(rasterio.warp.transform(UTM, CRS.from_string(crs), *points.reference_xy.T))
    elsewhere = replace(points, reference_xy=xy, crs=CRS.from_string(crs))
    for name, written in (("here", points), ("elsewhere", elsewhere)):
        written.write(tmp_path / f"{name}.{suffix}", *located)
    here, there = (residuals(tmp_path / f"{name}.{suffix}") for name in ("here", "elsewhere"))
    np.testing.assert_allclose(there["px"], here["px"], atol=1e-3)
    if suffix != "points":
        on_utm = np.column_stack(
            rasterio.warp.transform(CRS.from_string(crs), UTM, *there["nominal"].T)
        )
        np.testing.assert_allclose(on_utm, here["nominal"], atol=1e-3)
    if suffix == "geojson":
        np.testing.assert_allclose(there["lines"], here["lines"], atol=1e-8)


def residuals(path: Path) -> dict[str, np.ndarray]:
    """Return the numbers of a file of residuals by what they are."""
    if path.suffix == ".points":
        return {"px": np.loadtxt(path.read_text().splitlines()[2:], delimiter=",")[:, 5:7]}
    if path.suffix == ".csv":
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        lines = np.array([])
    else:
        features = json.loads(path.read_text())["features"]
        rows = [feature["properties"] for feature in features]
        lines = np.array([feature["geometry"]["coordinates"] for feature in features])
    names = {"px": ("dx_px", "dy_px"), "nominal": ("nominal_x", "nominal_y")}
    numbers = {
        key: np.array([[float(row[name]) for name in pair] for row in rows])
        for key, pair in names.items()
    }
    return numbers | {"lines": lines}


@pytest.mark.parametrize("crs", ["EPSG:32632+5773", "EPSG:32632+5783"])
def test_heights_that_do_not_count_from_the_ellipsoid_are_refused(
    tmp_path: Path, located: tuple[Orientation, Grid], crs: str
) -> None:
    points = some_points(located[0])
    columns = [points.reference_xy, points.input_px, points.height_m[:, None]]
    lines = ["reference_x,reference_y,input_col,input_row,height_m,reference_crs"]
    lines += [",".join(f"{v:.6f}" for v in row) + f",{crs}" for row in np.hstack(columns)]
    table = tmp_path / "a.csv"
    table.write_text("\n".join(lines))
    with pytest.raises(TransformFileError, match=r"heights above (EGM96|DHHN92 height), but"):
        read_control_points(table, *located)
    # Without heights there is nothing to mistake.
    table.write_text("\n".join(lines).replace("height_m", "unused"))
    found = read_control_points(table, *located)
    np.testing.assert_allclose(found.height_m, points.height_m - 2.5, atol=1e-3)


@pytest.mark.parametrize("suffix", [".csv", ".gpkg", ".geojson", ".txt"])
def test_points_of_a_compound_map_are_written_without_its_vertical_part(
    tmp_path: Path, located: tuple[Orientation, Grid], suffix: str
) -> None:
    """Their heights count from the ellipsoid, whatever those of the reference do."""
    compound = CRS.from_user_input("EPSG:32632+5773")
    points = replace(some_points(located[0]), crs=compound)
    path = tmp_path / f"points{suffix}"
    points.write(path, replace(located[0], crs=compound), located[1])
    if suffix == ".txt":
        assert path.read_text().startswith("-a_srs EPSG:32632\n")
        return
    found = read_control_points(path, *located)
    assert found.crs == UTM
    np.testing.assert_allclose(found.height_m, points.height_m, atol=1e-6)


def test_gdal_takes_its_options(tmp_path: Path, located: tuple[Orientation, Grid]) -> None:
    """Columns and rows count from the corner, as GDAL has them."""
    points = some_points(located[0])
    points.write(tmp_path / "gcps.txt", *located)
    words = [line.split() for line in (tmp_path / "gcps.txt").read_text().splitlines()]
    kept = points.take(points.used & ~points.is_check)
    assert words[0] == ["-a_srs", "EPSG:32632"]
    numbers = np.array([line[1:] for line in words[1:]], float)
    assert {line[0] for line in words[1:]} == {"-gcp"}
    np.testing.assert_allclose(numbers[:, :2], kept.input_px + 0.5, atol=1e-5)
    np.testing.assert_allclose(numbers[:, 2:4], kept.reference_xy, atol=1e-6)
    np.testing.assert_allclose(numbers[:, 4], kept.height_m, atol=1e-3)


def test_gdal_is_told_the_datum(tmp_path: Path, located: tuple[Orientation, Grid]) -> None:
    """GDAL takes backslashes within double quotes as a shell does."""
    own = CRS.from_user_input("+proj=utm +zone=32 +ellps=intl +units=m")
    replace(some_points(located[0]), crs=own).write(tmp_path / "gcps.txt", *located)
    option, text = shlex.split((tmp_path / "gcps.txt").read_text().splitlines()[0])
    assert option == "-a_srs" and CRS.from_user_input(text) == own


def test_lines_lead_from_where_the_rpcs_see_a_point(
    tmp_path: Path, located: tuple[Orientation, Grid]
) -> None:
    import fiona

    points = some_points(located[0])
    points.write(tmp_path / "a.gpkg", *located)
    with fiona.open(tmp_path / "a.gpkg") as layer:
        ends = np.array([feature["geometry"]["coordinates"] for feature in layer])
    np.testing.assert_allclose(ends[:, 0], located[0].to_map(points.input_px), atol=1e-6)
    np.testing.assert_allclose(ends[:, 1], points.reference_xy, atol=1e-6)


def test_a_table_needs_positions_alone(tmp_path: Path, located: tuple[Orientation, Grid]) -> None:
    points = some_points(located[0])
    rows = np.column_stack([points.lon_lat, points.input_px])
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
    assert found.state.tolist() == ["used", "rejected: no height"]


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


def test_a_point_that_the_rpcs_cannot_see_is_named(located: tuple[Orientation, Grid]) -> None:
    """As of an easting with a digit too many; it may not make the others disagree."""
    points = some_points(located[0])
    points.reference_xy[3, 0] *= 1000
    with pytest.raises(GeoreferencingError, match="cannot place 1 of 12 points, the first at"):
        points.seen_by(RPC, located[1].size)
    rejected = points.reject(np.arange(12) == 3, "by hand")
    assert np.isnan(rejected.seen_by(RPC, located[1].size).expected_px).any(axis=1).sum() == 1


class TestFormatsOfOthers:
    """The same points, as other programs write them."""

    PX = np.array([[100.25, 50.5], [400.0, 300.75], [-20.0, 610.0]])
    LON_LAT = np.array([[9.001, 45.151], [9.002, 45.149], [8.999, 45.152]])
    HEIGHT = np.array([210.0, 305.5, 280.0])

    def orthority(self, names: list[str | None]) -> str:
        features = [
            {
                "type": "Feature",
                "properties": {"filename": name, "ji": list(px), "id": "a"},
                "geometry": {"type": "Point", "coordinates": [*place, height]},
            }
            for name, px, place, height in zip(
                names, self.PX.tolist(), self.LON_LAT.tolist(), self.HEIGHT.tolist(), strict=True
            )
        ]
        return json.dumps({"type": "FeatureCollection", "features": features})

    def expect(self, found: ControlPoints, which: list[int], heights: bool = True) -> None:
        np.testing.assert_allclose(found.input_px, self.PX[which], atol=1e-9)
        np.testing.assert_allclose(found.lon_lat, self.LON_LAT[which], atol=1e-9)
        if heights:
            np.testing.assert_allclose(found.height_m, self.HEIGHT[which])
        assert found.used.all() and not found.is_check.any()
        np.testing.assert_allclose(found.covariance_px2, [np.eye(2)] * len(which))

    def test_orthority(self, tmp_path: Path, located: tuple[Orientation, Grid]) -> None:
        path = tmp_path / "gcps.geojson"
        path.write_text(self.orthority(["image.tif"] * 3))
        self.expect(read_control_points(path, *located, "other.tif"), [0, 1, 2])
        path.write_text(self.orthority(["image", "other.tif", "image.tif"]))
        self.expect(read_control_points(path, *located, "/data/image.tif"), [0, 2])
        with pytest.raises(TransformFileError, match=r"points of image, other, none of third\.tif"):
            read_control_points(path, *located, "third.tif")

    @pytest.mark.parametrize("suffix", ["tif", "vrt"])
    def test_gcps_of_gdal(
        self, tmp_path: Path, located: tuple[Orientation, Grid], suffix: str
    ) -> None:
        path = tmp_path / "gcps.tif"
        for heights in (self.HEIGHT, np.zeros(3)):
            points = [
                GroundControlPoint(row + 0.5, col + 0.5, lon, lat, height)
                for (col, row), (lon, lat), height in zip(
                    self.PX, self.LON_LAT, heights, strict=True
                )
            ]
            profile = {"driver": "GTiff", "width": 4, "height": 4, "count": 1, "dtype": "uint8"}
            with rasterio.open(path, "w", **profile, gcps=points, crs="EPSG:4326") as raster:
                raster.write(np.ones((1, 4, 4), np.uint8))
            if suffix == "vrt":
                rasterio.shutil.copy(path, tmp_path / "gcps.vrt", driver="VRT")
            found = read_control_points(tmp_path / f"gcps.{suffix}", *located)
            self.expect(found, [0, 1, 2], heights.any())
            if not heights.any():  # GDAL's zeros are no heights
                expected = located[0].heights.at(self.LON_LAT)
                np.testing.assert_allclose(found.height_m, expected)

    @pytest.mark.parametrize(
        ("info", "crs"),
        [("UTM, 32, North, WGS-84, units=Meters", 32632), ("Geographic Lat/Lon, WGS-84", 4326)],
    )
    def test_envi(
        self, tmp_path: Path, located: tuple[Orientation, Grid], info: str, crs: int
    ) -> None:
        """ENVI calls the corner of the first pixel 1."""
        xy = reproject(self.LON_LAT, LON_LAT, CRS.from_epsg(crs))
        rows = [
            f"  {x:.9f}  {y:.9f}  {col + 1.5}  {row + 1.5}"
            for (x, y), (col, row) in zip(xy, self.PX, strict=True)
        ]
        head = ["; ENVI Image to Map GCP File", f"; projection info = {{{info}}}"]
        path = tmp_path / "a.pts"
        path.write_text("\n".join([*head, "; Map (x,y), Image (x,y)", ";", *rows]))
        self.expect(read_control_points(path, *located), [0, 1, 2], heights=False)

    @pytest.mark.parametrize(
        ("name", "text", "message"),
        [
            ("a.pts", "; projection info = {State Plane, NAD-27}\n1 2 3 4\n", "is none of UTM"),
            ("a.pts", "1 2 3 4\n", "is none of UTM"),
            (
                "a.pts",
                "; projection info = {UTM, 17, North, WGS-84, units=Feet}\n1 2 3 4\n",
                "units=feet must be Meters or Degrees",
            ),
            ("a.csv", "reference_x,reference_y,reference_x\n1,2,3\n", "stands twice"),
            ("a.pts", "; only comments\n", "lines of map x, y"),
            ("a.pts", "1 2 three 4\n", "could not convert"),
            ("a.geojson", '{"features": [{"properties": {"ji": [1]}}]}', "cannot read the ground"),
            ("a.tif", "no raster", "cannot read the ground control"),
            ("a.json", '{"features": [1]}', "cannot read the ground control"),
            ("a.json", '{"features": [{"properties": ["ji"]}]}', "cannot read the ground control"),
        ],
    )
    def test_what_cannot_be_understood(
        self,
        tmp_path: Path,
        located: tuple[Orientation, Grid],
        name: str,
        text: str,
        message: str,
    ) -> None:
        (tmp_path / name).write_text(text)
        with pytest.raises(TransformFileError, match=message):
            read_control_points(tmp_path / name, *located)

    @pytest.mark.parametrize("name", ["a.pts", "a.csv", "a.json"])
    def test_another_encoding_is_named(
        self, tmp_path: Path, located: tuple[Orientation, Grid], name: str
    ) -> None:
        (tmp_path / name).write_text("1 2 3 4\n", encoding="utf-16")
        with pytest.raises(TransformFileError, match="is no UTF-8 text: save it as UTF-8"):
            read_control_points(tmp_path / name, *located)

    def test_a_raster_without_gcps_is_told(
        self, tmp_path: Path, located: tuple[Orientation, Grid]
    ) -> None:
        with pytest.raises(TransformFileError, match="the raster has no GCPs"):
            read_control_points(tmp_path / "dem.tif", *located)
