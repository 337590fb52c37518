from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rasterio.crs import CRS
from rpc_models import camera_rpc, relief, write_dem, write_positions

from groundtie.rasters.reading import open_raster
from groundtie.sensor.height_check import HeightCheck, check_heights
from groundtie.sensor.orientation import orient
from groundtie.sensor.rpc import RPC, image_places
from groundtie.sensor.rpc_fit import fit_rpc

SIZE = (600, 500)
UTM = CRS.from_epsg(32632)


def narrow() -> RPC:
    """Return RPCs that were made for the relief's heights alone, as suppliers make them."""
    rpc = camera_rpc()
    ground = relief(rpc.localise(*image_places(SIZE, [300.0])))
    px, height = image_places(SIZE, np.linspace(ground.min(), ground.max(), 5))
    lon_lat = rpc.localise(px, height)
    return fit_rpc(lon_lat, height, rpc.project(lon_lat, height)).rpc


def check(folder: Path, rpc: RPC, offset_m: float) -> HeightCheck:
    image = write_positions(folder / "image.tif", rpc)
    dem = write_dem(folder / "dem.tif", offset_m=offset_m)
    with open_raster(image, allow_sensor_geometry=True) as source, open_raster(dem) as terrain:
        return check_heights(orient(source, rpc, UTM, terrain), SIZE, None)


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
