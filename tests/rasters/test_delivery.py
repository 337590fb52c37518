from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from affine import Affine
from raster_files import UTM, full_disk, utm_grid, wave_image, waves, write_raster
from rasterio.enums import ColorInterp

from groundtie.errors import CancelledError, OutputError, RasterOpenError
from groundtie.progress import Progress
from groundtie.rasters import tiling
from groundtie.rasters.atomic import Outputs
from groundtie.rasters.delivery import tiles, warp_raster, write_with_geotransform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, apply_affine, compose
from groundtie.rasters.nodata import keep_apart
from groundtie.rasters.reading import open_raster

RNG = np.random.default_rng(0)
GRID = utm_grid(90, 70)
OF_ALPHA = [ColorInterp.gray, ColorInterp.alpha]
IMAGE = RNG.integers(1, 1000, (70, 90)).astype(np.uint16)


@pytest.fixture
def small_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make many tiles of a small image; they are no longer whole blocks of the file."""
    monkeypatch.setattr(tiling, "_TILE", 32)


def warped(path: Path, target: Grid = GRID, d: tuple[float, float] = (0, 0), **more: Any) -> Path:
    """Warp the raster, which shows at x + d what belongs to x; return the result's path."""
    out = path.with_name("out.tif")
    source = open_raster(path)
    warp_raster(source, lambda xy: source.grid.map_to_pixel(xy + d), target, out, **more)
    return out


@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16", "int32", "float32", "float64",
                                   "complex64", "complex128"])  # fmt: skip
def test_the_identity_keeps_every_pixel(small_tiles: None, tmp_path: Path, dtype: str) -> None:
    image = (IMAGE % 250).astype(dtype)
    out = warped(write_raster(tmp_path / "a.tif", image, GRID))
    with rasterio.open(out) as dataset:
        np.testing.assert_allclose(dataset.read(1), image, rtol=1e-6, atol=1e-9)
        assert dataset.dtypes == (dtype,)
        assert (dataset.crs, dataset.transform) == (UTM, GRID.transform)
        assert dataset.read_masks(1).all()


@pytest.mark.parametrize("method", ["bilinear", "cubic", "lanczos"])
@pytest.mark.parametrize("workers", [1, 3])
def test_a_known_distortion_is_taken_out(
    small_tiles: None, tmp_path: Path, method: str, workers: int
) -> None:
    """The input is a smooth field seen through an affine distortion; the result is the field."""
    distortion = compose(Affine.translation(7, -3), Affine.rotation(2, (500_450, 4_999_650)))

    def to_input_px(xy: np.ndarray) -> np.ndarray:
        return GRID.map_to_pixel(apply_affine(distortion, xy))

    cols, rows = np.meshgrid(np.arange(90), np.arange(70))
    claimed = GRID.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    inverse = ~distortion
    x, y = claimed.T
    true_xy = np.column_stack(
        [inverse.a * x + inverse.b * y + inverse.c, inverse.d * x + inverse.e * y + inverse.f]
    )
    image = waves(true_xy, 600).reshape(70, 90).astype(np.float32)
    source = open_raster(write_raster(tmp_path / "a.tif", image, GRID))
    out = tmp_path / "out.tif"
    warp_raster(source, to_input_px, GRID, out, method, workers=workers)
    with rasterio.open(out) as dataset:
        values = dataset.read(1)
    error = np.abs(values - wave_image(GRID, 600))[10:-10, 10:-10]
    assert error.max() < 0.2
    assert np.isnan(values).any()  # the corners that turned out of sight


