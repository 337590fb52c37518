"""Virtual rasters: another geotransform for a file's own pixels."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from loopback_server import serving
from raster_files import UTM, utm_grid, write_raster
from rasterio.vrt import WarpedVRT
from textured_pairs import shift_on_map

import groundtie
from groundtie.arrays import Raster
from groundtie.errors import ParameterError
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.reading import open_raster
from groundtie.rasters.vrt import write_vrt

GRID = utm_grid(70, 50)
VALUES = np.random.default_rng(2).integers(0, 200, (2, 50, 70)).astype(np.uint8)
# The input shows 33 m too far east, 21 m too far north: nominal = true + shift.
SHIFT = shift_on_map(33.0, 21.0)


@pytest.fixture
def image(tmp_path: Path) -> Path:
    mask = np.where(VALUES[0] > 20, 255, 0).astype(np.uint8)
    return write_raster(tmp_path / "in" / "a.tif", VALUES, GRID, mask=mask)


@pytest.fixture(autouse=True)
def folders(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()


def stored(path: Path, model: PolynomialModel) -> Path:
    path.write_text(json.dumps(Transform(model, UTM, GRID).to_json()))
    return path


def test_pixels_and_mask_are_the_files_own_in_another_place(tmp_path: Path, image: Path) -> None:
    output = tmp_path / "out" / "b.vrt"
    before = image.read_bytes()
    groundtie.warp(image, output, transform=stored(tmp_path / "t.json", SHIFT))
    with rasterio.open(output) as moved, rasterio.open(image) as original:
        np.testing.assert_array_equal(moved.read(), original.read())
        np.testing.assert_array_equal(moved.dataset_mask(), original.dataset_mask())
        assert moved.crs == original.crs
        assert np.subtract(moved.transform[:6], original.transform[:6]).tolist() == pytest.approx(
            [0, 0, -33, 0, 0, -21]
        )
        assert len(moved.tags()["GROUNDTIE_RUN"]) == 16
    assert image.read_bytes() == before
    assert sorted(path.name for path in output.parent.iterdir()) == ["b.vrt"]
    # Both may be moved together: the one names the other relative to itself.
    tmp_path.rename(tmp_path.with_name(f"{tmp_path.name}-moved"))
    try:
        with rasterio.open(tmp_path.with_name(f"{tmp_path.name}-moved") / "out/b.vrt") as moved:
            np.testing.assert_array_equal(moved.read(), VALUES)
    finally:
        tmp_path.with_name(f"{tmp_path.name}-moved").rename(tmp_path)


def masked(folder: Path, image: Path) -> Path:
    virtual = folder / "v.vrt"
    rasterio.shutil.copy(image, virtual, driver="VRT")
    return virtual


def with_a_mask_beside(folder: Path, image: Path) -> Path:
    virtual = masked(folder, image)
    text = virtual.read_text()
    virtual.write_text(text[: text.index("<MaskBand>")] + "</VRTDataset>")
    beside = np.indices(VALUES.shape[1:]).sum(axis=0) % 3 * 127
    path = write_raster(folder / "m.tif", beside.astype(np.uint8))
    with rasterio.open(path, "r+") as dataset:
        dataset.update_tags(INTERNAL_MASK_FLAGS_1="2", INTERNAL_MASK_FLAGS_2="2")
    path.rename(folder / "v.vrt.msk")
    return virtual


def with_masks_of_its_bands(folder: Path, image: Path) -> Path:
    virtual = masked(folder, image)
    text = virtual.read_text()
    for band in (2, 1):
        source = f"<SourceFilename relativeToVRT='1'>{image.name}</SourceFilename>"
        pixels = f"<SimpleSource>{source}<SourceBand>{band}</SourceBand></SimpleSource>"
        mask = f"<MaskBand><VRTRasterBand dataType='Byte'>{pixels}</VRTRasterBand></MaskBand>"
        # A valid pixel is one that is not 0 in the other band.
        place = text.index(f'band="{3 - band}"')
        end = text.index("</VRTRasterBand>", place)
        text = text[:end] + mask + text[end:]
    start, end = text.rindex("<MaskBand>"), text.rindex("</VRTDataset>")
    virtual.write_text(text[:start] + text[end:])
    return virtual


def raw(folder: Path, _: Path) -> Path:
    (folder / "raw.bin").write_bytes(VALUES[0].tobytes())
    virtual = folder / "v.vrt"
    virtual.write_text(
        f"""<VRTDataset rasterXSize="70" rasterYSize="50"><SRS>{UTM.to_wkt()}</SRS>
        <GeoTransform>{", ".join(map(str, GRID.transform.to_gdal()))}</GeoTransform>
        <VRTRasterBand dataType="Byte" band="1" subClass="VRTRawRasterBand">
        <SourceFilename relativetoVRT="1">raw.bin</SourceFilename><PixelOffset>1</PixelOffset>
        <LineOffset>70</LineOffset></VRTRasterBand></VRTDataset>"""
    )
    return virtual


def warped(folder: Path, image: Path) -> Path:
    virtual = folder / "v.vrt"
    with rasterio.open(image) as dataset, WarpedVRT(dataset, add_alpha=True) as moved:
        rasterio.shutil.copy(moved, virtual, driver="VRT")
    return virtual


def pansharpened(folder: Path, image: Path) -> Path:
    virtual = folder / "v.vrt"
    named = f"<SourceFilename relativeToVRT='1'>{image.name}</SourceFilename><SourceBand>"
    bands = "".join(
        f"<VRTRasterBand dataType='Byte' band='{band}' subClass='VRTPansharpenedRasterBand'/>"
        for band in (1, 2)
    )
    spectral = "".join(
        f"<SpectralBand dstBand='{band}'>{named}{band}</SourceBand></SpectralBand>"
        for band in (1, 2)
    )
    virtual.write_text(
        f"<VRTDataset subClass='VRTPansharpenedDataset'>{bands}<PansharpeningOptions>"
        f"<PanchroBand>{named}1</SourceBand></PanchroBand>{spectral}"
        "</PansharpeningOptions></VRTDataset>"
    )
    return virtual


@pytest.mark.parametrize(
    "make",
    [masked, with_a_mask_beside, with_masks_of_its_bands, raw, warped, pansharpened],
)
def test_a_virtual_raster_is_shown_in_another_place_as_it_is(
    tmp_path: Path, image: Path, make: Callable[[Path, Path], Path]
) -> None:
    """Also with another file of the same name where a copy of it would look for one."""
    virtual, output = make(image.parent, image), tmp_path / "out" / "b.vrt"
    for name in ("a.tif", "raw.bin"):
        (tmp_path / "out" / name).write_bytes(bytes(5000))
    groundtie.warp(virtual, output, transform=stored(tmp_path / "t.json", SHIFT))
    moved = tmp_path.with_name(f"{tmp_path.name}-moved")
    tmp_path.rename(moved)
    try:
        with rasterio.open(moved / "out/b.vrt") as shown, rasterio.open(moved / "in/v.vrt") as own:
            np.testing.assert_array_equal(shown.read(), own.read())
            np.testing.assert_array_equal(shown.read_masks(), own.read_masks())
            assert own.read().any()
            assert shown.mask_flag_enums == own.mask_flag_enums
            assert (shown.crs, shown.colorinterp) == (own.crs, own.colorinterp)
            assert shown.transform.c == own.transform.c - 33
    finally:
        moved.rename(tmp_path)


def test_a_virtual_raster_of_a_virtual_one_reads_its_overviews(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "in" / "a.tif", VALUES, GRID, nodata=3)
    with rasterio.open(path, "r+") as dataset:
        dataset.build_overviews([2])
        dataset.descriptions = ("VV", "VH")
    first, second = tmp_path / "out" / "1.vrt", tmp_path / "out" / "2.vrt"
    transform = stored(tmp_path / "t.json", SHIFT)
    groundtie.warp(masked(path.parent, path), first, transform=transform)
    groundtie.warp(first, second, transform=transform)
    with rasterio.open(path) as original, rasterio.open(second) as moved:
        assert moved.nodatavals == (3, 3)
        assert moved.descriptions == ("VV", "VH")
        with rasterio.open(first) as between:
            assert moved.tags()["GROUNDTIE_RUN"] != between.tags()["GROUNDTIE_RUN"]
        reduced = [dataset.read(out_shape=(2, 25, 35)) for dataset in (original, moved)]
    np.testing.assert_array_equal(*reduced)


def test_links_to_folders_lead_nowhere_else(tmp_path: Path, image: Path) -> None:
    """A parent is that of the folder where a link leads."""
    (tmp_path / "far" / "out").mkdir(parents=True)
    write_raster(tmp_path / "far" / "a.tif", 200 - VALUES, GRID)
    (image.parent / "link").symlink_to(tmp_path / "far" / "out")
    (tmp_path / "out" / "link").symlink_to(image.parent)
    transform = stored(tmp_path / "t.json", SHIFT)
    groundtie.warp(image, image.parent / "link" / "b.vrt", transform=transform)
    groundtie.warp(tmp_path / "out/link/a.tif", tmp_path / "far/out/c.vrt", transform=transform)
    for name in ("in/link/b.vrt", "far/out/b.vrt", "in/link/c.vrt"):
        with rasterio.open(tmp_path / name) as moved:
            np.testing.assert_array_equal(moved.read(), VALUES)


def test_what_located_the_pixels_before_is_left_out(tmp_path: Path, image: Path) -> None:
    with rasterio.open(image, "r+") as dataset:
        dataset.update_tags(ns="RPC", LINE_OFF="1")
        dataset.update_tags(SENSOR="X")
    output = tmp_path / "out" / "b.vrt"
    groundtie.warp(image, output, transform=stored(tmp_path / "t.json", SHIFT))
    with rasterio.open(output) as moved:
        assert moved.tags()["SENSOR"] == "X"
        assert not moved.tags(ns="RPC")
        assert moved.gcps == ([], None)


def test_only_shifts_leave_pixels_untouched(tmp_path: Path, image: Path) -> None:
    frame = Frame.around(GRID.pixel_to_map(GRID.outline()))
    turned = PolynomialModel("affine", frame, np.array([[1.0, 0], [0, 0.01], [0.01, 0]]))
    output = tmp_path / "out" / "b.vrt"
    with pytest.raises(ParameterError, match="the correction is no shift"):
        groundtie.warp(image, output, transform=stored(tmp_path / "t.json", turned))
    with pytest.raises(ParameterError, match="untouched pixels go with model translation"):
        groundtie.coregister(image, image.with_name("c.tif"), output, model="affine")
    assert not list(output.parent.iterdir())


def test_a_file_in_an_archive_is_found_from_any_folder(
    tmp_path: Path, image: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with zipfile.ZipFile(tmp_path / "in" / "a.zip", "w") as archive:
        archive.write(image, "a.tif")
    output = tmp_path / "out" / "b.vrt"
    monkeypatch.chdir(tmp_path)
    transform = stored(tmp_path / "t.json", SHIFT)
    groundtie.warp("/vsizip/in/a.zip/a.tif", output, transform=transform)
    monkeypatch.chdir(tmp_path / "out")
    with rasterio.open(output) as moved:
        np.testing.assert_array_equal(moved.read(), VALUES)


def test_the_file_is_the_one_that_was_opened_whatever_the_working_folder(
    tmp_path: Path, image: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "other").mkdir()
    write_raster(tmp_path / "other" / "a.tif", VALUES + 50, GRID)
    monkeypatch.chdir(image.parent)
    with open_raster("a.tif") as source:
        monkeypatch.chdir(tmp_path / "other")
        write_vrt(source, GRID.shifted(1.0, 2.0), tmp_path / "out" / "b.vrt")
        source.close()
        np.testing.assert_array_equal(source.read_bands(source.window)[0], VALUES)
        assert source.is_same_as(open_raster(image))
    with rasterio.open(tmp_path / "out" / "b.vrt") as moved:
        np.testing.assert_array_equal(moved.read(), VALUES)


def test_other_names_that_are_relative_to_the_working_folder_are_refused(
    tmp_path: Path, image: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    transform = stored(tmp_path / "t.json", SHIFT)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ParameterError, match="give the whole path"):
        groundtie.warp("GTIFF_DIR:1:in/a.tif", "out/b.vrt", transform=transform)
    groundtie.warp(f"GTIFF_DIR:1:{image}", "out/b.vrt", transform=transform)
    monkeypatch.chdir(tmp_path / "out")
    with rasterio.open("b.vrt") as moved:
        np.testing.assert_array_equal(moved.read(), VALUES)


def test_an_array_is_no_file(tmp_path: Path) -> None:
    raster = Raster(VALUES, GRID.transform, GRID.crs)
    with pytest.raises(ParameterError, match="refers to a file"):
        groundtie.warp(raster, tmp_path / "out/b.vrt", transform=stored(tmp_path / "t.json", SHIFT))


@pytest.mark.slow
def test_a_remote_file_stays_where_it_is(tmp_path: Path, image: Path) -> None:
    output = tmp_path / "out" / "b.vrt"
    with serving(tmp_path) as server:
        groundtie.warp(server.of(image), output, transform=stored(tmp_path / "t.json", SHIFT))
        with open_raster(output) as moved:
            values, _ = moved.read(moved.window, 2)
    np.testing.assert_array_equal(values[VALUES[0] > 20], VALUES[1][VALUES[0] > 20])
    assert f"/vsicurl/{server.url}/in/a.tif" in output.read_text()
