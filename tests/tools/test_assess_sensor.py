from __future__ import annotations

import csv
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
import rasterio
from rpc_models import camera_rpc, write_dem, write_positions

import groundtie
from groundtie.errors import GeoreferencingError, GroundTieError, TooFewPointsError
from groundtie.sensor.rpc_files import write_rpc
from groundtie.sensor.rpc_tags import rpc_from_tags

TRUTH = camera_rpc()
BIAS = (12.0, -5.0)


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """Write an image whose RPCs are 12 columns and -5 rows off, refined ones, and six points."""
    image = write_positions(tmp_path / "image.tif", TRUTH.shifted((-BIAS[0], -BIAS[1])))
    write_rpc(tmp_path / "refined_RPC.TXT", TRUTH.shifted((0.3, 0.0)))
    px = np.random.default_rng(0).uniform(50, 450, (6, 2))
    height = np.linspace(100, 500, 6)
    rows = np.column_stack([TRUTH.localise(px, height), px, height])
    lines = ["reference_x,reference_y,input_col,input_row,height_m,reference_crs,role"]
    lines += [",".join(f"{v:.12f}" for v in row) + ",EPSG:4326,check" for row in rows]
    lines.append("9.0,45.15,1.0,2.0,300.0,EPSG:4326,fit")
    (tmp_path / "points.csv").write_text("\n".join(lines))
    return {"image": image, "check_points": tmp_path / "points.csv"}


def test_errors_are_measured_in_pixels_and_metres(files: dict[str, Path], tmp_path: Path) -> None:
    result = groundtie.assess_sensor(**files, refined=tmp_path / "refined_RPC.TXT", height=300.0)
    assert result.points == 6
    np.testing.assert_allclose(result.errors["before"].error_px, [BIAS] * 6, atol=1e-6)
    np.testing.assert_allclose(result.errors["after"].error_px, [(-0.3, 0.0)] * 6, atol=1e-6)
    # Pixels are 1 m, turned by 8°; longitudes and latitudes are made metres.
    lengths = np.hypot(*result.errors["before"].error_m.T)
    np.testing.assert_allclose(lengths, 13.0, rtol=0.002)
    summary = result.summary()
    assert summary["before"]["ce90_m"] == pytest.approx(13.0, rel=0.002)
    assert summary["after"]["rmse_px"] == pytest.approx(0.3, abs=1e-6)
    assert result.lines()[0].split() == [
        "point",
        "before",
        "x",
        "y",
        "(m)",
        "after",
        "x",
        "y",
        "(m)",
    ]
    assert len(result.lines()) == 1 + 6 + 2 + 2


