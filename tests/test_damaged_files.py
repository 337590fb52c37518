"""What a file states cannot hang, explode or crash a job: it ends in a result or in one line."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster
from rasterio.crs import CRS
from rasterio.enums import ColorInterp

from benchmarks.fuzz_files import SIDE, write_seeds
from groundtie.cli import main
from groundtie.rasters import reading

LOCAL = 'LOCAL_CS["site",UNIT["metre",1]]'
ENGINEERING = (
    'ENGCRS["site",EDATUM["pole"],CS[Cartesian,2],AXIS["x",east],AXIS["y",north],'
    'LENGTHUNIT["metre",1]]'
)


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("healthy")
    write_seeds(folder)
    return folder


@pytest.fixture
def files(healthy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of healthy files, which is the current one."""
    folder = tmp_path / "files"
    shutil.copytree(healthy, folder)
    monkeypatch.chdir(folder)
    return folder


def run(capsys: pytest.CaptureFixture[str], words: str | list[str]) -> tuple[int, str]:
    """Return the exit code and what is on standard error."""
    code = main(words.split() if isinstance(words, str) else words)
    return code, capsys.readouterr().err


def refused(capsys: pytest.CaptureFixture[str], words: str | list[str], code: int = 2) -> str:
    """Return the one line that a run ends with, which writes nothing."""
    found, error = run(capsys, words)
    assert (found, error.count("\n")) == (code, 1), error
    assert not Path("out.tif").exists()
    return error


WARP = "warp image.tif out.tif --workers 1 --transform"
ORTHO = "orthorectify sensor.tif out.tif --workers 1"


@pytest.mark.parametrize(
    "words",
    [
        *(f"warp {name} out.tif --transform affine.json" for name in (
            "image.tif", "lzw.tif", "tiled.tif", "masked.tif", "beside.tif", "image.vrt")),
        *(f"{WARP} {name}" for name in ("bent.json", "spline.json", "points.gpkg",
            "points.geojson", "points.csv", "points.points")),
        *(f"{ORTHO} --rpc {name}" for name in ("rpc.txt", "rpc.rpb", "rpc.xml")),
        f"{ORTHO} --dem dem.tif --geoid geoid.tif",
    ],
)  # fmt: skip
def test_healthy_files_are_read(
    files: Path, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, words) == (0, "")


