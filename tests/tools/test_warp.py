from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import UTM, utm_grid, wave_image, waves, write_raster
from rasterio.crs import CRS
from rasterio.warp import transform as to_crs
from scipy.ndimage import binary_erosion

from groundtie.declaration import tool_of
from groundtie.errors import (
    CancelledError,
    GeoreferencingError,
    NoOverlapError,
    NotRegisteredError,
    ParameterError,
    RasterOpenError,
    SameFileError,
    TooFewPointsError,
    TransformFileError,
)
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import PARAMETERS
from groundtie.geometry.tie_point_files import write_tie_points
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.progress import Progress
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.rasters.reading import open_raster
from groundtie.tools.warp import warp

LENGTH_M = 700.0
GRID = utm_grid(120, 100)
PLAIN = Grid(PIXEL_COORDINATES, None, 120, 100)


def distort(xy: np.ndarray) -> np.ndarray:
    """Where the input claims the ground to be: shifted, turned and stretched."""
    centre = np.array([500_600, 4_999_500])
    linear = np.array([[1.01, 0.02], [-0.02, 0.995]])
    return (xy - centre) @ linear + centre + [37.0, -24.0]


def undistort(xy: np.ndarray) -> np.ndarray:
    centre = np.array([500_600, 4_999_500])
    linear = np.array([[1.01, 0.02], [-0.02, 0.995]])
    return (xy - centre - [37.0, -24.0]) @ np.linalg.inv(linear) + centre


def every_pixel(grid: Grid) -> np.ndarray:
    cols, rows = np.meshgrid(np.arange(grid.width), np.arange(grid.height))
    return np.column_stack([cols.ravel(), rows.ravel()]).astype(float)


def misregistered(path: Path, grid: Grid = GRID, georeferenced: bool = True) -> Path:
    """Write a smooth field as seen by an image whose georeferencing is wrong by `distort`."""
    true_xy = undistort(grid.pixel_to_map(every_pixel(grid)))
    image = waves(true_xy, LENGTH_M).reshape(grid.height, grid.width).astype(np.float32)
    return write_raster(path, image, grid if georeferenced else None)


def the_transform(input_grid: Grid = GRID) -> Transform:
    xy = np.random.default_rng(0).uniform(0, 1000, (20, 2)) + [500_100, 4_999_000]
    claimed = distort(xy) if input_grid.is_georeferenced else GRID.map_to_pixel(distort(xy))
    return Transform(fit_model("affine", xy, claimed), UTM, input_grid)


def stored(path: Path, input_grid: Grid = GRID) -> Path:
    """Write the true transform, or tie points that are exact but for a rejected one."""
    transform = the_transform(input_grid)
    if path.suffix == ".json":
        path.write_text(json.dumps(transform.to_json()))
        return path
    px = np.random.default_rng(1).uniform(5, 95, (30, 2))
    xy = transform.inverse(px)
    px[7] += 40
    points = TiePoints(
        reference_xy=xy,
        input_px=px,
        score=np.ones(30),
        covariance_px2=np.tile(np.eye(2), (30, 1, 1)),
        forward_backward_error_px=np.zeros(30),
        is_check=np.arange(30) % 5 == 0,
        state=np.where(np.arange(30) == 7, "rejected: far", "used"),
    )
    write_tie_points(path, points, transform)
    return path


