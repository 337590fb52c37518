"""Rasters as they lie in files: the same bytes from any number of workers, and what GDAL reads."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.windows
from affine import Affine
from numpy.typing import NDArray
from raster_files import full_disk, utm_grid, write_raster
from rasterio.crs import CRS
from rasterio.enums import Resampling

from groundtie.errors import OutputError
from groundtie.rasters import tiff_file
from groundtie.rasters.atomic import Outputs
from groundtie.rasters.delivery import warp_raster
from groundtie.rasters.grid import Grid
from groundtie.rasters.reading import open_raster
from groundtie.rasters.windows import Window
from groundtie.rasters.writing import create_like

RNG = np.random.default_rng(5)
WIDTH, HEIGHT = 1101, 601
GRID = utm_grid(WIDTH, HEIGHT)
NOISE = RNG.integers(0, 60000, (HEIGHT, WIDTH)).astype(np.uint16)
MASK = np.where(RNG.random((HEIGHT, WIDTH)) > 0.3, 255, 0).astype(np.uint8)
TYPES = ["uint8", "int16", "uint16", "int32", "uint32", "float32", "float64", "complex_int16",
         "complex64"]  # fmt: skip


def copied(path: Path, workers: int = 2, cog: bool = False, **more: Any) -> Path:
    """Write a raster again, pixel by pixel."""
    out = path.with_name(f"out-{workers}{'.cog' if cog else ''}.tif")
    with open_raster(path) as source, Outputs() as outputs:
        to_px, staged = source.grid.map_to_pixel, outputs.stage(out)
        warp_raster(source, to_px, source.grid, staged, workers=workers, **more)
    return out


@pytest.fixture(scope="module")
def masked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("masked")
    return write_raster(folder / "a.tif", np.stack([NOISE, NOISE // 2]), GRID, mask=MASK)


@pytest.mark.slow
@pytest.mark.parametrize("cog", [False, True])
def test_bytes_are_the_same_for_any_number_of_workers(masked: Path, cog: bool) -> None:
    first, *others = [copied(masked, workers, cog).read_bytes() for workers in (1, 2, 3, 8)]
    assert all(other == first for other in others)


@pytest.mark.slow
@pytest.mark.parametrize("interleave", ["pixel", "band"])
@pytest.mark.parametrize("dtype", TYPES)
def test_pixels_of_all_types_are_what_gdal_reads(
    tmp_path: Path, dtype: str, interleave: str
) -> None:
    memory = "complex64" if dtype.startswith("complex") else dtype
    image = np.stack([NOISE[:520, :530] % 251, NOISE[:520, :530] % 127]).astype(memory)
    if memory == "complex64":
        image = image - 1j * image[::-1]
    path = tmp_path / "a.tif"
    write_raster(path, image, utm_grid(530, 520), dtype=dtype, interleave=interleave, nodata=None)
    with rasterio.open(copied(path)) as dataset:
        assert set(dataset.dtypes) == {dtype}
        assert dataset.interleaving.value == interleave.upper()
        np.testing.assert_array_equal(dataset.read(), image)


def test_a_mask_and_its_overviews(masked: Path) -> None:
    with rasterio.open(copied(masked)) as dataset:
        np.testing.assert_array_equal(dataset.read_masks(1), MASK)
        assert dataset.overviews(1) == [2, 4]
    for level in (0, 1):
        with rasterio.open(masked.with_name("out-2.tif"), overview_level=level) as overview:
            factor = 2 << level
            rows, cols = (-(-size // factor) for size in MASK.shape)
            assert overview.shape == (rows, cols)
            part = MASK[: factor * 40, : factor * 50].reshape(40, factor, 50, factor)
            expected = part.any(axis=(1, 3))
            found = overview.read_masks(1)[:40, :50] > 0
            # An odd size is shared by all pixels of the overview: borders may lie half a pixel off.
            assert np.mean(found == expected) > 0.9


@pytest.mark.parametrize("shape", [(512, 1536), (601, 1101)])
def test_overviews_are_those_of_gdal(tmp_path: Path, shape: tuple[int, int]) -> None:
    """Averages of what is valid; another program makes them in place."""
    image = RNG.normal(100, 30, shape).astype(np.float32)
    image[200:300] = -1
    path = write_raster(tmp_path / "a.tif", image, utm_grid(*shape[::-1]), nodata=-1)
    ours = copied(path)
    with rasterio.open(path, "r+") as dataset:
        dataset.build_overviews([2, 4], Resampling.average)
    for level in (0, 1):
        with (
            rasterio.open(ours, overview_level=level) as found,
            rasterio.open(path, overview_level=level) as expected,
        ):
            values, wanted = found.read(1), expected.read(1)
        np.testing.assert_array_equal(values == -1, wanted == -1)
        np.testing.assert_allclose(values, wanted, atol=30 if shape[0] % 2 else 1e-3)
        assert np.abs(values - wanted).mean() < (3 if shape[0] % 2 else 1e-4)


def test_a_palette_has_overviews_of_its_own_values(tmp_path: Path) -> None:
    image = np.where(NOISE % 2, 1, 200).astype(np.uint8)
    path = write_raster(tmp_path / "a.tif", image, GRID, photometric="PALETTE")
    with rasterio.open(path, "r+") as dataset:
        dataset.write_colormap(1, {1: (9, 9, 9, 255), 200: (7, 8, 9, 255)})
    with rasterio.open(copied(path), overview_level=1) as overview:
        assert set(np.unique(overview.read())) == {1, 200}


@pytest.mark.parametrize("ending", [".cog.tif", ".COG.TIFF"])
def test_a_name_as_long_as_the_system_allows_makes_a_cog(tmp_path: Path, ending: str) -> None:
    path = write_raster(tmp_path / "a.tif", NOISE, GRID)
    out = tmp_path / f"{'x' * (255 - len(ending))}{ending}"
    with open_raster(path) as source, Outputs() as outputs:
        warp_raster(source, GRID.map_to_pixel, GRID, outputs.stage(out))
    with rasterio.open(out) as dataset:
        assert dataset.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
    assert {path.name for path in tmp_path.iterdir()} == {"a.tif", out.name}


def test_what_geotiff_cannot_hold_lies_beside_it(tmp_path: Path) -> None:
    """A rotated pole; without it nobody knows where the pixels lie."""
    pole = CRS.from_user_input("+proj=ob_tran +o_proj=longlat +o_lat_p=40 +o_lon_p=0 +lon_0=180")
    grid = Grid(Affine(0.1, 0, 10, 0, -0.1, 20), pole, 60, 50)
    path = write_raster(tmp_path / "a.tif", NOISE[:50, :60], grid)
    with rasterio.open(path) as source, rasterio.open(copied(path)) as dataset:
        assert dataset.crs == source.crs == pole
    names = ["a.tif", "a.tif.aux.xml", "out-2.tif", "out-2.tif.aux.xml"]
    assert sorted(os.listdir(tmp_path)) == names


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("cog", [False, True])
@pytest.mark.slow
def test_large_files_are_big_tiffs(
    masked: Path, monkeypatch: pytest.MonkeyPatch, big: bool, cog: bool
) -> None:
    if big:
        monkeypatch.setattr(tiff_file, "_LARGEST_CLASSIC", 0)
    out = copied(masked, cog=cog)
    assert out.read_bytes()[:4] == (b"II\x2b\0" if big else b"II\x2a\0")
    with rasterio.open(out) as dataset, rasterio.open(masked) as source:
        np.testing.assert_array_equal(dataset.read()[:, MASK > 0], source.read()[:, MASK > 0])
        np.testing.assert_array_equal(dataset.read_masks(1), MASK)
        assert dataset.overviews(1) == [2, 4]
        assert (dataset.transform, dataset.crs) == (source.transform, source.crs)


def test_a_cog_has_its_blocks_from_the_smallest_overview_to_the_raster(masked: Path) -> None:
    out = copied(masked, cog=True)
    assert os.listdir(out.parent).count(out.name) == 1
    assert not [name for name in os.listdir(out.parent) if name.startswith(".")]
    with rasterio.open(out) as dataset:
        assert dataset.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        first = {
            level: int(dataset.get_tag_item("BLOCK_OFFSET_0_0", "TIFF", bidx=1, ovr=level))
            for level in (None, 0, 1)
        }
    assert first[1] < first[0] < first[None]
    with rasterio.open(out) as cog, rasterio.open(masked) as source:
        np.testing.assert_array_equal(cog.read()[:, MASK > 0], source.read()[:, MASK > 0])


def test_a_band_that_is_missing_is_a_bug_and_not_a_file(masked: Path, tmp_path: Path) -> None:
    with (
        open_raster(masked) as source,
        pytest.raises(ValueError, match="not all blocks"),
        create_like(source, GRID, tmp_path / "a.tif", nodata=None) as file,
    ):
        file.write(np.zeros((2, 512, 512), np.uint16), window=Window(0, 0, 512, 512))


# ---- full disks -----------------------------------------------------------------------------


@contextlib.contextmanager
def small_disk(folder: Path, size: int) -> Iterator[Path]:
    """Mount a disk of some bytes; skip where that is not allowed."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    try:
        mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        mounted = False
    if not mounted:
        pytest.skip("NOT TESTED on a full disk: mounting a small one is not allowed here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def smooth() -> NDArray[np.uint16]:
    return np.broadcast_to((np.arange(WIDTH) // 64).astype(np.uint16), (HEIGHT, WIDTH)).copy()


@pytest.mark.parametrize("share", [0.05, 0.74, 0.9])
@pytest.mark.slow
def test_a_full_disk_is_one_line_and_leaves_nothing(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], share: float
) -> None:
    """At 0.75 the raster itself is written, and its overviews are not."""
    path = write_raster(tmp_path / "a.tif", NOISE, GRID)
    size = copied(path).stat().st_size
    with small_disk(tmp_path / "disk", int(share * size)) as disk, open_raster(path) as source:

        def work() -> None:
            with Outputs() as outputs:
                staged = outputs.stage(disk / "out.tif")
                warp_raster(source, GRID.map_to_pixel, GRID, staged)

        with pytest.raises(OutputError) as raised:
            work()
        assert os.listdir(disk) == []
    found = re.fullmatch(
        rf"no space left on {disk}: (.+) MB needed, (.+) (.)B free \(writing out\.tif\)",
        str(raised.value),
    )
    assert found is not None, str(raised.value)
    assert float(found[1]) == pytest.approx(size / 1e6, rel=0.1)
    free = float(found[2]) * {"k": 1e3, "M": 1e6}[found[3]]
    # A disk has whole pages, the message three digits.
    assert free == pytest.approx(share * size, abs=4096 + 0.005 * share * size)
    assert capfd.readouterr() == ("", "")


def test_what_compresses_may_need_less_than_its_pixels(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", smooth(), GRID)
    with small_disk(tmp_path / "disk", smooth().nbytes // 20) as disk:
        with Outputs() as outputs, open_raster(path) as source:
            warp_raster(source, GRID.map_to_pixel, GRID, outputs.stage(disk / "out.tif"))
        assert os.listdir(disk) == ["out.tif"]


def test_what_cannot_fit_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    """However well it compresses: deflate makes at best 1 byte of 1032."""
    path = write_raster(tmp_path / "a.tif", NOISE[:50, :50], utm_grid(50, 50))
    grid = utm_grid(20_000_000, 20_000_000)
    with (
        open_raster(path) as source,
        pytest.raises(OutputError, match=r"no space left on .*: \d+ GB needed"),
    ):
        create_like(source, grid, tmp_path / "out.tif", nodata=None).__enter__()
    assert os.listdir(tmp_path) == ["a.tif"]


@pytest.mark.parametrize("share", [0.0, 0.7, 0.95])
@pytest.mark.parametrize("cog", [False, True])
@pytest.mark.slow
def test_a_file_that_may_not_grow_is_one_line_and_leaves_nothing(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], share: float, cog: bool
) -> None:
    """As on a full disk, and everywhere: a limit of the process."""
    path = write_raster(tmp_path / "a.tif", NOISE, GRID)
    out = copied(path, cog=cog)
    size = out.stat().st_size
    out.unlink()
    with full_disk(int(share * size)), pytest.raises(OutputError, match=rf"/{out.name}: .*large"):
        copied(path, cog=cog)
    assert os.listdir(tmp_path) == ["a.tif"]
    assert capfd.readouterr() == ("", "")
