from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rasterio.crs import CRS
from rpc_models import camera_rpc, relief, write_dem, write_positions

from groundtie.rasters.reading import open_raster
from groundtie.sensor.adjustment import Control, adjust
from groundtie.sensor.height_check import HeightCheck, check_heights
from groundtie.sensor.orientation import orient
from groundtie.sensor.rpc import RPC, image_lattice
from groundtie.sensor.rpc_fit import fit_rpc

SIZE = (600, 500)
UTM = CRS.from_epsg(32632)


def narrow() -> RPC:
    """Return RPCs that were made for the relief's heights alone, as suppliers make them."""
    rpc = camera_rpc()
    ground = relief(rpc.localise(*image_lattice(SIZE, [300.0])))
    px, height = image_lattice(SIZE, np.linspace(ground.min(), ground.max(), 5))
    lon_lat = rpc.localise(px, height)
    return fit_rpc(lon_lat, height, rpc.project(lon_lat, height)).rpc


def check(folder: Path, rpc: RPC, offset_m: float) -> HeightCheck:
    px = np.random.default_rng(0).uniform(0, 1, (20, 2)) * SIZE
    control = Control(px, px, np.tile(0.01 * np.eye(2), (20, 1, 1)), SIZE)
    image = write_positions(folder / "image.tif", rpc)
    dem = write_dem(folder / "dem.tif", offset_m=offset_m)
    with open_raster(image, allow_sensor_geometry=True) as source, open_raster(dem) as terrain:
        return check_heights(orient(source, rpc, UTM, terrain), control, adjust(control))


@pytest.mark.slow
@pytest.mark.parametrize("offset_m", [-45.0, 45.0])
def test_ground_beyond_the_rpcs_range_is_told(tmp_path: Path, offset_m: float) -> None:
    found = check(tmp_path, narrow(), offset_m)
    assert found.beyond_m * offset_m > 0
    assert "vertical datum" in found.warnings()[0]


@pytest.mark.slow
def test_ground_within_the_range_is_not(tmp_path: Path) -> None:
    assert check(tmp_path, narrow(), 0.0).warnings() == []
    # Wide ranges hide a wrong datum: it cannot be told.
    assert check(tmp_path, camera_rpc(), 45.0).warnings() == []


def test_heights_of_control_points_tell_a_wrong_datum() -> None:
    plain = HeightCheck((100, 500), (0, 800), None)
    assert replace(plain, control_offset_m=3.0).warnings() == []
    assert "-41 m" in replace(plain, control_offset_m=-41.0).warnings()[0]


def told_by_residuals(tmp_path: Path, noise_px: float) -> tuple[float, float]:
    """Return offset and sigma that 200 points tell of +40 m, in an image of 600 px at nadir."""
    rpc = camera_rpc(SIZE, pixel_m=400.0, off_nadir=(0.0, 0.0))
    image = write_positions(tmp_path / "image.tif", rpc)
    with open_raster(image, allow_sensor_geometry=True) as source:
        orientation = orient(source, rpc, UTM, None, height_m=300.0)
    random = np.random.default_rng(0)
    px = random.uniform(0, 1, (200, 2)) * SIZE
    ground = rpc.localise(px, 300.0)
    found = rpc.project(ground, 340.0) + random.normal(0, noise_px, px.shape) + [5.0, -3.0]
    control = Control(px, found, np.tile(np.eye(2) * noise_px**2, (200, 1, 1)), SIZE)
    adjustment = replace(adjust(control, "shift"), sigma_px=0.0, used=np.ones(200, bool))
    result = check_heights(orientation, control, adjustment)
    assert result.offset_m is not None
    assert result.offset_sigma_m is not None
    return result.offset_m, result.offset_sigma_m


@pytest.mark.slow
def test_residuals_hardly_tell_a_height_error(tmp_path: Path) -> None:
    """It is a shift, but for how the view turns over the image: 1/1700 of a metre a pixel."""
    offset, sigma = told_by_residuals(tmp_path, 0.002)
    assert abs(offset - 40) < 4 * sigma + 1
    assert told_by_residuals(tmp_path, 0.3)[1] > 40


def test_an_affine_bias_is_no_height_error(tmp_path: Path) -> None:
    """Points that a shift was fitted to may show an affine change, which nobody believes."""
    rpc = camera_rpc(SIZE)
    image = write_positions(tmp_path / "image.tif", rpc)
    with open_raster(image, allow_sensor_geometry=True) as source:
        orientation = orient(source, rpc, UTM, None, height_m=300.0)
    random = np.random.default_rng(0)
    px = random.uniform(0, 1, (200, 2)) * SIZE
    found = px + [5.0, -3.0] + (px - np.array(SIZE) / 2) @ [[1e-3, 0], [-5e-4, 1e-3]]
    found += random.normal(0, 0.1, px.shape)
    control = Control(px, found, np.tile(np.eye(2) * 0.1**2, (200, 1, 1)), SIZE)
    result = check_heights(orientation, control, adjust(control, "shift"))
    assert result.warnings() == []


def test_what_cannot_tell_a_datum_is_not_told() -> None:
    plain = HeightCheck((100, 500), (0, 800), None)
    assert replace(plain, offset_m=538.0, offset_sigma_m=116.0).warnings() == []
    assert "+45 ± 5 m" in replace(plain, offset_m=45.0, offset_sigma_m=5.0).warnings()[0]