def error_of(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the differences between a registered image and the true field, and the values."""
    with rasterio.open(path) as dataset:
        values = dataset.read(1)
        grid = Grid(dataset.transform, dataset.crs, dataset.width, dataset.height)
    return np.abs(values - wave_image(grid, LENGTH_M)), values


def test_a_reference_in_degrees_across_the_antimeridian(tmp_path: Path) -> None:
    """Its map goes on beyond 180°: so does the registered raster, which is as large as before."""
    degrees, zone = CRS.from_epsg(4326), CRS.from_epsg(32701)
    grid = Grid(Affine(10, 0, 180_000, 0, -10, 8_118_000), zone, 120, 100)
    path = write_raster(tmp_path / "a.tif", wave_image(grid, LENGTH_M).astype(np.float32), grid)
    xy = np.random.default_rng(0).uniform([179.99, -17.01], [180.01, -16.99], (20, 2))
    transform = Transform(fit_model("affine", xy, xy + [1e-4, 0]), degrees, grid)
    (tmp_path / "t.json").write_text(json.dumps(transform.to_json()))
    made = warp(path, tmp_path / "out.tif", tmp_path / "t.json").grid
    west, east = made.pixel_to_map(made.outline(1))[[0, 2], 0]
    assert west < 180 < east
    assert made.width == pytest.approx(120, abs=6)


FILES = ("t.json", "t.gpkg", "t.geojson", "t.csv", "t.points")


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("georeferenced", [True, False])
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.slow
def test_the_distortion_is_taken_out(tmp_path: Path, name: str, georeferenced: bool) -> None:
    path = misregistered(tmp_path / "a.tif", georeferenced=georeferenced)
    transform = stored(tmp_path / name, GRID if georeferenced else PLAIN)
    result = warp(path, tmp_path / "out.tif", transform)
    error, values = error_of(tmp_path / "out.tif")
    known = np.isfinite(values)
    assert known.mean() > 0.85
    # Outside of the outermost pixels' centres there is nothing to interpolate between.
    inner = binary_erosion(known, iterations=3)
    assert error[inner].max() < 0.05
    assert result.transform.model.kind == "affine"
    assert result.grid.crs == UTM


def test_the_result_lines_up_with_the_input_and_covers_all_of_it(tmp_path: Path) -> None:
    path, transform = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.json")
    result = warp(path, tmp_path / "out.tif", transform)
    offset = GRID.map_to_pixel(result.grid.pixel_to_map([[0, 0]]))
    np.testing.assert_allclose(offset, np.rint(offset), atol=1e-6)
    assert result.grid.pixel_size == (10, 10)
    corners = undistort(GRID.pixel_to_map(GRID.outline()))
    assert result.grid.contains(result.grid.map_to_pixel(corners)).all()


def test_the_reference_gives_the_grid(tmp_path: Path) -> None:
    path, transform = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.json")
    grid = utm_grid(77, 55, 13.0).shifted(4, -3)
    reference = write_raster(tmp_path / "ref.tif", np.ones((55, 77), np.uint8), grid)
    result = warp(path, tmp_path / "out.tif", transform, reference)
    assert result.grid == open_raster(tmp_path / "out.tif").grid == grid
    error, values = error_of(tmp_path / "out.tif")
    assert error[np.isfinite(values)].max() < 0.5


def test_a_reference_in_another_crs(tmp_path: Path) -> None:
    path, transform = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.json")
    lonlat = CRS.from_epsg(4326)
    grid = Grid(rasterio.Affine(1e-4, 0, 9.004, 0, -1e-4, 45.149), lonlat, 60, 50)
    reference = write_raster(tmp_path / "ref.tif", np.ones((50, 60), np.uint8), grid)
    warp(path, tmp_path / "out.tif", transform, reference)
    with rasterio.open(tmp_path / "out.tif") as dataset:
        values = dataset.read(1)
    lon, lat = grid.pixel_to_map(every_pixel(grid)).T
    truth = waves(np.column_stack(to_crs(lonlat, UTM, lon, lat)), LENGTH_M).reshape(50, 60)
    known = np.isfinite(values)
    assert known.mean() > 0.5
    assert np.abs(values - truth)[known].max() < 0.5


def test_a_pixel_size_of_ones_own(tmp_path: Path) -> None:
    path, transform = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.json")
    result = warp(path, tmp_path / "out.tif", transform, pixel_size=25)
    assert result.grid.pixel_size == (25, 25)
    error, values = error_of(tmp_path / "out.tif")
    assert np.nanmedian(error[np.isfinite(values)]) < 1


@pytest.mark.parametrize("name", FILES)
def test_another_band_with_larger_pixels(tmp_path: Path, name: str) -> None:
    """Pan-sharp tie points, multispectral band: four times the pixel size, the same frame."""
    coarse = GRID.scaled(4)
    path = misregistered(tmp_path / "ms.tif", coarse)
    result = warp(path, tmp_path / "out.tif", stored(tmp_path / name))
    assert result.grid.pixel_size == (40, 40)
    error, values = error_of(tmp_path / "out.tif")
    known = np.isfinite(values)
    assert known.mean() > 0.7
    # Waves that are 17 px long now
    assert np.median(error[known]) < 0.3


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_a_plain_band_of_the_same_size_goes_by_its_pixels(tmp_path: Path) -> None:
    path = misregistered(tmp_path / "a.tif", georeferenced=False)
    warp(path, tmp_path / "out.tif", stored(tmp_path / "t.json"))
    error, values = error_of(tmp_path / "out.tif")
    assert np.median(error[np.isfinite(values)]) < 0.02


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize("transform_grid", [GRID, PLAIN])
def test_a_plain_band_of_another_size_is_refused(tmp_path: Path, transform_grid: Grid) -> None:
    path = write_raster(tmp_path / "a.tif", np.ones((25, 30), np.uint8))
    transform = stored(tmp_path / "t.json", transform_grid)
    with pytest.raises(GeoreferencingError, match=r"a\.tif has 30 × 25 pixels.*120 × 100"):
        warp(path, tmp_path / "out.tif", transform)


def test_a_raster_of_another_place_is_refused(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", np.ones((9, 9), np.uint8), GRID.window(5000, 0, 9, 9))
    with pytest.raises(NoOverlapError, match=r"a\.tif does not lie"):
        warp(path, tmp_path / "out.tif", stored(tmp_path / "t.json"))


def test_a_result_without_a_valid_pixel_is_refused(tmp_path: Path) -> None:
    """An older one is kept."""
    image = np.ones((100, 120), np.uint8)
    image[:, :60] = 0
    path = write_raster(tmp_path / "a.tif", image, GRID, nodata=0)
    empty = write_raster(tmp_path / "r.tif", np.ones((60, 30), np.uint8), utm_grid(30, 60))
    transform = stored(tmp_path / "t.json")
    (tmp_path / "out.tif").write_text("old")
    before = sorted(os.listdir(tmp_path))
    with pytest.raises(NoOverlapError, match=r"would hold no data: .*a\.tif has no valid pixels"):
        warp(path, tmp_path / "out.tif", transform, empty)
    assert sorted(os.listdir(tmp_path)) == before
    assert (tmp_path / "out.tif").read_text() == "old"
    line = write_raster(tmp_path / "l.tif", np.ones((1, 120), np.uint8), GRID.window(0, 50, 120, 1))
    with pytest.raises(NoOverlapError, match=r"or fewer than make one of its pixels"):
        warp(line, tmp_path / "new.tif", transform, pixel_size=40)
    assert not (tmp_path / "new.tif").exists()


def test_a_reference_of_another_place_is_refused(tmp_path: Path) -> None:
    path, transform = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.json")
    far = write_raster(tmp_path / "r.tif", np.ones((9, 9), np.uint8), GRID.window(5000, 0, 9, 9))
    with pytest.raises(NoOverlapError):
        warp(path, tmp_path / "out.tif", transform, far)
    assert not (tmp_path / "out.tif").exists()


@pytest.mark.slow
def test_tie_points_say_how_well_they_fit(tmp_path: Path) -> None:
    path, points = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.gpkg")
    result = warp(path, tmp_path / "out.tif", points)
    assert result.fit is not None
    assert (result.fit.points, result.fit.check_points) == (23, 6)
    assert result.fit.rmse_px == pytest.approx(0, abs=1e-6)
    assert result.fit.check_rmse_px == pytest.approx(0, abs=1e-6)
    assert "fitted to 23 tie points" in "\n".join(result.lines())
    # A shift cannot take up the rotation: the check points tell.
    shift = warp(path, tmp_path / "out.tif", points, model="translation")
    assert shift.fit is not None
    assert shift.fit.check_rmse_px is not None
    assert shift.fit.check_rmse_px > 0.5


def test_a_stored_transform_takes_no_model(tmp_path: Path) -> None:
    path, transform = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.json")
    with pytest.raises(ParameterError, match=r"fitted to tie points; .*t\.json holds a transform"):
        warp(path, tmp_path / "out.tif", transform, model="tps")
    assert not (tmp_path / "out.tif").exists()


def test_rigid_models_preserve_shapes_also_in_degrees(tmp_path: Path) -> None:
    """On a map in degrees at 60° north, a turned image is turned on the ground."""
    lonlat = CRS.from_epsg(4326)
    grid = Grid(rasterio.Affine(2e-4, 0, 9.0, 0, -1e-4, 60.0), lonlat, 100, 100)
    angle = np.deg2rad(10)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    px = np.random.default_rng(0).uniform(10, 90, (12, 2))
    xy = grid.pixel_to_map(px)
    # Lengths of a degree at 59.995° on the ellipsoid of WGS 84.
    metres = np.array([55_808.4, 111_412.2])
    centre = xy.mean(axis=0)
    reference_xy = ((xy - centre) * metres) @ turn / metres + centre
    path = tmp_path / "t.csv"
    lines = ["reference_x,reference_y,input_col,input_row"]
    lines += [f"{x!r},{y!r},{c!r},{r!r}" for (x, y), (c, r) in
              zip(reference_xy.tolist(), px.tolist(), strict=True)]  # fmt: skip
    path.write_text("\n".join(lines))
    raster = write_raster(tmp_path / "a.tif", np.ones((100, 100), np.uint8), grid)
    result = warp(raster, tmp_path / "out.tif", path, model="rigid")
    assert result.fit is not None
    assert result.fit.rmse_px < 0.01


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ({"name": "t.json", "text": "{}"}, TransformFileError),
        ({"name": "t.txt", "text": ""}, TransformFileError),
        ({"name": "t.csv", "text": "reference_x,reference_y,input_col,input_row\n1,2,3,4\n"},
         TooFewPointsError),
        ({"name": "t.csv", "text": "reference_x,reference_y,input_col,input_row\n"},
         TooFewPointsError),
    ],
)  # fmt: skip
def test_unusable_transforms(
    tmp_path: Path, content: dict[str, str], error: type[Exception]
) -> None:
    path = misregistered(tmp_path / "a.tif")
    transform = tmp_path / content["name"]
    transform.write_text(content["text"])
    with pytest.raises(error):
        warp(path, tmp_path / "out.tif", transform)


KINDS_OF_MODELS = ("rigid", "similarity", "affine", "polynomial2", "polynomial3", "tps")


def table_of(path: Path, reference_px: np.ndarray, input_px: np.ndarray) -> Path:
    lines = ["reference_x,reference_y,input_col,input_row"]
    places = np.hstack([GRID.pixel_to_map(reference_px), input_px])
    path.write_text("\n".join([*lines, *(",".join(map(repr, row)) for row in places.tolist())]))
    return path


@pytest.mark.parametrize("model", KINDS_OF_MODELS)
def test_fifty_times_one_point_is_refused(tmp_path: Path, model: str) -> None:
    px = np.tile([50.0, 40.0], (50, 1))
    table = table_of(tmp_path / "t.csv", px, px + 1)
    with pytest.raises(NotRegisteredError, match=r"no .* model follows from them"):
        warp(misregistered(tmp_path / "a.tif"), tmp_path / "out.tif", table, model=model)
    assert not (tmp_path / "out.tif").exists()


@pytest.mark.parametrize("model", KINDS_OF_MODELS)
def test_points_along_a_line_hold_rigid_models_alone(tmp_path: Path, model: str) -> None:
    px = np.linspace([10, 20], [100, 80], 30)
    table = table_of(tmp_path / "t.csv", px, px + 1)
    path = misregistered(tmp_path / "a.tif")
    if model in ("rigid", "similarity"):
        warp(path, tmp_path / "out.tif", table, model=model)
        return
    with pytest.raises(NotRegisteredError, match="tie points lie"):
        warp(path, tmp_path / "out.tif", table, model=model)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("model", ("translation", *KINDS_OF_MODELS))
def test_random_points_are_refused(tmp_path: Path, model: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    table = table_of(tmp_path / "t.csv", *random.uniform(0, 100, (2, 25, 2)))
    with pytest.raises(NotRegisteredError, match="no better than random ones"):
        warp(misregistered(tmp_path / "a.tif"), tmp_path / "out.tif", table, model=model)


@pytest.mark.parametrize("model", ("translation", *KINDS_OF_MODELS))
def test_points_set_by_hand_pass(tmp_path: Path, model: str) -> None:
    """Twice as many as the model needs, all over the raster, each a pixel off."""
    random = np.random.default_rng(3)
    px = np.stack(np.meshgrid(np.linspace(5, 115, 5), np.linspace(5, 95, 4)), -1).reshape(-1, 2)
    px = random.permuted(px, axis=0)[: PARAMETERS[model] + 2] if PARAMETERS[model] < 18 else px
    table = table_of(tmp_path / "t.csv", px, px + 3 + 0.7 * random.normal(size=px.shape))
    result = warp(misregistered(tmp_path / "a.tif"), tmp_path / "out.tif", table, model=model)
    assert result.fit is not None
    assert result.fit.log10_chance is not None
    assert result.fit.log10_chance < -3


def test_points_that_the_model_needs_all_are_warned_of(tmp_path: Path) -> None:
    px = np.array([[10.0, 10.0], [100.0, 20.0], [30.0, 90.0]])
    table = table_of(tmp_path / "t.csv", px, px + 3)
    result = warp(misregistered(tmp_path / "a.tif"), tmp_path / "out.tif", table)
    assert result.fit is not None
    assert result.fit.log10_chance is None
    assert any(line.startswith("warning: the model needs all") for line in result.lines())
    json.dumps(result.summary(), allow_nan=False)


def test_bad_calls(tmp_path: Path) -> None:
    path, transform = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.json")
    calls: list[tuple[type[Exception], dict[str, Any]]] = [
        (ParameterError, {"reference": path, "pixel_size": 5}),
        (ParameterError, {"model": "quintic"}),
        (ParameterError, {"resampling": "magic"}),
        (ParameterError, {"workers": 0}),
        (ParameterError, {"output": tmp_path / "out.png"}),
        (SameFileError, {"output": path}),
        (RasterOpenError, {"input": tmp_path / "missing.tif"}),
        (RasterOpenError, {"reference": tmp_path / "missing.tif"}),
        (TransformFileError, {"transform": tmp_path / "missing.json"}),
    ]
    usual = {"input": path, "output": tmp_path / "out.tif", "transform": transform}
    for error, change in calls:
        with pytest.raises(error):
            warp(**(usual | change))
    assert sorted(os.listdir(tmp_path)) == ["a.tif", "t.json"]


def test_cancelling_leaves_nothing_and_keeps_an_old_result(tmp_path: Path) -> None:
    path, transform = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.json")
    (tmp_path / "out.tif").write_text("old")
    with pytest.raises(CancelledError):
        warp(path, tmp_path / "out.tif", transform, progress=Progress(is_cancelled=lambda: True))
    assert sorted(os.listdir(tmp_path)) == ["a.tif", "out.tif", "t.json"]
    assert (tmp_path / "out.tif").read_text() == "old"


def test_the_summary_is_for_programs(tmp_path: Path) -> None:
    path, points = misregistered(tmp_path / "a.tif"), stored(tmp_path / "t.points")
    result = warp(path, tmp_path / "out.tif", points, workers=1)
    summary = json.loads(json.dumps(result.summary()))
    assert summary["width"] == result.grid.width
    assert summary["crs"] == "EPSG:32632"
    assert summary["model"] == "affine"
    # Of 30 points, six are check points and one is rejected: none of these is enabled.
    assert summary["tie_points"]["points"] == 23
    for output in tool_of(warp).outputs:
        assert output.value(summary) is not None
    assert any("EPSG:32632" in line for line in result.lines())


def test_edited_lines_are_told(tmp_path: Path) -> None:
    path = misregistered(tmp_path / "a.tif")
    points = stored(tmp_path / "t.geojson")
    collection = json.loads(points.read_text())
    for count, told in ((1, "1 point"), (4, "4 points")):
        for feature in collection["features"][:count]:
            feature["geometry"]["coordinates"][1][0] += 1e-3
        points.write_text(json.dumps(collection))
        result = warp(path, tmp_path / "out.tif", points)
        assert f"edited by hand: {told}; of lines the ends count, not the columns" in result.lines()
        assert result.summary()["tie_points"]["edited"] == count
