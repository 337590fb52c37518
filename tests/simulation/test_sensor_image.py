"""Sensor images: RPCs, bias and picture against the camera, GDAL and the orthoimage."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import rasterio
import rasterio.warp
from rasterio.crs import CRS
from rasterio.rpc import RPC

from groundtie.errors import OutputError, ParameterError
from groundtie.rasters.grid import reproject
from groundtie.sensor.rpc_files import read_rpc
from groundtie.sensor.rpc_tags import rpc_from_tags, rpc_to_tags
from groundtie.simulation.attitude import AttitudeOptions
from groundtie.simulation.optical import OpticalOptions, blur, render_radiance
from groundtie.simulation.sar import SarOptions
from groundtie.simulation.scene import SceneOptions, generate_scenes
from groundtie.simulation.sensor_files import (
    CHECK_POINT_COLUMNS,
    NAMES,
    ROOF_POINT_COLUMNS,
    write_sensor_image,
)
from groundtie.simulation.sensor_image import (
    GROUND_M,
    SensorImage,
    SensorOptions,
    simulate_sensor_image,
)

LON_LAT = CRS.from_epsg(4326)

OPTIONS = SensorOptions(
    SceneOptions((400, 360), density="suburban", relief_m=60.0, seed=4),
    SarOptions(looks=4.0),
    OpticalOptions(off_nadir_deg=22.0, bands=("red",), noise_dn=0.0),
    AttitudeOptions(shift_m=80.0, drift_px=3.0, rotation_deg=0.1),
)


@pytest.fixture(scope="module")
def made() -> SensorImage:
    return simulate_sensor_image(OPTIONS)


@pytest.fixture(scope="module")
def paths(made: SensorImage, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return write_sensor_image(made, tmp_path_factory.mktemp("sensor") / "new")


def table(path: Path) -> dict[str, np.ndarray]:
    values = np.genfromtxt(path, delimiter=",", names=True)
    return {name: values[name] for name in values.dtype.names or ()}


def check_points(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Longitude and latitude, height, image position."""
    read = table(path)
    xy = np.column_stack([read["reference_x"], read["reference_y"]])
    px = np.column_stack([read["input_col"], read["input_row"]])
    return reproject(xy, CRS.from_epsg(32633), LON_LAT), read["height_m"], px


class TestRpcs:
    @pytest.mark.slow
    def test_exact_ones_are_the_camera(self, made: SensorImage) -> None:
        assert made.exact.largest_residual_px < 0.01
        assert made.delivered.largest_residual_px < 0.01
        generator = np.random.default_rng(3)
        px = generator.uniform(0, 359, (500, 2))
        height = GROUND_M + generator.uniform(-200, 200, 500)
        lon_lat = reproject(made.camera.localise(px, height), made.reference_grid.crs, LON_LAT)
        np.testing.assert_allclose(made.exact.rpc.project(lon_lat, height), px, atol=0.01)
        expected = made.error(px)
        np.testing.assert_allclose(made.delivered.rpc.project(lon_lat, height), expected, atol=0.01)

    @pytest.mark.slow
    def test_files_hold_them(self, made: SensorImage, paths: dict[str, Path]) -> None:
        assert read_rpc(paths["exact_rpc"]) == made.exact.rpc
        with rasterio.open(paths["image"]) as image:
            delivered = rpc_from_tags(image.tags(ns="RPC"), "sensor.tif")
        lon_lat, height, _ = check_points(paths["check_points"])
        # GDAL prints fifteen digits.
        np.testing.assert_allclose(
            delivered.project(lon_lat, height),
            made.delivered.rpc.project(lon_lat, height),
            atol=1e-6,
        )

    @pytest.mark.slow
    def test_bias_is_recovered_from_the_check_points(self, paths: dict[str, Path]) -> None:
        """An affine map fitted to what the delivered RPCs say is the truth's matrix."""
        lon_lat, height, px = check_points(paths["check_points"])
        with rasterio.open(paths["image"]) as image:
            claimed = rpc_from_tags(image.tags(ns="RPC"), "").project(lon_lat, height)
        design = np.column_stack([claimed, np.ones(len(px))])
        found, *_ = np.linalg.lstsq(design, px, rcond=None)
        np.testing.assert_allclose(design @ found, px, atol=1e-4)
        truth = json.loads(paths["truth"].read_text())
        np.testing.assert_allclose(design @ np.transpose(truth["delivered_to_true"]), px, atol=1e-4)
        # The error is 80 m at the centre of the image.
        matrix = np.array(truth["true_to_delivered"])
        centre = np.array([199.5, 179.5])
        assert math.dist(matrix @ [*centre, 1], centre) == pytest.approx(80)

    @pytest.mark.slow
    def test_no_error_no_bias(self) -> None:
        none = replace(OPTIONS, attitude=AttitudeOptions(0.0, 0.0, 0.0))
        made = simulate_sensor_image(replace(none, scene=SceneOptions((64, 64), relief_m=0.0)))
        assert made.exact.rpc == made.delivered.rpc


