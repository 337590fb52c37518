from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster

from benchmarks import ortho, rpc, rpc_speed
from benchmarks.accuracy import CORRECT, REFUSED
from benchmarks.attempt import Try
from benchmarks.cases import RealCase
from benchmarks.half_real import BIASES, LARGEST_SHIFT_PX, SENSORS, bias_of, make_scene, sensor_rpc
from benchmarks.processes import Measured
from groundtie.rasters.grid import LON_LAT, Grid, reproject
from groundtie.rasters.reading import open_raster
from groundtie.sensor.orientation import orient


def test_biases_turn_and_grow() -> None:
    biases = [bias_of(number, (500, 400)) for number in range(BIASES)]
    lengths = [float(np.hypot(*bias.coefficients[0])) for bias in biases]
    np.testing.assert_allclose(lengths, LARGEST_SHIFT_PX * np.arange(1, BIASES + 1) / BIASES)
    assert {bias.kind for bias in biases} == {"shift", "shift_drift"}


@pytest.mark.slow
@pytest.mark.parametrize("sensor", list(SENSORS))
def test_a_scene_shows_the_ground_where_its_true_rpcs_see_it(
    real_data: Path, tmp_path: Path, sensor: str
) -> None:
    """The optical image holds its own columns: the sensor image shows whence it was taken."""
    columns = np.tile(np.arange(10, 130, dtype=np.uint8), (110, 1))
    case = RealCase(
        "ramp",
        "sar-optical",
        write_raster(tmp_path / "sar.tif", np.ones((100, 90), np.uint8)),
        write_raster(tmp_path / "optical.tif", columns),
        1.0,
        np.array([[1.0, 0.0, 4.0], [0.0, 1.0, 3.0]]),
    )
    scene = make_scene(case, sensor_rpc(real_data, sensor), 2, tmp_path / "scene")
    assert scene.error_px(scene.truth) < 1e-6
    assert scene.error_px(scene.delivered) == pytest.approx(30.0, abs=0.1)
    with (
        open_raster(scene.image, allow_sensor_geometry=True) as image,
        open_raster(scene.reference) as reference,
        open_raster(scene.dem) as dem,
    ):
        values, valid = image.read(image.window)
        orientation = orient(image, scene.truth, reference.grid.crs, dem)
        px = np.argwhere(valid)[::97, ::-1].astype(float)
        place = reference.grid.map_to_pixel(orientation.to_map(px))
        shown = values[px[:, 1].astype(int), px[:, 0].astype(int)]
    inside = (place > 3).all(axis=1) & (place < [85, 95]).all(axis=1)
    assert inside.sum() > 50
    # Column 0 of the optical image has the value 10, and lies 4 columns from the reference's.
    assert np.abs(shown - (place[:, 0] + 14))[inside].max() <= 1


def outcome(verdict: str) -> rpc.Outcome:
    return Try(None, verdict, "", 0.0).unregistered("a", "b", 1.0)


def test_goals_count_refusals_as_right_and_wrong_ones_as_wrong() -> None:
    right = rpc.goals([outcome(CORRECT), outcome(REFUSED)], [], [])
    assert right[0].reached
    wrong = rpc.simulated_goal(rpc.RURAL, [outcome(CORRECT), outcome("silently wrong")])
    assert not wrong.reached
    assert "1 right, 0 refused" in wrong.found


def test_a_round_trip_is_judged_by_its_truth(real_data: Path) -> None:
    found = rpc.RoundTripCase(real_data, "triplet", 0, False).run(1)
    assert found.group == rpc.ROUND_TRIP
    assert found.verdict == CORRECT
    assert 0 < found.error_px < rpc.RECOVERED_PX


def test_speed_goals_compare_with_what_is_there() -> None:
    timings = [
        (rpc_speed.FORWARD, rpc_speed.OWN, 0.03, ""),
        (rpc_speed.INVERSE, rpc_speed.OWN, 0.2, ""),
        (rpc_speed.FORWARD, rpc_speed.RASTERIO, 0.09, ""),
        (rpc_speed.INVERSE, rpc_speed.RASTERIO, 0.3, ""),
    ]
    assert [goal.reached for goal in rpc_speed.goals(timings)] == [True, False, True]


@pytest.mark.parametrize(("seconds", "reached"), [(2.0, True), (2.6, False)])
def test_the_orthoimage_is_compared_with_the_same_file(seconds: float, reached: bool) -> None:
    found = {
        name: Measured(time, 2 * time, 1, 0, "")
        for name, time in ((ortho.OWN, seconds), (ortho.GDALWARP_FAST, 1.0), (ortho.SAME_FILE, 2.5))
    }
    assert [goal.reached for goal in ortho.goals(found)] == [reached]
    del found[ortho.SAME_FILE]
    assert ortho.goals(found) == []


@pytest.mark.skipif(shutil.which("gdaladdo") is None, reason="GDAL's programs are not installed")
def test_overviews_are_added_to_what_a_command_writes(tmp_path: Path) -> None:
    image = write_raster(tmp_path / "a.tif", np.ones((600, 600), np.uint8), utm_grid(600, 600))
    words = ortho.with_overviews(["gdal_translate", "-q", str(image), ortho.OUTPUT])
    output = tmp_path / "b.tif"
    subprocess.run([str(output) if word == ortho.OUTPUT else word for word in words], check=True)
    with rasterio.open(output) as raster:
        assert raster.overviews(1) == [2, 4, 8, 16]


def test_gdalwarp_gets_the_same_grid(tmp_path: Path) -> None:
    place = reproject(np.array([[9.0, 45.0]]), LON_LAT, LON_LAT)[0]
    from affine import Affine

    grid = Grid(Affine(0.001, 0, place[0], 0, -0.001, place[1]), LON_LAT, 20, 10)
    like = write_raster(tmp_path / "like.tif", np.ones((10, 20), np.uint8), grid)
    words = ortho.gdalwarp(Path("i.tif"), Path("d.tif"), like, "0.125")
    at = words.index("-te")
    np.testing.assert_allclose([float(w) for w in words[at + 1 : at + 5]], [9.0, 44.99, 9.02, 45.0])
    assert words[words.index("-ts") + 1 : words.index("-ts") + 3] == ["20", "10"]
