from __future__ import annotations

import csv
import json
from pathlib import Path

import fiona
import numpy as np
import pytest
from affine import Affine
from raster_files import UTM, full_disk, utm_grid
from rasterio.crs import CRS

from groundtie.errors import OutputError, TransformFileError
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.tie_point_files import read_tie_points, write_tie_points
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.geometry.vector_layers import write_vector_layer
from groundtie.rasters.atomic import Outputs
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, reproject

GRID = utm_grid(400, 300)
DEGREES = Grid(Affine(1e-4, 0, 9.0, 0, -1e-4, 45.15), CRS.from_epsg(4326), 400, 300)
PLAIN = Grid(PIXEL_COORDINATES, None, 400, 300)
CASES = [(UTM, GRID), (UTM, DEGREES), (None, PLAIN), (UTM, PLAIN)]
FORMATS = (".gpkg", ".geojson", ".csv", ".points")
TABLE = "reference_x,reference_y,input_col,input_row"
SHIFT = np.array([20.0, -30.0])


def made(crs: CRS | None, grid: Grid, count: int = 12) -> tuple[TiePoints, Transform]:
    """Points that lie SHIFT away from where the input claims them, but for 0.5 px along rows."""
    rng = np.random.default_rng(0)
    px = rng.uniform(10, 290, (count, 2))
    nominal = Transform.nominal(crs, grid).nominal_xy(px)
    points = TiePoints(
        reference_xy=nominal - SHIFT,
        input_px=px + [0, 0.5],
        score=rng.uniform(5, 20, count),
        covariance_px2=np.tile(np.diag([0.04, 0.09]), (count, 1, 1)),
        forward_backward_error_px=rng.uniform(0, 1, count),
        is_check=np.arange(count) % 3 == 0,
        state=np.where(np.arange(count) == 1, "rejected: far, and “odd”", "used"),
    )
    return points, Transform(fit_model("translation", nominal - SHIFT, nominal), crs, grid)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize(("crs", "grid"), CASES)
def test_to_a_file_and_back(tmp_path: Path, suffix: str, crs: CRS | None, grid: Grid) -> None:
    points, transform = made(crs, grid)
    path = tmp_path / f"points{suffix}"
    write_tie_points(path, points, transform)
    found = read_tie_points(path, grid)
    assert found.crs == crs
    np.testing.assert_allclose(found.reference_xy, points.reference_xy, rtol=1e-12)
    np.testing.assert_allclose(found.input_px, points.input_px, atol=1e-4)
    # The Georeferencer knows no check points; it must not fit to them.
    georeferencer = suffix == ".points"
    used = points.used & ~points.is_check if georeferencer else points.used
    is_check = np.zeros(12, bool) if georeferencer else points.is_check
    np.testing.assert_array_equal(found.used, used)
    np.testing.assert_array_equal(found.is_check, is_check)


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("datum", ["+ellps=intl", "+ellps=WGS84 +towgs84=100,200,50"])
def test_the_datum_is_kept(tmp_path: Path, suffix: str, datum: str) -> None:
    crs = CRS.from_user_input(f"+proj=utm +zone=32 {datum} +units=m")
    points, transform = made(crs, DEGREES)
    write_tie_points(tmp_path / f"a{suffix}", points, transform)
    found = read_tie_points(tmp_path / f"a{suffix}", DEGREES)
    assert found.crs == crs
    # There and back between the datums leads mm away; another datum would by 10 px.
    np.testing.assert_allclose(found.input_px, points.input_px, atol=1e-3)


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_table_without_points(tmp_path: Path, suffix: str) -> None:
    points, transform = made(UTM, GRID)
    write_tie_points(tmp_path / f"a{suffix}", points.take(np.zeros(12, bool)), transform)
    found = read_tie_points(tmp_path / f"a{suffix}", GRID)
    assert found.reference_xy.shape == found.input_px.shape == (0, 2)
    assert found.used.shape == (0,)


def test_a_table_of_other_columns_without_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("id,x,y\n")
    with pytest.raises(TransformFileError, match="column 'reference_x' is missing"):
        read_tie_points(path, GRID)


