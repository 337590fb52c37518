"""The dates of a series as they are opened, and what stands for them from one run to the next."""

from __future__ import annotations

import os
import zipfile
from contextlib import ExitStack
from pathlib import Path

import fiona
import numpy as np
import pytest
import rasterio
import rasterio.shutil
from affine import Affine
from numpy.typing import NDArray
from raster_files import utm_grid, write_raster
from rasterio.crs import CRS
from rasterio.io import MemoryFile
from series_dates import FRAME
from shapely.geometry import box, mapping
from textured_pairs import texture

from groundtie.context import Context
from groundtie.rasters.grid import Grid
from groundtie.registration.user_masks import UserMask
from groundtie.series import dates
from groundtie.series.dates import open_dates
from groundtie.series.delivery import SeriesFiles
from groundtie.series.inputs import Listed
from groundtie.series.pairs import Settings, pair_key
from groundtie.series.series import Series, SeriesDate
from groundtie.series.settling import DateVerdict, Settled, settle

SIZE = 40
GRID = utm_grid(SIZE, SIZE)
SETTINGS = Settings("auto", 3.0, None, None)
PROFILE = {"driver": "GTiff", "count": 1, "height": SIZE, "width": SIZE, "dtype": "float32"}


def keys(folder: Path, context: Context, ending: str = ".tif") -> tuple[str, str, str]:
    """Return the keys of the second date, of its registration and of its registered raster."""
    listed = [Listed(name, folder / f"{name}{ending}", None) for name in "ab"]
    with ExitStack() as stack:
        (first, second), failures = open_dates(listed, None, stack, context)
        assert not failures
        settled: Settled = settle(FRAME, {}, 2, 0, is_free=True)
        series = Series((), FRAME, GRID, "", (), settled, ("a", "b"), None, 0, 0, {})
        files = SeriesFiles(folder / "out", "reference", "cubic", None)
        one = SeriesDate(second.listed, DateVerdict(True, ""), second)
        pair = pair_key(first, second, SETTINGS, FRAME)
        return second.key, pair, files.raster_key(one, series)


