"""How the paths of one call stand to one another and to the disk."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio.shutil
from raster_files import utm_grid, write_raster

from groundtie.call_paths import check_different, check_paths
from groundtie.errors import OutputError, SameFileError
from groundtie.kinds import (
    REPORT_FORMAT,
    FileIn,
    FileOut,
    FolderOut,
    Kind,
    MaskIn,
    RasterIn,
    RasterOut,
    RastersIn,
    Views,
)

TEXTS: dict[str, Any] = {"label": "Label", "help": "Help."}
RASTER = RasterIn(**TEXTS)
RASTER_OUT = RasterOut(**TEXTS)
HTML_OUT = FileOut(**TEXTS, suffixes=(".html", ".htm"))
REPORT = FileOut(**TEXTS, suffixes=(".html",), numbers=True)
JSON_OUT = FileOut(**TEXTS, suffixes=(".json",))
SERIES = FolderOut(**TEXTS, writes=("series.json",))


def test_an_output_may_lie_beside_its_inputs(tmp_path: Path) -> None:
    check_paths(
        [
            ("input", RASTER, tmp_path / "a.tif"),
            ("output", RASTER_OUT, tmp_path / "b.tif"),
            ("report", HTML_OUT, None),
            ("mask", RASTER, "/vsizip/a.zip/b.tif"),
        ]
    )


def test_an_output_is_not_an_input_even_by_another_name(tmp_path: Path) -> None:
    (tmp_path / "a.tif").touch()
    (tmp_path / "link.tif").symlink_to(tmp_path / "a.tif")
    with pytest.raises(SameFileError, match="output is the same file as input"):
        check_paths(
            [
                ("output", RASTER_OUT, tmp_path / "link.tif"),
                ("input", RASTER, tmp_path / "a.tif"),
            ]
        )


@pytest.mark.parametrize(
    "name", ["GTIFF_DIR:1:{}", "vrt://{}?bands=1", "/vsisubfile/0_99,{}", "/vsicached?file={}"]
)
def test_an_output_is_not_the_file_behind_one_of_gdals_names(tmp_path: Path, name: str) -> None:
    file, virtual = tmp_path / "a.tif", tmp_path / "a.vrt"
    write_raster(file, np.zeros((4, 6)), utm_grid(6, 4))
    rasterio.shutil.copy(file, virtual, driver="VRT")
    for behind, owner in ((file, "input"), (virtual, "a source of input")):
        given = ("input", RASTER, name.format(behind))
        with pytest.raises(SameFileError, match=f"output is the same file as {owner}"):
            check_paths([given, ("output", RASTER_OUT, file)])
    source = "<SourceFilename>" + name.format(file) + "</SourceFilename>"
    virtual.write_text(f"<VRTDataset><VRTRasterBand>{source}</VRTRasterBand></VRTDataset>")
    with pytest.raises(SameFileError, match="output is the same file as a source of input"):
        check_paths([("input", RASTER, virtual), ("output", RASTER_OUT, file)])


@pytest.mark.parametrize("kind", [RASTER, MaskIn(**TEXTS), RastersIn(**TEXTS)])
def test_an_output_is_nothing_that_a_virtual_input_is_made_of(tmp_path: Path, kind: Kind) -> None:
    write_raster(tmp_path / "a.tif", np.zeros((4, 6)), utm_grid(6, 4))
    rasterio.shutil.copy(tmp_path / "a.tif", tmp_path / "a.vrt", driver="VRT")
    outer = tmp_path / "outer.vrt"
    outer.write_text((tmp_path / "a.vrt").read_text().replace("a.tif", "a.vrt"))
    (tmp_path / "link.tif").symlink_to(tmp_path / "a.tif")
    given = ("given", kind, (outer,) if isinstance(kind, RastersIn) else outer)
    for name in ("a.tif", "a.vrt", "link.tif"):
        with pytest.raises(SameFileError, match="output is the same file as a source of given"):
            check_paths([("output", RASTER_OUT, tmp_path / name), given])
    check_paths([("output", RASTER_OUT, tmp_path / "b.tif"), given])


@pytest.mark.parametrize("name", ["b_RPC.TXT", "b.rpb"])
def test_an_output_is_no_raster_whose_rpcs_are_an_input(tmp_path: Path, name: str) -> None:
    """They would be removed as those of an older raster."""
    (tmp_path / name).touch()
    rpcs = ("rpc", FileIn(**TEXTS, suffixes=(".txt", ".rpb")), tmp_path / name)
    check_paths([rpcs, ("output", RASTER_OUT, tmp_path / "c.tif")])
    with pytest.raises(SameFileError, match=f"take .*{name}, which is rpc, for RPCs of output"):
        check_paths([rpcs, ("output", RASTER_OUT, tmp_path / "b.tif")])


def test_two_outputs_are_two_files(tmp_path: Path) -> None:
    with pytest.raises(SameFileError, match="second is the same file as first"):
        check_paths(
            [
                ("first", RASTER_OUT, tmp_path / "a.tif"),
                ("second", RASTER_OUT, tmp_path / "." / "a.tif"),
            ]
        )


def test_a_folder_is_not_a_file(tmp_path: Path) -> None:
    (tmp_path / "a.tif").mkdir()
    with pytest.raises(OutputError, match="output is a folder"):
        check_paths([("output", RASTER_OUT, tmp_path / "a.tif")])


def test_a_file_is_not_a_folder(tmp_path: Path) -> None:
    (tmp_path / "a").touch()
    folder = FolderOut(**TEXTS)
    check_paths([("folder", folder, tmp_path / "new" / "folder"), ("other", folder, tmp_path)])
    with pytest.raises(OutputError, match="folder is a file"):
        check_paths([("folder", folder, tmp_path / "a")])


def test_the_folder_of_an_output_exists(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="the folder of output does not exist"):
        check_paths([("output", RASTER_OUT, tmp_path / "new" / "a.tif")])


def test_the_folder_of_an_output_can_be_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # root may write anywhere: the answer of the system is set here
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    with pytest.raises(OutputError, match="cannot be written to"):
        check_paths([("output", RASTER_OUT, tmp_path / "a.tif")])


def test_rasters_that_must_differ(tmp_path: Path) -> None:
    (tmp_path / "a.tif").touch()
    (tmp_path / "link.tif").symlink_to(tmp_path / "a.tif")
    check_different({"reference": tmp_path / "a.tif", "input": tmp_path / "b.tif"})
    with pytest.raises(SameFileError, match="input is the same raster as reference"):
        check_different({"reference": tmp_path / "a.tif", "input": tmp_path / "link.tif"})
    with pytest.raises(SameFileError, match="/vsimem/a"):
        check_different({"reference": "/vsimem/a", "input": "/vsimem/a"})


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (FileIn(**TEXTS, suffixes=(".json",)), "r.json"),
        (MaskIn(**TEXTS), "r.json"),
        (JSON_OUT, "r.json"),
        (FileOut(**TEXTS, suffixes=(".htm",), numbers=True), "r.htm"),
    ],
)
@pytest.mark.parametrize("is_first", [True, False])
def test_what_is_put_beside_an_output_is_no_other_file(
    tmp_path: Path, kind: Kind, name: str, is_first: bool
) -> None:
    other, report = ("other", kind, tmp_path / name), ("report", REPORT, tmp_path / "r.html")
    with pytest.raises(SameFileError, match=r"also write .*r\.json, which is .*(other|report)"):
        check_paths([report, other] if is_first else [other, report])
    check_paths([("report", REPORT, tmp_path / "another.html"), other])


def test_one_of_many_inputs_counts_too(tmp_path: Path) -> None:
    dates = ("dates", RastersIn(**TEXTS), (tmp_path / "a.tif", tmp_path / "items.json"))
    with pytest.raises(SameFileError, match=r"would also write .*items\.json, which is dates"):
        check_paths([dates, ("report", REPORT, tmp_path / "items.html")])


def test_a_file_that_states_a_view_is_an_input(tmp_path: Path) -> None:
    stated = f"radar azimuth=280 incidence=35; {tmp_path / 'item.json'}"
    with pytest.raises(SameFileError, match="classifier is the same file as views"):
        check_paths(
            [
                ("views", Views(**TEXTS), stated),
                ("classifier", JSON_OUT, tmp_path / "item.json"),
            ]
        )


def test_what_is_written_into_a_folder_is_no_other_file(tmp_path: Path) -> None:
    folder = ("folder", SERIES, tmp_path)
    with pytest.raises(SameFileError, match=r"report would also .*, which is a file of folder"):
        check_paths([folder, ("report", REPORT, tmp_path / "series.html")])
    with pytest.raises(SameFileError, match=r"folder would also .*series\.json, which is table"):
        check_paths([folder, ("table", FileIn(**TEXTS, suffixes=()), tmp_path / "series.json")])
    check_paths([folder, ("report", REPORT, tmp_path / "report.html")])


@pytest.mark.parametrize("content", ['{"type": "Feature", "run": "1"}', "[]", "no JSON", "\0"])
def test_numbers_replace_nothing_but_numbers(tmp_path: Path, content: str) -> None:
    """Such as the item of an image, which is read without being named."""
    call = [("input", RASTER, tmp_path / "a.tif"), ("report", REPORT, tmp_path / "a.html")]
    check_paths(call)
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(OutputError, match=r"would also write .*a\.json, which is something else"):
        check_paths(call)
    (tmp_path / "a.json").write_text(json.dumps({"format": REPORT_FORMAT}))
    check_paths(call)