def test_geopackage_lines_run_from_the_nominal_to_the_reference_position(tmp_path: Path) -> None:
    points, transform = made(UTM, GRID)
    write_tie_points(tmp_path / "a.gpkg", points, transform)
    with fiona.open(tmp_path / "a.gpkg") as layer:
        assert CRS.from_wkt(layer.crs_wkt) == UTM
        features = list(layer)
    start, end = np.array(features[3]["geometry"]["coordinates"])
    np.testing.assert_allclose(end, points.reference_xy[3])
    # Half a row, of 10 m, further south than without the residual
    np.testing.assert_allclose(start - end, SHIFT - [0, 5], atol=1e-6)


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".csv"])
def test_attributes(tmp_path: Path, suffix: str) -> None:
    points, transform = made(UTM, GRID)
    path = tmp_path / f"a{suffix}"
    write_tie_points(path, points, transform)
    if suffix == ".gpkg":
        with fiona.open(path) as layer:
            rows = [dict(feature["properties"]) for feature in layer]
    elif suffix == ".geojson":
        rows = [f["properties"] for f in json.loads(path.read_text("utf-8"))["features"]]
    else:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    row = rows[3]
    expected = {
        "reference_x": points.reference_xy[3, 0],
        "input_row": points.input_px[3, 1],
        "residual_px": 0.5,
        "dx_px": 0.0,
        "dy_px": 0.5,
        "score": points.score[3],
        "forward_backward_error_px": points.forward_backward_error_px[3],
        "sigma_x_px": 0.2,
        "sigma_y_px": 0.3,
    }
    assert {name: float(row[name]) for name in expected} == pytest.approx(expected, abs=1e-6)
    assert (row["role"], row["state"]) == ("check", "used")
    assert rows[1]["state"] == "rejected: far, and “odd”"


def test_geojson_is_in_longitude_and_latitude(tmp_path: Path) -> None:
    points, transform = made(UTM, GRID)
    write_tie_points(tmp_path / "a.geojson", points, transform)
    with fiona.open(tmp_path / "a.geojson") as layer:
        assert CRS.from_wkt(layer.crs_wkt) == CRS.from_epsg(4326)
        ends = np.array([feature["geometry"]["coordinates"][1] for feature in layer])
    expected = reproject(points.reference_xy, UTM, CRS.from_epsg(4326))
    # The Earth is at 9° east, 45° north there.
    assert np.abs(ends - [9, 45.1]).max() < 0.2
    np.testing.assert_allclose(ends, expected, atol=1e-9)


def test_lines_across_the_antimeridian_do_not_run_around_the_globe(tmp_path: Path) -> None:
    zone = CRS.from_epsg(32760)
    on_it = reproject(np.array([[180.0, -17.0]]), CRS.from_epsg(4326), zone)
    x, y = on_it[0] + [-2000, 2000]
    grid = Grid(Affine(10, 0, x, 0, -10, y), zone, 400, 300)
    px = np.array([[200.0, 199.5], [100.0, 50.0], [300.0, 150.0]])
    nominal_xy = grid.pixel_to_map(px)
    assert nominal_xy[0].tolist() == pytest.approx((on_it[0] + [5, 0]).tolist())
    points = TiePoints.unmeasured(nominal_xy - SHIFT, px, zone)
    path = tmp_path / "a.geojson"
    write_tie_points(path, points, Transform.nominal(zone, grid))
    features = json.loads(path.read_text())["features"]
    lines = np.array([feature["geometry"]["coordinates"] for feature in features])
    # SHIFT is 36 m long.
    assert np.abs(np.diff(lines, axis=1)).max() < 50 / 100_000
    for end, places in enumerate((nominal_xy, points.reference_xy)):
        found_xy = reproject(lines[:, end], CRS.from_epsg(4326), zone)
        np.testing.assert_allclose(found_xy, places, atol=1e-3)
    found = read_tie_points(path, grid)
    assert not found.edited.any()
    np.testing.assert_allclose(found.reference_xy, points.reference_xy, rtol=1e-12)