def test_bands_and_their_metadata_are_kept(small_tiles: None, tmp_path: Path) -> None:
    bands = np.stack([IMAGE, IMAGE // 2, IMAGE // 3])
    colors = [ColorInterp.blue, ColorInterp.green, ColorInterp.nir
              if hasattr(ColorInterp, "nir") else ColorInterp.undefined]  # fmt: skip
    path = write_raster(tmp_path / "a.tif", bands, GRID, nodata=0, colorinterp=colors)
    with rasterio.open(path, "r+") as dataset:
        dataset.descriptions = ("B02", "B03", "B08")
        dataset.scales, dataset.offsets = (1e-4, 1e-4, 2e-4), (0.0, -0.1, 0.0)
        dataset.units = ("reflectance", "reflectance", "reflectance")
        dataset.update_tags(SATELLITE="S2A", AREA_OR_POINT="Area")
        dataset.update_tags(ns="MINE", KEY="value")
        dataset.update_tags(2, WAVELENGTH="560", STATISTICS_MEAN="7")
    with rasterio.open(path) as dataset:
        expected = {name: getattr(dataset, name) for name in KEPT}
    with Outputs() as outputs:
        source = open_raster(path)
        staged = outputs.stage(tmp_path / "out.tif")
        warp_raster(source, GRID.map_to_pixel, GRID, staged)
    # Nothing that GeoTIFF cannot hold was put into a file beside it.
    assert sorted(os.listdir(tmp_path)) == ["a.tif", "out.tif"]
    with rasterio.open(tmp_path / "out.tif") as dataset:
        assert {name: getattr(dataset, name) for name in KEPT} == expected
        assert dataset.tags()["SATELLITE"] == "S2A"
        assert dataset.tags(ns="MINE") == {"KEY": "value"}
        assert dataset.tags(2)["WAVELENGTH"] == "560"
        # The pixels have changed.
        assert "STATISTICS_MEAN" not in dataset.tags(2)
        np.testing.assert_array_equal(dataset.read(), bands)


KEPT = (
    "count",
    "dtypes",
    "nodatavals",
    "colorinterp",
    "descriptions",
    "scales",
    "offsets",
    "units",
)


def test_rpcs_are_no_longer_true(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID)
    with rasterio.open(path, "r+") as dataset:
        dataset.update_tags(ns="RPC", LINE_OFF="1", SAMP_OFF="2")
    with rasterio.open(warped(path)) as dataset:
        assert "RPC" not in dataset.tag_namespaces()


def test_a_palette_is_kept_and_never_interpolated(small_tiles: None, tmp_path: Path) -> None:
    image = (IMAGE % 3).astype(np.uint8)
    path = write_raster(tmp_path / "a.tif", image, GRID, photometric="PALETTE")
    colors = {0: (0, 0, 0, 255), 1: (200, 10, 10, 255), 2: (10, 90, 10, 255)}
    with rasterio.open(path, "r+") as dataset:
        dataset.write_colormap(1, colors)
    with rasterio.open(warped(path, d=(3.0, 3.0))) as dataset:
        assert dataset.colorinterp == (ColorInterp.palette,)
        found = dataset.colormap(1)
        assert {key: found[key] for key in colors} == colors
        np.testing.assert_array_equal(dataset.read(1), image)


def test_nodata_is_kept_and_no_pixel_becomes_it(small_tiles: None, tmp_path: Path) -> None:
    """Between 1 and 1000, cubic interpolation would fall to 0, which says nodata."""
    image = np.where(np.indices((70, 90)).sum(axis=0) % 7 < 3, 1, 1000).astype(np.uint16)
    image[20:30, 20:30] = 0
    path = write_raster(tmp_path / "a.tif", image, GRID, nodata=0)
    with rasterio.open(warped(path, d=(4.0, -4.0))) as dataset:
        assert dataset.nodata == 0
        values = dataset.read(1)
    # At 0.4 px from a pixel that is still the nearest one.
    np.testing.assert_array_equal(values > 0, image > 0)
    assert values[values > 0].min() == 1


@pytest.mark.parametrize("dtype", ["float32", "float64", "complex64"])
@pytest.mark.parametrize("nodata", [0.0, 7.0, -9999.0])
def test_gdal_reads_no_valid_number_as_nodata(tmp_path: Path, nodata: float, dtype: str) -> None:
    """It compares with a tolerance, of complex numbers the real parts."""
    near = nodata * (1 + np.array([0, 1e-8, -1e-7, 3e-7, -4e-7, 1e-6]))
    image = (near[None] + (2j if dtype == "complex64" else 0)).astype(dtype)
    path = write_raster(tmp_path / "a.tif", image, utm_grid(6, 1), nodata=nodata)
    with rasterio.open(path) as dataset:
        assert not dataset.read_masks(1)[0, :4].any()
    kept = image.copy()
    keep_apart(kept, image.dtype.type(nodata))
    np.testing.assert_allclose(kept, image, rtol=1e-6, atol=1e-37)
    path = write_raster(tmp_path / "b.tif", kept, utm_grid(6, 1), nodata=nodata)
    with rasterio.open(path) as dataset:
        assert dataset.read_masks(1).all()


def test_without_nodata_integers_get_a_mask_where_pixels_are_missing(
    small_tiles: None, tmp_path: Path
) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID)
    with rasterio.open(warped(path, GRID.window(-10, 5, 100, 70))) as dataset:
        assert dataset.nodata is None
        mask = dataset.read_masks(1) > 0
        assert dataset.read(1)[mask].size == 90 * 65
        assert not mask[:, :10].any()
        assert mask[:65, 10:].all()
    assert sorted(os.listdir(tmp_path)) == ["a.tif", "out.tif"]
    with rasterio.open(warped(path)) as dataset:
        assert [flag.name for flag in dataset.mask_flag_enums[0]] == ["all_valid"]


def test_without_nodata_numbers_get_nan(tmp_path: Path) -> None:
    image = IMAGE.astype(np.float32)
    image[0, 0] = np.inf
    path = write_raster(tmp_path / "a.tif", image, GRID)
    with rasterio.open(warped(path, GRID.window(-10, 0, 100, 70))) as dataset:
        assert np.isnan(dataset.nodata)
        values = dataset.read(1)
    assert np.isnan(values[:, :10]).all()
    assert np.isnan(values[0, 10])
    assert np.isnan(values).sum() == 701


def test_a_mask_stays_a_mask(small_tiles: None, tmp_path: Path) -> None:
    mask = np.where(RNG.random(IMAGE.shape) > 0.2, 255, 0).astype(np.uint8)
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID, mask=mask)
    with rasterio.open(warped(path)) as dataset:
        np.testing.assert_array_equal(dataset.read_masks(1), mask)
        np.testing.assert_array_equal(dataset.read(1)[mask > 0], IMAGE[mask > 0])