class TestRasters:
    """What a raster states of itself."""

    @pytest.mark.parametrize("crs", [LOCAL, ENGINEERING, "EPSG:4978", "EPSG:5773"])
    @pytest.mark.parametrize("tool", ["warp", "mask-threshold", "filter-speckle"])
    def test_a_crs_that_is_no_maps(
        self, files: Path, crs: str, tool: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        with rasterio.open("image.tif", "r+") as dataset:
            dataset.crs = CRS.from_user_input(crs)
        more = " --transform affine.json" if tool == "warp" else ""
        line = refused(capsys, f"{tool} image.tif out.tif{more}")
        assert "image.tif: a CRS is neither projected nor geographic" in line

    def test_a_crs_that_cannot_be_written(
        self, files: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """Its degrees have no size: nothing lies anywhere by it, or it cannot be written."""
        text = (files / "spline.json").read_text()
        degree = "0.0174532925199433"
        assert degree in text
        (files / "spline.json").write_text(text.replace(degree, "0"))
        line = refused(capsys, f"{WARP} spline.json")
        assert "a CRS cannot be written" in line or ".tif" in line

    @pytest.mark.parametrize(
        "transform", ["0, 0, 0, 0, 0, 0", "0, 10, 20, 0, 5, 10", "nan, 10, 0, 0, 0, -10",
                      "0, 1e-200, 0, 0, 0, 1e-200", "0, inf, 0, 0, 0, -10"],
    )  # fmt: skip
    def test_pixels_without_a_size(
        self, files: Path, transform: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        text = (files / "image.vrt").read_text()
        (files / "image.vrt").write_text(text.replace("500000, 10, 0, 5000000, 0, -10", transform))
        line = refused(capsys, "warp image.vrt out.tif --transform affine.json")
        assert "gives its pixels no size" in line

    def test_too_many_bands(
        self, files: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(reading, "MOST_BANDS", 2)
        line = refused(capsys, "filter-speckle lzw.tif out.tif")
        assert "lzw.tif has 3 bands; at most 2 are read" in line

    def test_a_band_that_stands_alone_is_the_image(
        self, files: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        image = np.full((1, SIDE, SIDE), 7, np.uint8)
        colours = [ColorInterp.alpha]
        write_raster(files / "alpha.tif", image, utm_grid(SIDE, SIDE), colorinterp=colours)
        assert run(capsys, "warp alpha.tif out.tif --transform affine.json")[0] == 0
        with rasterio.open("out.tif") as dataset:
            assert dataset.read(1).max() == 7

    def test_bands_of_several_types(self, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
        text = (files / "image.vrt").read_text()
        start, band = text.split("<VRTRasterBand", 1)
        band = "<VRTRasterBand" + band.removesuffix("</VRTDataset>")
        second = band.replace('"Byte" band="1"', '"CFloat32" band="2"')
        (files / "image.vrt").write_text(f"{start}{band}{second}</VRTDataset>")
        assert run(capsys, "warp image.vrt out.tif --transform affine.json")[0] == 0
        with rasterio.open("out.tif") as dataset:
            assert dataset.dtypes == ("complex64", "complex64")
            np.testing.assert_array_equal(dataset.read(1), dataset.read(2))

    @pytest.mark.parametrize(
        "words", ["warp {} out.tif --transform affine.json", "mask-threshold {} out.tif",
                  "mask-regions {} out.tif", "filter-speckle {} out.tif"],
    )  # fmt: skip
    def test_more_pixels_than_anybody_has(
        self, files: Path, words: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """As map services state of their rasters."""
        side = 2**31 - 1
        text = (files / "image.vrt").read_text()
        text = text.replace(f'rasterXSize="{SIDE}" rasterYSize="{SIDE}"',
                            f'rasterXSize="{side}" rasterYSize="{side}"')  # fmt: skip
        (files / "image.vrt").write_text(text)
        line = refused(capsys, words.format("image.vrt"))
        assert "pixels" in line

    def test_text_that_is_no_utf8(self, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
        content = (files / "image.vrt").read_bytes()
        (files / "image.vrt").write_bytes(content.replace(b"<VRTDataset", b"<VRTDat\xed\xdb\xfc"))
        assert "cannot read image.vrt" in refused(
            capsys, "warp image.vrt out.tif --transform affine.json"
        )


def changed(path: str, change: Callable[[dict[str, Any]], object]) -> None:
    values = json.loads(Path(path).read_text())
    change(values)
    Path(path).write_text(json.dumps(values))


class TestTransforms:
    """Transforms that nobody made."""

    @pytest.mark.parametrize("number", ["Infinity", "NaN", "1e400", "-1e999", "1" + "0" * 400])
    def test_numbers_that_are_none(
        self, files: Path, number: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        changed("affine.json", lambda values: values["model"]["frame"].__setitem__(0, 12345.0))
        text = (files / "affine.json").read_text()
        (files / "affine.json").write_text(text.replace("12345.0", number))
        assert "cannot read the transform affine.json" in refused(capsys, f"{WARP} affine.json")

    @pytest.mark.parametrize("bracket", ["[", '{"a":'])
    def test_brackets_without_end(
        self, files: Path, bracket: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (files / "affine.json").write_text(bracket * 100_000)
        refused(capsys, f"{WARP} affine.json")

    @pytest.mark.parametrize(
        "change",
        [
            lambda v: v["model"].update(frame=[1, 1, 0, 1, 1, 0]),
            lambda v: v["model"].update(frame=[1, "x"]),
            lambda v: v["model"].update(kind=["affine"]),
            lambda v: v["input"].update(geotransform=[0, 0, 0, 0, 0, 0]),
            lambda v: v["input"].update(width=0),
            lambda v: v["input"].update(width=1e300),
            lambda v: v["input"].update(crs=LOCAL),
            lambda v: v.update(crs="EPSG:0"),
        ],
    )
    def test_values_that_describe_none(
        self, files: Path, change: Callable[[dict[str, Any]], object],
        capsys: pytest.CaptureFixture[str],
    ) -> None:  # fmt: skip
        changed("affine.json", change)
        assert "affine.json" in refused(capsys, f"{WARP} affine.json")

    @pytest.mark.parametrize("metres", ["1e300", "0", "1e-30"])
    def test_a_unit_of_no_length(
        self, files: Path, metres: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        text = (files / "affine.json").read_text()
        assert text.count('UNIT[\\"metre\\",1,') == 2
        text = text.replace('UNIT[\\"metre\\",1,', f'UNIT[\\"metre\\",{metres},', 1)
        (files / "affine.json").write_text(text)
        assert "affine.json" in refused(capsys, f"{WARP} affine.json")

    def test_a_spline_of_unequal_lengths(
        self, files: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        changed("spline.json", lambda values: values["model"]["weights"].pop())
        assert "12 knots have 11 weights" in refused(capsys, f"{WARP} spline.json")

    @pytest.mark.parametrize("slope", [-1.0, -0.999999])
    def test_a_grid_that_it_blows_up(
        self, files: Path, slope: float, capsys: pytest.CaptureFixture[str]
    ) -> None:
        # Rows on the map do not move, or hardly, along the rows of the raster.
        changed(
            "affine.json", lambda v: v["model"].update(coefficients=[[0, 0], [0, 0], [0, slope]])
        )
        refused(capsys, f"{WARP} affine.json")

    def test_one_without_a_crs_for_a_raster_with_one(
        self, files: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        changed("affine.json", lambda values: values.update(crs=None))
        changed("affine.json", lambda values: values["input"].update(crs=None))
        line = refused(capsys, f"{WARP} affine.json")
        assert "affine.json does not state the CRS of its map, but image.tif has one" in line


class TestPoints:
    """Tie points with odd rows."""

    @pytest.mark.parametrize("number", ["nan", "inf", "1e300", "", "x", "9" * 200_000])
    @pytest.mark.parametrize("suffix", ["csv", "points"])
    def test_positions_on_no_map(
        self, files: Path, number: str, suffix: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = files / f"points.{suffix}"
        lines = path.read_text().splitlines()
        lines[-1] = ",".join([number, *lines[-1].split(",")[1:]])
        path.write_text("\n".join(lines))
        assert "cannot read the tie points" in refused(capsys, f"{WARP} {path.name}")

    def test_a_row_without_enable_is_enabled(
        self, files: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        lines = (files / "points.points").read_text().splitlines()
        short = [line if line[0] in "#m" else ",".join(line.split(",")[:4]) for line in lines]
        (files / "points.points").write_text("\n".join(short))
        assert run(capsys, f"{WARP} points.points") == (0, "")


class TestRpcs:
    """RPCs of no image."""

    @pytest.mark.parametrize(
        ("key", "value"),
        [("LINE_OFF", "1e300"), ("LONG_OFF", "-1e9"), ("HEIGHT_SCALE", "inf"), ("LAT_SCALE", "0"),
         ("LINE_DEN_COEFF_1", "0"), ("SAMP_NUM_COEFF_2", "0")],
    )  # fmt: skip
    def test_numbers_that_are_of_none(
        self, files: Path, key: str, value: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        lines = (files / "rpc.txt").read_text().splitlines()
        found = [f"{key}: {value}" if line.startswith(f"{key}:") else line for line in lines]
        assert found != lines
        if key == "SAMP_NUM_COEFF_2":  # heights alone do not make an image
            found = [line if "SAMP_NUM_COEFF" not in line else f"{line.split(':')[0]}: 0"
                     for line in found]  # fmt: skip
        (files / "rpc.txt").write_text("\n".join(found))
        assert "the RPCs of rpc.txt" in refused(capsys, f"{ORTHO} --rpc rpc.txt")

    def test_one_long_word(self, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (files / "rpc.rpb").write_text("x" * 300_000)
        started = time.monotonic()
        refused(capsys, f"{ORTHO} --rpc rpc.rpb")
        assert time.monotonic() - started < 5


@pytest.mark.parametrize("crs", ["EPSG:4978", "EPSG:5773", LOCAL, "EPSG:0", "nonsense"])
def test_a_crs_that_is_asked_for_must_be_a_maps(
    files: Path, crs: str, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(capsys, [*ORTHO.split(), "--crs", crs])
    assert "crs is not understood" in line


class TestNames:
    """Names that are no files, or that cannot be written down."""

    def test_a_pipe_is_no_file(self, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
        os.mkfifo("pipe.json")
        os.mkfifo("pipe.tif")
        assert "is neither a file nor a folder" in refused(capsys, f"{WARP} pipe.json")
        refused(capsys, "warp pipe.tif out.tif --transform affine.json")
        refused(capsys, "warp /dev/zero out.tif --transform affine.json")

    @pytest.mark.parametrize("name", ["x" * 300, "d/" * 3000 + "a", "a\0b"])
    def test_what_no_file_is_called(
        self, files: Path, name: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        refused(capsys, ["warp", f"{name}.tif", "out.tif", "--transform", "affine.json"])
        refused(capsys, ["warp", "image.tif", f"{name}.tif", "--transform", "affine.json"])

    def test_a_name_that_is_no_utf8(self, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
        name = os.fsdecode(b"caf\xe9.tif")
        (files / "image.tif").rename(name)
        line = refused(capsys, ["warp", name, "out.tif", "--transform", "affine.json"])
        assert "has a name that is not UTF-8: 'caf\\udce9.tif'" in line

    def test_a_working_folder_that_is_no_utf8(
        self, files: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        folder = files / os.fsdecode(b"M\xfcnchen")
        folder.mkdir()
        shutil.copy("image.tif", folder)
        (folder / "t.csv").write_text("input,output\nimage.tif,m.tif\n")
        monkeypatch.chdir(folder)
        for call in ("mask-threshold image.tif m.tif", "batch mask-threshold t.csv"):
            assert "has a name that is not UTF-8" in refused(capsys, call)
        assert sorted(os.listdir()) == ["image.tif", "t.csv"]


def test_files_that_broke_a_version(real_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = real_data / "bad-files"
    warp = ["warp", str(bad / "ref.tif"), "out.tif", "--transform"]
    for name in ("deep.json", "ti.json", "th.json", "segv.gpkg"):
        assert name in refused(capsys, [*warp, str(bad / name)])
    for name in ("bands65281.tif", "lc.tif", "zp.tif"):
        refused(capsys, ["filter-speckle", str(bad / name), "out.tif"])


def test_files_that_rasterio_reads_are_read(
    real_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("odd_tag.tif", "oa.tif", "mx.vrt"):
        made = str(tmp_path / "mask.tif")
        assert run(capsys, ["mask-threshold", str(real_data / "bad-files" / name), made])[0] == 0