def test_numbers_that_are_not_finite_become_null(tmp_path: Path) -> None:
    points, transform = made(UTM, GRID)
    points.forward_backward_error_px[0] = np.inf
    for suffix in (".gpkg", ".geojson"):
        path = tmp_path / f"a{suffix}"
        write_tie_points(path, points, transform)
        with fiona.open(path) as layer:
            assert next(iter(layer))["properties"]["forward_backward_error_px"] is None


def test_a_georeferencer_file_of_a_plain_image(tmp_path: Path) -> None:
    """As QGIS 3.22 writes it: counted from the corner, rows downwards from 0."""
    path = tmp_path / "image.tif.points"
    path.write_text(
        "#CRS: EPSG:32632\n"
        "mapX,mapY,sourceX,sourceY,enable,dX,dY,residual\n"
        "500105,4999895,10.5,-20.5,1,0,0,0\n"
        "500205,4999795,30.25,-40.75,0,0,0,0\n"
    )
    found = read_tie_points(path, PLAIN)
    assert found.crs == UTM
    assert found.reference_xy.tolist() == [[500105, 4999895], [500205, 4999795]]
    assert found.input_px.tolist() == [[10, 20], [29.75, 40.25]]
    assert found.used.tolist() == [True, False]


def test_a_georeferencer_file_of_a_georeferenced_image(tmp_path: Path) -> None:
    path = tmp_path / "image.points"
    path.write_text(
        f"#CRS: {UTM.to_wkt()}\n"
        "mapX,mapY,sourceX,sourceY,enable,dX,dY,residual\n"
        "500105,4999895,500015,4999985,1,0,0,0\n"
    )
    np.testing.assert_allclose(read_tie_points(path, GRID).input_px, [[1, 1]])


def test_an_old_georeferencer_file(tmp_path: Path) -> None:
    path = tmp_path / "image.points"
    path.write_text("mapX,mapY,pixelX,pixelY,enable\n1,2,10.5,-20.5,1\n")
    found = read_tie_points(path, PLAIN)
    assert found.input_px.tolist() == [[10, 20]]
    assert found.crs is None


@pytest.mark.parametrize(
    ("field", "enabled"), [(",1", True), (", 1", True), (",0", False), (",", False), ("", True)]
)
def test_which_points_are_enabled_as_in_qgis(tmp_path: Path, field: str, enabled: bool) -> None:
    """It takes whole numbers, an empty field for 0, and a row that ends before for enabled."""
    path = tmp_path / "image.points"
    path.write_text(f"mapX,mapY,sourceX,sourceY,enable\n1,2,10.5,-20.5{field}\n")
    assert read_tie_points(path, PLAIN).used.tolist() == [enabled]


@pytest.mark.parametrize("word", ["false", "no", "0.0", "2", "True"])
def test_other_words_for_enabled_are_refused(tmp_path: Path, word: str) -> None:
    path = tmp_path / "image.points"
    path.write_text(f"mapX,mapY,sourceX,sourceY,enable\n1,2,10.5,-20.5,{word}\n")
    with pytest.raises(TransformFileError, match=f"enable must be 1 or 0, not '{word}'"):
        read_tie_points(path, PLAIN)


@pytest.mark.parametrize(
    ("word", "is_check", "states_fit"),
    [
        ("check", True, False),
        (" Check", True, False),
        ("CHECK ", True, False),
        ("Fit", False, True),
        ("", False, False),
    ],
)
def test_the_role_of_a_point(tmp_path: Path, word: str, is_check: bool, states_fit: bool) -> None:
    path = tmp_path / "mine.csv"
    path.write_text(f"{TABLE},role\n1,2,3,4,{word}\n")
    found = read_tie_points(path, PLAIN)
    assert (found.is_check.tolist(), found.states_fit) == ([is_check], states_fit)


@pytest.mark.parametrize(
    ("word", "expected"),
    [("Used", "used"), (" used ", "used"), ("", "used"), ("Far off", "Far off")],
)
def test_the_state_of_a_point(tmp_path: Path, word: str, expected: str) -> None:
    path = tmp_path / "mine.csv"
    path.write_text(f"{TABLE},state\n1,2,3,4,{word}\n")
    assert read_tie_points(path, PLAIN).state.tolist() == [expected]