def test_alpha_stays_alpha(small_tiles: None, tmp_path: Path) -> None:
    alpha = np.where(IMAGE % 5 > 0, 255, 0).astype(np.uint8)
    colors = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]
    bands = np.stack([(IMAGE % 200).astype(np.uint8)] * 3 + [alpha])
    path = write_raster(tmp_path / "a.tif", bands, GRID, colorinterp=colors, photometric="RGB")
    with rasterio.open(warped(path, GRID.window(-10, 0, 100, 70), (2.0, 1.0))) as dataset:
        assert dataset.colorinterp == tuple(colors)
        values = dataset.read()
    assert not values[:, :, :10].any()
    # Nearest pixels are the same: 0.2 px is less than a half. Transparent ones do not thin out
    # their neighbours.
    np.testing.assert_array_equal(values[3, :, 10:], alpha)
    assert not values[:3, :, 10:][:, alpha == 0].any()


def test_nan_below_an_opaque_alpha_band_stays_no_data(tmp_path: Path) -> None:
    values = np.full((2, 70, 90), 255, np.float32)
    values[0] = IMAGE
    values[0, 20:40, 30:60] = np.nan
    values[1, 50:] = 0
    path = write_raster(tmp_path / "a.tif", values, GRID, colorinterp=OF_ALPHA)
    source, out = open_raster(path), open_raster(warped(path, d=(2.0, 1.0)))
    # Nearest pixels are the same: 0.2 px is less than a half.
    found, expected = (one.read(one.window, 1)[1] for one in (out, source))
    np.testing.assert_array_equal(found, expected)
    assert expected.sum() == 50 * 90 - 20 * 30


