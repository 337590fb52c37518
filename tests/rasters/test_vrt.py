"""Virtual rasters: another geotransform for a file's own pixels."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import rasterio
from loopback_server import serving
from raster_files import UTM, utm_grid, write_raster
from textured_pairs import shift_on_map

import groundtie
from groundtie.arrays import Raster
from groundtie.errors import ParameterError
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.reading import open_raster

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
