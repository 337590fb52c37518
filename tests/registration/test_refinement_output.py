"""The output of a refinement: the RPCs in each of their formats."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from raster_files import write_raster
from rpc_models import camera_rpc, to_rasterio

from groundtie.errors import OutputError, SameFileError
from groundtie.progress import SILENT
from groundtie.rasters.reading import open_raster
from groundtie.registration.refinement_output import RefinementFiles, require_place, write_rpcs
from groundtie.registration.sensor_input import open_sensor_image
from groundtie.sensor.rpc_files import read_rpc, write_rpc

SIZE = (60, 50)


@pytest.mark.parametrize("name", ["refined_RPC.TXT", "refined.rpb", "copy.tif", "copy.TIFF"])
def test_the_refined_rpcs_are_written_in_the_format_of_the_name(tmp_path: Path, name: str) -> None:
    path = write_raster(tmp_path / "image.tif", np.arange(3000, dtype=np.uint16).reshape(50, 60))
    fit: Any = SimpleNamespace(rpc=camera_rpc(SIZE))
    with open_raster(path) as source:
        image: Any = SimpleNamespace(source=source)
        write_rpcs(image, fit, tmp_path / name, SILENT)
    lon_lat = fit.rpc.localise([[0.0, 0.0], [59.0, 49.0]], 0.0)
    if name.startswith("copy"):
        with ExitStack() as stack:
            _, found = open_sensor_image(tmp_path / name, None, stack)
    else:
        found = read_rpc(tmp_path / name)
    np.testing.assert_allclose(found.project(lon_lat, 0.0), [[0, 0], [59, 49]], atol=1e-3)


def test_only_what_is_asked_for_is_named(tmp_path: Path) -> None:
    files = RefinementFiles(tmp_path / "r.txt", None, tmp_path / "r.html", {})
    assert files.written() == {
        "output": str(tmp_path / "r.txt"),
        "report": str(tmp_path / "r.html"),
    }


def image_beside(folder: Path, *names: str) -> Path:
    """Write an image with RPCs in tags, or in files of some names, beside files with other RPCs."""
    tags = {} if names else {"rpcs": to_rasterio(camera_rpc(SIZE))}
    path = write_raster(folder / "image.tif", np.ones(SIZE[::-1], np.uint8), **tags)
    for i, name in enumerate(names):
        write_rpc(folder / f"{i}{Path(name).suffix}", camera_rpc(SIZE).shifted((i, 0)))
        (folder / f"{i}{Path(name).suffix}").rename(folder / name)
    return path


@pytest.mark.parametrize("name", ["image.RPB", "image.rpb", "image_RPC.TXT", "image_rpc.txt"])
def test_a_file_that_is_read_for_the_image_is_no_output(tmp_path: Path, name: str) -> None:
    path, spare = image_beside(tmp_path, name), tmp_path / "spare.rpb"
    with open_raster(path, allow_sensor_geometry=True) as source:
        require_place(source, spare, None)
        for outputs in ((tmp_path / name,), (spare, None, tmp_path / name)):
            with pytest.raises(SameFileError, match=f"{name} is read for"):
                require_place(source, *outputs)


@pytest.mark.parametrize(
    ("there", "output", "is_taken"),
    [
        ((), "image_RPC.TXT", True),
        ((), "image.RPB", True),
        (("image.RPB",), "image_RPC.TXT", False),
        (("image.rpb",), "image_rpc.txt", False),
        (("image_RPC.TXT",), "image_rpc.txt", False),
        (("image_RPC.TXT",), "image.RPB", True),
        (("image.RPB",), "other_RPC.TXT", True),
        (("image.RPB",), "image.tiff", False),
        ((), "image.tiff", True),
    ],
)
def test_refined_rpcs_are_written_where_gdal_takes_them(
    tmp_path: Path, there: tuple[str, ...], output: str, is_taken: bool
) -> None:
    path = image_beside(tmp_path, *there)
    with open_raster(path, allow_sensor_geometry=True) as source:
        if is_taken:
            require_place(source, tmp_path / output)
        else:
            with pytest.raises(OutputError, match=rf"from {there[0]}, .*: move {there[0]} else"):
                require_place(source, tmp_path / output)
    if output.startswith("image") and not output.endswith("tiff"):
        refined = camera_rpc(SIZE).shifted((0, 1000.0))
        write_rpc(tmp_path / output, refined)
        with rasterio.open(path) as dataset:
            line = float(dataset.tags(ns="RPC")["LINE_OFF"].split()[0])
        assert (line == pytest.approx(refined.image_offset[1])) == is_taken


@pytest.mark.parametrize("output", ["image_RPC.TXT", "image.RPB", "IMAGE_rpc.txt"])
@pytest.mark.parametrize(
    "driver", ["NITF", "VRT", "HFA", "PCIDSK", "PNG", "ENVI", "JP2OpenJPEG", "GTiff"]
)
def test_rpcs_are_written_beside_no_image_whose_driver_prefers_others(
    tmp_path: Path, driver: str, output: str
) -> None:
    (tmp_path / "tags").mkdir()
    original = image_beside(tmp_path / "tags")
    suffix = SUFFIXES[driver]
    rasterio.shutil.copy(original, tmp_path / f"image{suffix}", driver=driver)
    path = tmp_path / f"image{suffix}"
    with open_raster(path, allow_sensor_geometry=True) as source:
        require_place(source, tmp_path / "refined_RPC.TXT")
        require_place(source, tmp_path / "tags" / output.replace("image", "scene"))
        if driver == "GTiff":
            require_place(source, tmp_path / output)
        else:
            with pytest.raises(OutputError, match=r"is no GeoTIFF: .*--rpc.*\.tif"):
                require_place(source, tmp_path / output)
    write_rpc(tmp_path / output, camera_rpc(SIZE).shifted((0, 1000.0)))
    with rasterio.open(path) as dataset:
        line = float(dataset.tags(ns="RPC")["LINE_OFF"].split()[0])
    # JPEG 2000 reads them unless an .aux.xml has others.
    assert (line > 1000) == (driver in ("GTiff", "JP2OpenJPEG"))


SUFFIXES = {
    "NITF": ".ntf",
    "VRT": ".vrt",
    "HFA": ".img",
    "PCIDSK": ".pix",
    "PNG": ".png",
    "ENVI": ".bin",
    "JP2OpenJPEG": ".jp2",
    "GTiff": ".tif",
}


def test_where_an_image_lies_may_be_written_in_two_ways(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image_beside(tmp_path, "image.RPB")
    monkeypatch.chdir(tmp_path)
    with (
        open_raster("image.tif", allow_sensor_geometry=True) as source,
        pytest.raises(OutputError, match=r"move image\.RPB elsewhere"),
    ):
        require_place(source, tmp_path / "image_RPC.TXT")