def test_larger_pixels_are_means(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE[:, :80], utm_grid(80, 70), nodata=0)
    with rasterio.open(warped(path, utm_grid(8, 7, 100))) as dataset:
        values = dataset.read(1)
    means = IMAGE[:, :80].reshape(7, 10, 8, 10).mean(axis=(1, 3))
    np.testing.assert_allclose(values, means, atol=0.51)


def test_tiles_leave_no_seams(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The result is the same, whatever the tiles are, also when pixels are averaged before."""
    image = RNG.integers(0, 255, (200, 230)).astype(np.uint8)
    path = write_raster(tmp_path / "a.tif", image, utm_grid(230, 200))
    results = []
    for tile in (1024, 16):
        monkeypatch.setattr(tiling, "_TILE", tile)
        with rasterio.open(warped(path, utm_grid(90, 70, 23.0), (4.4, 3.3))) as dataset:
            results.append((dataset.read(), dataset.read_masks()))
    np.testing.assert_array_equal(results[0][0], results[1][0])
    np.testing.assert_array_equal(results[0][1], results[1][1])


def test_many_bands_are_worked_in_groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tiling, "_TILE_BYTES", 2 * tiling.BLOCK**2 * 2)
    bands = np.stack([IMAGE + i for i in range(7)])
    path = write_raster(tmp_path / "a.tif", bands, GRID, interleave="pixel")
    with rasterio.open(warped(path, GRID.window(-5, 0, 95, 70))) as dataset:
        np.testing.assert_array_equal(dataset.read()[:, :, 5:], bands)
        assert dataset.interleaving.value == "BAND"
        assert (dataset.read_masks(7)[:, :5] == 0).all()


def test_the_file_is_tiled_compressed_and_has_overviews(tmp_path: Path) -> None:
    grid = utm_grid(1300, 700)
    image = np.repeat(np.arange(700, dtype=np.float32)[:, None], 1300, axis=1)
    path = write_raster(tmp_path / "a.tif", image, grid)
    with rasterio.open(warped(path, grid)) as dataset:
        assert dataset.profile["tiled"]
        assert dataset.compression.value == "DEFLATE"
        assert dataset.overviews(1) == [2, 4]
    with rasterio.open(tmp_path / "out.tif", overview_level=0) as overview:
        np.testing.assert_allclose(overview.read(1)[:, 0], np.arange(350) * 2 + 0.5)
    assert sorted(os.listdir(tmp_path)) == ["a.tif", "out.tif"]


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_pixel_coordinates_stay_without_georeferencing(tmp_path: Path) -> None:
    plain = Grid(PIXEL_COORDINATES, None, 90, 70)
    path = write_raster(tmp_path / "a.tif", IMAGE)
    assert open_raster(warped(path, plain)).grid == plain
    cut = plain.window(3, 4, 50, 50)
    assert open_raster(warped(path, cut)).grid == cut


def test_complex_integers_stay_what_they_are(tmp_path: Path) -> None:
    image = (IMAGE + 2j * IMAGE).astype(np.complex64)
    path = write_raster(tmp_path / "a.tif", image, GRID, dtype="complex_int16")
    with rasterio.open(warped(path)) as dataset:
        assert dataset.dtypes == ("complex_int16",)
        np.testing.assert_array_equal(dataset.read(1), image)


def test_cancelling_in_the_middle_leaves_nothing(small_tiles: None, tmp_path: Path) -> None:
    seen: list[float] = []
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID)
    threads = threading.active_count()

    def work() -> None:
        progress = Progress(lambda done, _: seen.append(done), lambda: len(seen) == 3)
        with Outputs() as outputs:
            staged = outputs.stage(tmp_path / "out.tif")
            source = open_raster(path)
            warp_raster(source, GRID.map_to_pixel, GRID, staged, progress=progress)

    with pytest.raises(CancelledError):
        work()
    assert os.listdir(tmp_path) == ["a.tif"]
    assert threading.active_count() == threads


def test_progress_runs_to_the_end(small_tiles: None, tmp_path: Path) -> None:
    seen: list[float] = []
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID)
    warped(path, progress=Progress(lambda done, _: seen.append(done)))
    assert seen == sorted(seen)
    assert len(seen) == len(list(tiles(GRID))) + 1
    assert seen[-1] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path: Path, share: float) -> None:
    grid = utm_grid(1100, 1100)
    image = RNG.integers(0, 60000, (1100, 1100)).astype(np.uint16)
    path = write_raster(tmp_path / "a.tif", image, grid)
    size = warped(path, grid).stat().st_size
    (tmp_path / "out.tif").unlink()

    def work() -> None:
        with Outputs() as outputs, full_disk(int(share * size)):
            source = open_raster(path)
            warp_raster(source, grid.map_to_pixel, grid, outputs.stage(tmp_path / "out.tif"))

    with pytest.raises(OutputError, match=r"/out\.tif"):
        work()
    assert os.listdir(tmp_path) == ["a.tif"]


def test_a_truncated_input_is_the_inputs_fault(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "cut.tif", IMAGE, GRID)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(RasterOpenError, match=r"cut\.tif"):
        warped(path)


def test_a_missing_folder(tmp_path: Path) -> None:
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, GRID))
    with pytest.raises(OutputError, match="missing"):
        warp_raster(source, GRID.map_to_pixel, GRID, tmp_path / "missing" / "out.tif")


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_cannot_be_written_to(tmp_path: Path) -> None:
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, GRID))
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    with pytest.raises(OutputError, match="locked"):
        warp_raster(source, GRID.map_to_pixel, GRID, folder / "out.tif")


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int32", "float32", "complex64"])
def test_a_new_geotransform_leaves_the_pixels_untouched(
    small_tiles: None, tmp_path: Path, dtype: str
) -> None:
    bands = np.stack([IMAGE % 250, IMAGE % 99]).astype(dtype)
    if dtype == "float32":
        bands[0, 0, :3] = [np.nan, np.inf, -0.0]
    mask = np.where(IMAGE % 5 > 0, 255, 0).astype(np.uint8)
    path = write_raster(tmp_path / "a.tif", bands, GRID, nodata=7, mask=mask)
    moved = GRID.shifted(1.25, -3.5)
    write_with_geotransform(open_raster(path), moved, tmp_path / "out.tif")
    with rasterio.open(path) as old, rasterio.open(tmp_path / "out.tif") as new:
        assert old.read().tobytes() == new.read().tobytes()
        np.testing.assert_array_equal(old.dataset_mask(), new.dataset_mask())
        assert (new.transform, new.crs, new.nodata) == (moved.transform, UTM, 7)
    with pytest.raises(ValueError, match="size"):
        write_with_geotransform(open_raster(path), GRID.scaled(2), tmp_path / "out.tif")


def test_bands_of_several_types_may_stay_untouched(tmp_path: Path) -> None:
    texts = []
    for dtype in ("uint8", "float32"):
        path = write_raster(tmp_path / f"{dtype}.tif", (IMAGE % 200).astype(dtype), GRID)
        rasterio.shutil.copy(path, tmp_path / f"{dtype}.vrt", driver="VRT")
        texts.append((tmp_path / f"{dtype}.vrt").read_text())
    stack, band = tmp_path / "both.vrt", texts[1].partition("<VRTRasterBand")[2]
    second = f"<VRTRasterBand{band}".replace('band="1"', 'band="2"', 1)
    stack.write_text(texts[0].replace("</VRTDataset>", second))
    moved = GRID.shifted(1.25, -3.5)
    write_with_geotransform(open_raster(stack), moved, tmp_path / "out.tif")
    with rasterio.open(tmp_path / "out.tif") as new:
        np.testing.assert_array_equal(new.read(), np.stack([IMAGE % 200] * 2))


def test_tiles_cover_every_pixel_once() -> None:
    grid = utm_grid(2100, 1030)
    seen = np.zeros((1030, 2100), np.uint8)
    for tile in tiles(grid):
        seen[tile.row : tile.row + tile.height, tile.col : tile.col + tile.width] += 1
    assert (seen == 1).all()