class TestPicture:
    @pytest.mark.slow
    def test_gdal_brings_it_onto_the_map(self, made: SensorImage, paths: dict[str, Path]) -> None:
        """GDAL's orthorectification by exact RPCs and DEM is the simulator's own orthoimage."""
        ortho = gdal_ortho(paths)
        margin = (made.terrain.grid.width - made.reference_grid.width) // 2
        scene = generate_scenes(OPTIONS.scene, margin).radar
        radiance = render_radiance(scene, OPTIONS.optical)[0]
        blur(radiance, OPTIONS.optical.psf_sigma_px)
        expected = radiance[margin:-margin, margin:-margin]
        shifts = []
        for row in range(50, 250, 64):
            for column in range(50, 290, 64):
                tile = slice(row, row + 64), slice(column, column + 64)
                window = cv2.createHanningWindow((64, 64), cv2.CV_64F)
                pair = expected[tile].astype(float), ortho[tile].astype(float)
                shifts.append(cv2.phaseCorrelate(*pair, window)[0])
        assert np.hypot(*np.median(shifts, axis=0)) < 0.05
        assert np.hypot(*np.transpose(shifts)).max() < 0.2
        inside = (slice(50, 310), slice(50, 350))
        assert np.corrcoef(ortho[inside].ravel(), expected[inside].ravel())[0, 1] > 0.998

    def test_it_is_not_a_map(self, made: SensorImage, paths: dict[str, Path]) -> None:
        with rasterio.open(paths["image"]) as image:
            assert image.crs is None
            assert np.array_equal(image.read(), made.image)
            assert image.descriptions == ("Red",)

    @pytest.mark.slow
    def test_roofs_lean_on_a_plain(self) -> None:
        """Where the picture shows roofs is where collinearity has them."""
        scene = SceneOptions((300, 300), density="city", relief_m=0.0, seed=2)
        made = simulate_sensor_image(replace(OPTIONS, scene=scene))
        roofs = made.roof_points
        assert len(roofs.px) > 10
        top = made.ground_m(roofs.px) + roofs.height_m[:, None] * [0, 0, 1]
        np.testing.assert_allclose(made.camera.project(top), roofs.input_px, atol=0.05)

    @pytest.mark.slow
    def test_same_options_same_image(self, made: SensorImage) -> None:
        assert np.array_equal(simulate_sensor_image(OPTIONS).image, made.image)


def gdal_ortho(paths: dict[str, Path]) -> np.ndarray:
    """The image on the reference's grid by GDAL."""
    tags = rpc_to_tags(read_rpc(paths["exact_rpc"]))
    with rasterio.open(paths["image"]) as image, rasterio.open(paths["reference"]) as reference:
        ortho = np.zeros(reference.shape, np.float32)
        rasterio.warp.reproject(
            image.read(1).astype(np.float32),
            ortho,
            rpcs=RPC.from_gdal(tags),
            src_crs=LON_LAT,
            dst_crs=reference.crs,
            dst_transform=reference.transform,
            resampling=rasterio.warp.Resampling.cubic,
            tolerance=0.0,
            RPC_DEM=str(paths["dem"]),
        )
    return ortho


class TestGround:
    def test_check_points(self, made: SensorImage, paths: dict[str, Path]) -> None:
        lon_lat, height, px = check_points(paths["check_points"])
        assert len(px) > 60
        np.testing.assert_allclose(made.exact.rpc.project(lon_lat, height), px, atol=1e-3)
        assert np.all((px >= -0.5) & (px <= np.array([400, 360]) - 0.5))

    def test_their_heights_are_the_terrain_models(self, paths: dict[str, Path]) -> None:
        read = table(paths["check_points"])
        with rasterio.open(paths["dem"]) as dem:
            near = [
                v[0]
                for v in dem.sample(np.column_stack([read["reference_x"], read["reference_y"]]))
            ]
            assert dem.descriptions == ("Height of ground above the ellipsoid (m)",)
        # The nearest pixel's height, on slopes of at most 20°.
        np.testing.assert_allclose(read["height_m"], near, atol=0.3)
        assert abs(np.mean(near) - GROUND_M) < 100

    def test_the_terrain_model_covers_what_the_image_claims_to_show(
        self, made: SensorImage, paths: dict[str, Path]
    ) -> None:
        corners = np.array([[0, 0], [399, 0], [0, 359], [399, 359]], float)
        for rpc in (made.exact.rpc, made.delivered.rpc):
            for height in (made.terrain.height_m.min(), made.terrain.height_m.max()):
                lon_lat = rpc.localise(corners, float(height))
                xy = reproject(lon_lat, LON_LAT, made.terrain.grid.crs)
                assert made.terrain.grid.contains(made.terrain.grid.map_to_pixel(xy)).all()

    def test_columns(self, paths: dict[str, Path]) -> None:
        assert tuple(table(paths["check_points"])) == CHECK_POINT_COLUMNS
        assert tuple(table(paths["roof_points"])) == ROOF_POINT_COLUMNS


class TestFiles:
    def test_writes_these_and_no_others(self, paths: dict[str, Path]) -> None:
        written = {path.name for path in paths["truth"].parent.iterdir()}
        assert written == set(NAMES.values())

    def test_leaves_nothing_behind_when_one_cannot_be_written(
        self, made: SensorImage, tmp_path: Path
    ) -> None:
        (tmp_path / "truth.json").mkdir()
        with pytest.raises(OutputError):
            write_sensor_image(made, tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["truth.json"]


def test_refuses_a_view_that_is_too_flat() -> None:
    with pytest.raises(ParameterError):
        SensorOptions(optical=OpticalOptions(off_nadir_deg=50.0))


@pytest.mark.parametrize(
    ("pixel_m", "message"), [(8e5, "ground beyond the map"), (1e7, "is larger than its map")]
)
def test_refuses_a_scene_that_is_larger_than_the_map(pixel_m: float, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        simulate_sensor_image(SensorOptions(SceneOptions((16, 16), pixel_m)))