@pytest.mark.slow
def test_table_and_picture_are_written(files: dict[str, Path], tmp_path: Path) -> None:
    groundtie.assess_sensor(
        **files, refined=tmp_path / "refined_RPC.TXT", height=300.0,
        table=tmp_path / "errors.csv", picture=tmp_path / "errors.png",
    )  # fmt: skip
    rows = list(csv.DictReader((tmp_path / "errors.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 6
    assert float(rows[0]["before_col_px"]) == pytest.approx(12.0, abs=1e-6)
    picture = cv2.imread(str(tmp_path / "errors.png"))
    assert picture.shape[1] > picture.shape[0] > 300
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 10


def test_a_picture_of_no_errors_is_drawn(files: dict[str, Path], tmp_path: Path) -> None:
    with rasterio.open(files["image"]) as dataset:
        rpc = rpc_from_tags(dataset.tags(ns="RPC"), "image")
    lon_lat = rpc.localise([[100.0, 100.0], [400.0, 300.0]], 300.0)
    px = rpc.project(lon_lat, 300.0)  # to the last digit what the image's RPCs see
    lines = ["reference_x,reference_y,input_col,input_row,height_m,reference_crs"]
    for (x, y), (col, row) in zip(lon_lat.tolist(), px.tolist(), strict=True):
        lines.append(f"{x!r},{y!r},{col!r},{row!r},300.0,EPSG:4326")
    files["check_points"].write_text("\n".join(lines))
    picture = tmp_path / "errors.png"
    result = groundtie.assess_sensor(**files, height=300.0, picture=picture)
    assert (result.errors["before"].error_px == 0).all()
    assert cv2.imread(str(picture)).shape[0] > 100


def test_points_without_heights_take_the_grounds(files: dict[str, Path], tmp_path: Path) -> None:
    dem = write_dem(tmp_path / "dem.tif", steepness=0.0)
    px = np.array([[100.0, 100.0], [400.0, 300.0], [500.0, 50.0]])
    rows = np.column_stack([TRUTH.localise(px, 300.0), px])
    lines = ["reference_x,reference_y,input_col,input_row,reference_crs"]
    lines += [",".join(f"{v:.12f}" for v in row) + ",EPSG:4326" for row in rows]
    files["check_points"].write_text("\n".join(lines))
    result = groundtie.assess_sensor(**files, dem=dem, dem_datum="ellipsoidal")
    np.testing.assert_allclose(result.errors["before"].error_px, [BIAS] * 3, atol=1e-3)
    assert result.summary()["after"] is None


def test_points_off_what_wrong_rpcs_see_take_the_grounds_heights(
    files: dict[str, Path], tmp_path: Path
) -> None:
    dem = write_dem(tmp_path / "dem.tif", size=120, steepness=0.0)
    write_positions(files["image"], TRUTH.shifted((700.0, 0.0)))
    px = np.random.default_rng(0).uniform(50, 450, (20, 2))
    rows = np.column_stack([TRUTH.localise(px, 300.0), px])
    lines = ["reference_x,reference_y,input_col,input_row,reference_crs"]
    lines += [",".join(f"{v:.12f}" for v in row) + ",EPSG:4326" for row in rows]
    files["check_points"].write_text("\n".join(lines))
    result = groundtie.assess_sensor(**files, dem=dem, dem_datum="ellipsoidal")
    np.testing.assert_allclose(result.errors["before"].error_px, [(-700.0, 0.0)] * 20, atol=1e-3)


def test_points_where_no_height_is_known_are_counted(
    files: dict[str, Path], tmp_path: Path
) -> None:
    # The terrain model ends 250 m around the image's middle.
    dem = write_dem(tmp_path / "dem.tif", size=20, steepness=0.0)
    px = np.array([[300.0, 250.0], [280.0, 230.0], [20.0, 250.0]])
    rows = np.column_stack([TRUTH.localise(px, 300.0), px])
    head = "reference_x,reference_y,input_col,input_row,reference_crs,role"
    lines = [",".join(f"{v:.12f}" for v in row) + ",EPSG:4326,check" for row in rows]
    files["check_points"].write_text("\n".join([head, *lines, lines[2].replace("check", "fit")]))
    result = groundtie.assess_sensor(**files, dem=dem, dem_datum="ellipsoidal")
    summary = result.summary()
    assert (summary["points"], summary["points_without_height"]) == (2, 1)
    assert any(re.match("points left out, as the height .*: 1", line) for line in result.lines())
    files["check_points"].write_text("\n".join([head, lines[2]]))
    with pytest.raises(
        TooFewPointsError, match=r"that are used: points left out, as the height .*: 1"
    ):
        groundtie.assess_sensor(**files, dem=dem, dem_datum="ellipsoidal")


def test_without_points_nothing_is_judged(files: dict[str, Path], tmp_path: Path) -> None:
    files["check_points"].write_text(
        "reference_x,reference_y,input_col,input_row,state\n9.0,45.15,1,2,rejected: blunder\n"
    )
    with pytest.raises(TooFewPointsError, match="no points that are used"):
        groundtie.assess_sensor(**files, height=300.0, table=tmp_path / "a.csv")
    assert not (tmp_path / "a.csv").exists()


@pytest.mark.parametrize(
    "lost",
    [
        "4.12e9,5e6,100,100,300.0,EPSG:32632,check",  # UTM has no ground there
        "500000,5e6,1e9,100,300.0,EPSG:32632,check",  # the RPCs lead nowhere from there
    ],
)
def test_points_that_the_rpcs_cannot_place_are_counted(
    files: dict[str, Path], tmp_path: Path, lost: str
) -> None:
    head = files["check_points"].read_text().splitlines()[0]
    good = "500000,5e6,100,100,300.0,EPSG:32632,check"
    files["check_points"].write_text("\n".join([head, good, good, lost]))
    with pytest.raises(GeoreferencingError, match="cannot place 1 of 3 points"):
        groundtie.assess_sensor(**files, height=300.0, table=tmp_path / "a.csv")
    assert not (tmp_path / "a.csv").exists()


def test_points_of_a_fit_are_no_check_points(files: dict[str, Path]) -> None:
    lines = files["check_points"].read_text().splitlines()
    files["check_points"].write_text("\n".join([lines[0], lines[-1]]))
    with pytest.raises(TooFewPointsError, match=r"points\.csv: no points took no part in the fit"):
        groundtie.assess_sensor(**files, height=300.0)


def test_refined_rpcs_must_be_there(files: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(GroundTieError, match="cannot read the RPCs"):
        groundtie.assess_sensor(**files, refined=tmp_path / "none.txt", height=300.0)
