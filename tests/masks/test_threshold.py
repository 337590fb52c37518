from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from masks.scenes import scene_of
from raster_files import write_raster
from scipy.ndimage import distance_transform_edt

from groundtie.errors import ParameterError, RasterContentError
from groundtie.masks.scene import Scene, write_mask
from groundtie.masks.threshold import ThresholdMask
from groundtie.rasters.atomic import Outputs
from groundtie.rasters.grid import LON_LAT, Grid
from groundtie.rasters.reading import Window, open_raster


def block_means(image: np.ndarray) -> np.ndarray:
    height, width = (side // 4 for side in image.shape)
    return image[: 4 * height, : 4 * width].reshape(height, 4, width, 4).mean(axis=(1, 3))


@pytest.fixture
def image() -> np.ndarray:
    return np.random.default_rng(0).gamma(2, 50, (120, 160)).astype(np.float32)


@pytest.mark.parametrize(("high", "low"), [(20, 0), (0, 10), (35, 15)])
def test_so_many_percent_of_the_blocks_take_no_part(
    tmp_path: Path, image: np.ndarray, high: float, low: float
) -> None:
    scene = scene_of(tmp_path / "a.tif", image)
    chosen = ThresholdMask.of(scene, high, low).select(scene.whole).part
    means = block_means(image)
    lowest, highest = np.percentile(means, [low, 100 - high])
    expected = (means >= lowest) & (means <= highest)
    assert expected.mean() == pytest.approx(1 - (high + low) / 100, abs=0.01)
    np.testing.assert_array_equal(chosen, np.kron(expected, np.ones((4, 4))) > 0)


def test_a_mask_grows_by_a_distance(tmp_path: Path, image: np.ndarray) -> None:
    scene = scene_of(tmp_path / "a.tif", image)
    plain = ThresholdMask.of(scene, 3).select(scene.whole).part
    grown = ThresholdMask.of(scene, 3, grow_m=5).select(scene.whole).part
    np.testing.assert_array_equal(grown, distance_transform_edt(plain) > 5.5)


@pytest.mark.parametrize("latitude", [0.0, 50.0, 70.0])
def test_a_mask_grows_by_metres_in_degrees(tmp_path: Path, latitude: float) -> None:
    image = np.ones((301, 301), np.float32)
    image[148:152, 148:152] = 100
    step = 1e-5
    grid = Grid(Affine(step, 0, 10, 0, -step, latitude + 150 * step), LON_LAT, 301, 301)
    scene = Scene.of(open_raster(write_raster(tmp_path / "a.tif", image, grid)))
    out = ~ThresholdMask.of(scene, 0.02, grow_m=30).select(scene.whole).part
    rows, cols = np.nonzero(out)
    # A degree on a sphere; the ellipsoid's differ by less than 0.7 %.
    side_m = step * 111_195 * np.array([np.cos(np.deg2rad(latitude)), 1])
    beyond_m = (np.array([np.ptp(cols), np.ptp(rows)]) + 1 - 4) / 2 * side_m
    np.testing.assert_allclose(beyond_m, 30, atol=side_m.max() / 2 + 0.2)
    # Within the rounded corners of a square of so many pixels.
    assert out.sum() * side_m.prod() == pytest.approx(
        np.pi * 30**2 + 4 * side_m @ [60, 60] + 16 * side_m.prod(), rel=0.03
    )


@pytest.mark.parametrize("grow", [0, 3])
def test_windows_are_cut_from_one_and_the_same_mask(
    tmp_path: Path, image: np.ndarray, grow: int
) -> None:
    scene = scene_of(tmp_path / "a.tif", image[:118, :157])
    mask = ThresholdMask.of(scene, 15, 5, grow)
    whole = mask.select(scene.whole).part
    for window in (Window(0, 0, 64, 64), Window(33, 17, 70, 50), Window(101, 90, 56, 28)):
        part = whole[window.row :, window.col :][: window.height, : window.width]
        np.testing.assert_array_equal(mask.select(window).part, part)


def test_what_holds_no_data_takes_no_part_and_does_not_count(
    tmp_path: Path, image: np.ndarray
) -> None:
    image[:, 80:] = -9999
    scene = scene_of(tmp_path / "a.tif", image, nodata=-9999)
    chosen = ThresholdMask.of(scene, 25).select(scene.whole).part
    assert not chosen[:, 80:].any()
    assert chosen[:, :80].mean() == pytest.approx(0.75, abs=0.01)


def test_an_image_without_data_is_refused(tmp_path: Path) -> None:
    scene = scene_of(tmp_path / "a.tif", np.zeros((40, 40), np.float32), nodata=0)
    with pytest.raises(RasterContentError, match="no valid pixels"):
        ThresholdMask.of(scene, 20)


@pytest.mark.parametrize("low", [60, 90])
def test_something_is_left_between_the_thresholds(
    tmp_path: Path, image: np.ndarray, low: float
) -> None:
    scene = scene_of(tmp_path / "a.tif", image)
    with pytest.raises(ParameterError, match="nothing is left"):
        ThresholdMask.of(scene, 40, low)


def test_a_written_mask_is_0_and_1_on_the_same_grid(tmp_path: Path, image: np.ndarray) -> None:
    scene = scene_of(tmp_path / "a.tif", np.tile(image, (5, 4)))
    mask = ThresholdMask.of(scene, 30)
    with Outputs() as outputs:
        share = write_mask(scene, outputs.stage(tmp_path / "mask.tif"), mask.select)
    with rasterio.open(tmp_path / "mask.tif") as written, rasterio.open(tmp_path / "a.tif") as own:
        values = written.read(1)
        assert (written.transform, written.crs) == (own.transform, own.crs)
    np.testing.assert_array_equal(values, mask.select(scene.whole).part)
    assert share == pytest.approx(values.mean())


def test_the_share_is_that_of_valid_pixels(tmp_path: Path, image: np.ndarray) -> None:
    image[:, 80:] = -9999
    scene = scene_of(tmp_path / "a.tif", image, nodata=-9999)
    mask = ThresholdMask.of(scene, 25)
    share = write_mask(scene, tmp_path / "mask.tif", mask.select)
    assert share == pytest.approx(0.75, abs=0.01)