@pytest.mark.parametrize("number", ["1_000", "٣", "１２"])
@pytest.mark.parametrize("column", [0, 2, 4])
def test_numbers_as_only_python_writes_them_are_refused(
    tmp_path: Path, number: str, column: int
) -> None:
    row = ["1", "2", "3", "4", "5"]
    row[column] = number
    path = tmp_path / "mine.csv"
    path.write_text(f"{TABLE},score\n{','.join(row)}\n", encoding="utf-8")
    with pytest.raises(TransformFileError, match=f"in row 1 is '{number}', and must be a number"):
        read_tie_points(path, PLAIN)


def test_other_roles_are_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.csv").write_text(f"{TABLE},role\n1,2,3,4,fit\n1,2,3,4,chk\n")
    with pytest.raises(TransformFileError, match="role must be fit or check, not 'chk'"):
        read_tie_points(tmp_path / "mine.csv", PLAIN)


def test_what_we_write_for_the_georeferencer(tmp_path: Path) -> None:
    points, transform = made(UTM, PLAIN)
    write_tie_points(tmp_path / "a.points", points, transform)
    lines = (tmp_path / "a.points").read_text().splitlines()
    assert lines[0].startswith("#CRS: PROJCS[")
    assert lines[1] == "mapX,mapY,sourceX,sourceY,enable,dX,dY,residual"
    numbers = [float(number) for number in lines[2].split(",")]
    col, row = points.input_px[0]
    assert numbers[2:4] == pytest.approx([col + 0.5, -(row + 0.5)])
    enabled = [str(int(fitted)) for fitted in points.used & ~points.is_check]
    assert [line.split(",")[4] for line in lines[2:14]] == enabled
    assert set(enabled) == {"0", "1"}


def test_another_raster_of_the_scene_finds_its_pixels_by_nominal_positions(
    tmp_path: Path,
) -> None:
    points, transform = made(UTM, GRID)
    for suffix in FORMATS:
        path = tmp_path / f"a{suffix}"
        write_tie_points(path, points, transform)
        found = read_tie_points(path, GRID.scaled(4))
        # Pixels four times as large: centres at (p + 0.5) / 4 - 0.5
        np.testing.assert_allclose(found.input_px, (points.input_px + 0.5) / 4 - 0.5, atol=1e-6)


@pytest.mark.parametrize("suffix", [".geojson", ".gpkg"])
def test_drawn_lines_without_a_crs_of_their_own_have_that_of_the_layer(
    tmp_path: Path, suffix: str
) -> None:
    """A scan has none that could stand for it."""
    path, degrees = tmp_path / f"lines{suffix}", CRS.from_epsg(4326)
    ends = [(10.0 + k / 100, 45.0 + k * k / 1000) for k in range(4)]
    records = [
        {
            "geometry": {"type": "LineString", "coordinates": [(10.0, 45.0), end]},
            "properties": {
                "reference_x": end[0],
                "reference_y": end[1],
                "input_col": 100.0 * k,
                "input_row": 50.0 * k,
            },
        }
        for k, end in enumerate(ends)
    ]
    if suffix == ".gpkg":
        write_vector_layer(
            path, "lines", records, dict.fromkeys(records[0]["properties"], "float"), degrees
        )
    else:
        features = [{"type": "Feature", **record} for record in records]
        path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    found = read_tie_points(path, Grid(PIXEL_COORDINATES, None, 400, 300))
    assert found.crs == degrees
    np.testing.assert_allclose(found.reference_xy, ends, atol=1e-9)
    assert found.input_px.tolist() == [[100.0 * k, 50.0 * k] for k in range(4)]