def test_a_date_is_the_same_from_another_folder(
    tmp_path: Path, one_thread: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in "ab":
        write_raster(tmp_path / f"{name}.tif", texture(SIZE, SIZE).astype(np.float32))
    before = keys(tmp_path, one_thread)[0]
    monkeypatch.chdir(tmp_path)
    assert keys(Path("."), one_thread)[0] == before
    monkeypatch.chdir("/")
    assert keys(tmp_path.relative_to("/") / "." / ".." / tmp_path.name, one_thread)[0] == before


@pytest.mark.parametrize("changed", ["geotransform", "crs"])
def test_georeferencing_that_a_sidecar_changes_is_another_date(
    tmp_path: Path, one_thread: Context, changed: str
) -> None:
    """The file stays as it is: its name, its size and its time are those of before."""
    for name in "ab":
        write_raster(tmp_path / f"{name}.tif", texture(SIZE, SIZE).astype(np.float32))
        sidecar(tmp_path / f"{name}.tif", "EPSG:32632", 500_000)
    before = keys(tmp_path, one_thread)
    assert keys(tmp_path, one_thread) == before
    crs, left = ("EPSG:32632", 500_030) if changed == "geotransform" else ("EPSG:32633", 500_000)
    sidecar(tmp_path / "b.tif", crs, left)
    after = keys(tmp_path, one_thread)
    assert all(one != other for one, other in zip(before, after, strict=True))


BAND = "<PAMDataset><PAMRasterBand band='1'>{}</PAMRasterBand></PAMDataset>"


@pytest.mark.parametrize(
    "stated",
    [
        BAND.format("<NoDataValue>7</NoDataValue>"),
        BAND.format("<Scale>0.5</Scale>"),
        BAND.format("<Offset>3</Offset>"),
        BAND.format("<UnitType>dB</UnitType>"),
        BAND.format("<Description>red</Description>"),
        BAND.format("<Metadata><MDI key='A'>b</MDI></Metadata>"),
        "<PAMDataset><Metadata><MDI key='A'>b</MDI></Metadata></PAMDataset>",
    ],
)
def test_what_a_sidecar_states_of_the_pixels_makes_another_date(
    tmp_path: Path, one_thread: Context, stated: str
) -> None:
    for name in "ab":
        write_raster(tmp_path / f"{name}.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
    before = keys(tmp_path, one_thread)
    (tmp_path / "b.tif.aux.xml").write_text(stated)
    after = keys(tmp_path, one_thread)
    assert all(one != other for one, other in zip(before, after, strict=True))


def test_statistics_that_gdal_keeps_make_no_other_date(tmp_path: Path, one_thread: Context) -> None:
    for name in "ab":
        write_raster(tmp_path / f"{name}.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
    before = keys(tmp_path, one_thread)
    # As GDAL does, which each version of rasterio asks in another way.
    statistics = '<MDI key="STATISTICS_MEAN">7</MDI>'
    band = f'<PAMRasterBand band="1"><Metadata>{statistics}</Metadata></PAMRasterBand>'
    (tmp_path / "b.tif.aux.xml").write_text(f"<PAMDataset>{band}</PAMDataset>")
    with rasterio.open(tmp_path / "b.tif") as dataset:
        assert "STATISTICS_MEAN" in dataset.tags(1)
    assert keys(tmp_path, one_thread) == before


@pytest.mark.parametrize("is_nested", [False, True])
def test_a_virtual_raster_of_another_source_is_another_date(
    tmp_path: Path, one_thread: Context, is_nested: bool
) -> None:
    """The file itself stays as it is; statistics that a viewer leaves change nothing."""
    write_raster(tmp_path / "source.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
    for name in "ab":
        path = tmp_path / f"{name}.vrt"
        rasterio.shutil.copy(tmp_path / "source.tif", path, driver="VRT")
        if is_nested:
            inner = path.rename(tmp_path / f"inner_{name}.vrt")
            path.write_text(inner.read_text().replace("source.tif", inner.name))
    before = keys(tmp_path, one_thread, ".vrt")
    (tmp_path / "b.vrt.aux.xml").write_text("<PAMDataset/>")
    assert keys(tmp_path, one_thread, ".vrt") == before
    write_raster(tmp_path / "source.tif", texture(SIZE, SIZE)[::-1].astype(np.float32), GRID)
    after = keys(tmp_path, one_thread, ".vrt")
    assert all(one != other for one, other in zip(before, after, strict=True))


def archive(path: Path, values: NDArray[np.float32]) -> str:
    """Write an archive of one raster, and return GDAL's name of that."""
    raster = write_raster(path.with_suffix(".tif"), values, GRID)
    with zipfile.ZipFile(path, "w") as file:
        file.write(raster, raster.name)
    raster.unlink()
    return f"/vsizip/{path}/{raster.name}"


@pytest.mark.parametrize("is_virtual", [False, True])
def test_another_archive_of_the_same_name_is_another_date(
    tmp_path: Path, one_thread: Context, is_virtual: bool
) -> None:
    ground = texture(SIZE, SIZE).astype(np.float32)
    name = archive(tmp_path / "a.zip", ground)
    virtual = tmp_path / "a.vrt"
    rasterio.shutil.copy(name, virtual, driver="VRT")

    def key() -> str:
        with ExitStack() as stack:
            listed = Listed("a", virtual if is_virtual else name, None)
            (date,), failures = open_dates([listed], None, stack, one_thread)
            assert not failures
            return date.key

    before = key()
    assert key() == before
    archive(tmp_path / "a.zip", ground[::-1])
    assert key() != before


def test_another_archive_of_a_mask_makes_another_date(tmp_path: Path, one_thread: Context) -> None:
    path = write_raster(tmp_path / "a.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
    mask = np.ones((SIZE, SIZE), np.float32)
    name = archive(tmp_path / "mask.zip", mask)

    def key() -> str:
        with ExitStack() as stack:
            listed = Listed("a", path, None, UserMask(name))
            (date,), failures = open_dates([listed], None, stack, one_thread)
            assert not failures
            return date.key

    before = key()
    assert key() == before
    mask[:5] = 0
    archive(tmp_path / "mask.zip", mask)
    assert key() != before


def test_a_date_of_which_no_file_is_known_is_never_known_as_unchanged(one_thread: Context) -> None:
    with MemoryFile() as file:
        with file.open(**PROFILE) as dataset:
            dataset.write(texture(SIZE, SIZE)[None].astype(np.float32))
        found = []
        for _ in range(2):
            with ExitStack() as stack:
                listed = Listed("a", file.name, None)
                (date,), _ = open_dates([listed], None, stack, one_thread)
                found.append((date.key, date.key))
    assert found[0][0] == found[0][1] != found[1][0]


@pytest.mark.parametrize("most_bytes", [0, 10**9])
def test_a_truncated_date_is_left_out_alone_whether_held_or_not(
    tmp_path: Path, one_thread: Context, monkeypatch: pytest.MonkeyPatch, most_bytes: int
) -> None:
    monkeypatch.setattr(dates, "share_bytes", lambda share: most_bytes)
    paths = [
        write_raster(tmp_path / f"{name}.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
        for name in "abc"
    ]
    paths[1].write_bytes(paths[1].read_bytes()[: -2 * SIZE * SIZE])
    listed = [Listed(path.stem, path, None) for path in paths]
    with ExitStack() as stack:
        found, failures = open_dates(listed, None, stack, one_thread)
        assert [date.name for date in found] == ["a", "c"]
        assert [date.footprint(GRID).area for date in found] == [(10.0 * SIZE) ** 2] * 2
    assert failures.keys() == {"b"} and "b.tif" in failures["b"]


def test_a_mask_that_a_sidecar_moves_makes_another_date(
    tmp_path: Path, one_thread: Context
) -> None:
    """Statistics that a viewer leaves beside it change nothing."""
    path = write_raster(tmp_path / "a.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
    mask = write_raster(tmp_path / "mask.tif", np.ones((SIZE, SIZE), np.uint8))

    def key() -> str:
        with ExitStack() as stack:
            listed = Listed("a", path, None, UserMask(mask))
            (date,), failures = open_dates([listed], None, stack, one_thread)
            assert not failures
            return date.key

    sidecar(mask, "EPSG:32632", 500_000)
    before = key()
    aux = mask.with_name("mask.tif.aux.xml")
    aux.write_text(aux.read_text().replace("</PAM", "<Metadata/></PAM"))
    assert key() == before
    sidecar(mask, "EPSG:32632", 500_030)
    assert key() != before


@pytest.mark.parametrize("ending", [".shp", ".shx", ".prj"])
def test_a_shapefile_of_a_mask_has_several_files(
    tmp_path: Path, one_thread: Context, ending: str
) -> None:
    path = write_raster(tmp_path / "a.tif", texture(SIZE, SIZE).astype(np.float32), GRID)
    layer = tmp_path / "mask.shp"
    shape = mapping(box(500_000, 4_999_900, 500_100, 5_000_000))
    schema = {"geometry": "Polygon", "properties": {}}
    with fiona.open(layer, "w", "ESRI Shapefile", schema, crs="EPSG:32632") as file:
        file.write({"geometry": shape, "properties": {}})

    def key() -> str:
        with ExitStack() as stack:
            listed = Listed("a", path, None, UserMask(layer, "inside"))
            (date,), failures = open_dates([listed], None, stack, one_thread)
            assert not failures
            return date.key

    before = key()
    os.utime(layer.with_suffix(ending), (1e9, 1e9))
    assert key() != before


def sidecar(path: Path, crs: str, left: int) -> None:
    """Write georeferencing into the file of GDAL beside a raster."""
    place = f"<SRS>{crs}</SRS><GeoTransform>{left},10,0,5000000,0,-10</GeoTransform>"
    path.with_name(f"{path.name}.aux.xml").write_text(f"<PAMDataset>{place}</PAMDataset>")


def test_footprints_count_longitudes_alike(tmp_path: Path, one_thread: Context) -> None:
    listed = []
    for name, west in (("a", 179.8), ("b", -180.2), ("c", 539.8)):
        grid = Grid(Affine(1e-3, 0, west, 0, -1e-3, 45.0), CRS.from_epsg(4326), SIZE, SIZE)
        path = write_raster(tmp_path / f"{name}.tif", texture(SIZE, SIZE).astype("f4"), grid)
        listed.append(Listed(name, path, None))
    with ExitStack() as stack:
        found, _ = open_dates(listed, None, stack, one_thread)
        footprints = [date.footprint(found[0].source.grid) for date in found]
    shares = dates.footprint_shares(footprints)
    assert list(shares.values()) == pytest.approx([1.0] * 3, abs=1e-6)


def test_the_footprint_of_a_narrow_strip_is_as_wide_as_the_strip(
    tmp_path: Path, one_thread: Context
) -> None:
    grid = utm_grid(10_000, 77)
    path = write_raster(tmp_path / "a.tif", np.ones((77, 10_000), np.uint8), grid)
    with ExitStack() as stack:
        ((date,), _) = open_dates([Listed("a", path, None)], None, stack, one_thread)
        assert date.footprint(grid).area == pytest.approx(77 * 10_000 * 100)