def test_a_table_that_a_person_made(tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    path.write_text("name,input_col,input_row,reference_x,reference_y\nbridge,3,4,500000,4999000\n")
    found = read_tie_points(path, GRID)
    assert found.input_px.tolist() == [[3, 4]]
    assert found.crs == UTM
    assert found.used.tolist() == [True]
    assert found.is_check.tolist() == [False]


@pytest.mark.parametrize("turn", [-360.0, 0.0, 360.0])
@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("a.csv", "reference_x,reference_y,input_x,input_y"),
        ("a.points", "mapX,mapY,sourceX,sourceY"),
    ],
)
def test_longitudes_in_the_input_may_count_from_elsewhere(
    tmp_path: Path, name: str, columns: str, turn: float
) -> None:
    # The raster counts from 0: its column 0 is centred on 350.0005 degrees, which is -9.9995.
    grid = Grid(Affine(1e-3, 0, 350.0, 0, -1e-3, 45.0), CRS.from_epsg(4326), 200, 200)
    path = tmp_path / name
    path.write_text(f"{columns}\n-9.9,44.9,{350.1005 + turn!r},44.9005\n")
    found = read_tie_points(path, grid)
    np.testing.assert_allclose(found.input_px, [[100.0, 99.0]], atol=1e-6)


@pytest.mark.parametrize("suffix", [".csv", ".points"])
def test_a_row_with_more_fields_than_the_first_line_is_refused(tmp_path: Path, suffix: str) -> None:
    """As of decimal commas, whose last one would cut the last number off."""
    header = "mapX,mapY,sourceX,sourceY" if suffix == ".points" else TABLE
    path = tmp_path / f"mine{suffix}"
    path.write_text(f"{header}\n1,2,3,4\n1,2,3,4,5\n")
    with pytest.raises(TransformFileError, match="row 2 has more fields than the first line"):
        read_tie_points(path, PLAIN)
    # Spreadsheets end each line with as many separators as the longest has, in some languages
    # semicolons.
    for row in ("1,2,3,4,,", "1;2;3;4"):
        separator = ";" if ";" in row else ","
        path.write_text(f"{header.replace(',', separator)}\n{row}\n")
        assert len(read_tie_points(path, PLAIN)) == 1


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("a.csv", "a,b\n1,2\n", "reference_x"),
        ("a.csv", "reference_x,reference_y,input_col,input_row\n1,2,3,four\n", "four"),
        ("a.points", "mapX,mapY,sourceX,sourceY,enable\n1,2,3\n", "cannot read"),
        (
            "a.points",
            "#CRS: nonsense\nmapX,mapY,sourceX,sourceY,enable\n",
            "cannot read",
        ),
        ("a.geojson", "{}", "features"),
        ("a.geojson", "[1", "cannot read"),
        ("a.gpkg", "no database", "cannot read"),
        ("a.txt", "", "are read from"),
    ],
)
def test_files_that_cannot_be_understood(tmp_path: Path, name: str, text: str, reason: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(TransformFileError, match=reason) as raised:
        read_tie_points(tmp_path / name, GRID)
    assert name in str(raised.value)


@pytest.mark.parametrize("name", ["a.csv", "a.points", "a.geojson"])
def test_another_encoding_is_named(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("{}", encoding="utf-16")
    with pytest.raises(TransformFileError, match="is no UTF-8 text: save it as UTF-8"):
        read_tie_points(tmp_path / name, GRID)


def test_a_missing_file(tmp_path: Path) -> None:
    for suffix in FORMATS:
        with pytest.raises(TransformFileError, match="missing"):
            read_tie_points(tmp_path / f"missing{suffix}", GRID)


def test_unknown_formats_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"\.shp"):
        write_tie_points(tmp_path / "a.shp", *made(UTM, GRID))


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("free", [0, 50_000])
def test_a_full_disk_leaves_nothing(tmp_path: Path, suffix: str, free: int) -> None:
    points, transform = made(UTM, GRID, 2000)

    def work() -> None:
        with Outputs() as outputs, full_disk(free):
            write_tie_points(outputs.stage(tmp_path / f"a{suffix}"), points, transform)

    with pytest.raises(OutputError, match=rf"/a\{suffix}"):
        work()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_missing_folder(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(OutputError, match="missing"):
        write_tie_points(tmp_path / "missing" / f"a{suffix}", *made(UTM, GRID))
