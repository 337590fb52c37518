"""No row reads or writes what another one, or the batch itself, writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from toys import TOY

from groundtie.batches.apart import check_apart
from groundtie.batches.calls import make_calls
from groundtie.declaration import Tool
from groundtie.errors import OutputError, SameFileError
from groundtie.tools import load_tool

ROW = {"reference": "a.tif", "input": "b.tif", "size": "3"}


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    for name in ("a.tif", "b.tif"):
        (tmp_path / "in" / name).write_bytes(b"raster")
    return tmp_path / "in", tmp_path / "out"


def check(folders: tuple[Path, Path], tool: Tool, *rows: dict[str, Any]) -> None:
    """Check rows of a table `t.json` of the folder of inputs."""
    calls = make_calls(tool, rows, *folders, 1)
    assert [call.problem for call in calls] == [""] * len(rows)
    results = [folders[1] / f"t.json.{ending}" for ending in ("results.json", "results.csv")]
    check_apart(tool, calls, folders[0] / "t.json", [folders[1] / "t.json.log.jsonl", *results])


def test_two_rows_may_not_write_one_file(folders: tuple[Path, Path]) -> None:
    row = {**ROW, "output": "c.tif"}
    with pytest.raises(SameFileError, match=r"rows 1 and 2 both write .*c\.tif"):
        check(folders, TOY, row, {**row, "seed": 3, "output": "sub/../c.tif"})


def test_no_row_may_write_what_another_reads(folders: tuple[Path, Path]) -> None:
    other = {**ROW, "input": "c.tif", "output": str(folders[0] / "b.tif")}
    with pytest.raises(OutputError, match="row 2 would write what row 1 reads"):
        check(folders, TOY, ROW, other)


def test_no_row_may_write_what_anothers_virtual_input_is_made_of(
    folders: tuple[Path, Path],
) -> None:
    source = '<SourceFilename relativeToVRT="1">mid.tif</SourceFilename>'
    (folders[0] / "m.vrt").write_text(
        f"<VRTDataset><VRTRasterBand>{source}</VRTRasterBand></VRTDataset>"
    )
    rows = [{**ROW, "output": str(folders[0] / "mid.tif")}, {**ROW, "input": "m.vrt"}]
    with pytest.raises(OutputError, match=r"row 1 would write what row 2 reads: .*mid\.tif"):
        check(folders, TOY, *rows)


def test_what_lies_beside_an_output_is_no_other_rows(folders: tuple[Path, Path]) -> None:
    pair = {"reference": "a.tif", "input": "b.tif"}
    rows = [{**pair, "report": "r.html"}, {**pair, "transform": "r.json"}]
    with pytest.raises(SameFileError, match="rows 1 and 2 both write"):
        check(folders, load_tool("coregister"), *rows)


def test_what_a_series_writes_is_no_input_of_another(folders: tuple[Path, Path]) -> None:
    rows = [{"inputs": "a.tif;b.tif"}, {"inputs": [str(folders[1] / "1/series.json")]}]
    with pytest.raises(OutputError, match="row 1 would write what row 2 reads"):
        check(folders, load_tool("coregister_series"), *rows)


@pytest.mark.parametrize(
    ("path", "error", "message"),
    [
        ("in/t.json", OutputError, "row 2 would write what the batch reads"),
        ("out/t.json.results.json", SameFileError, "the batch and row 2 both write"),
        ("out/t.json.log.jsonl", SameFileError, "the batch and row 2 both write"),
    ],
)
def test_no_row_may_write_the_batchs_own_files(
    folders: tuple[Path, Path], tmp_path: Path, path: str, error: type[Exception], message: str
) -> None:
    (folders[0] / "t.json").write_text("[]")
    pair = {"reference": "a.tif", "input": "b.tif"}
    tool, row = load_tool("coregister"), {**pair, "transform": str(tmp_path / path)}
    if path.endswith(".jsonl"):
        pair, tool, row = ROW, TOY, {**ROW, "folder": str(tmp_path / path)}
    with pytest.raises(error, match=message):
        check(folders, tool, pair, row)


def test_no_row_may_read_the_results(folders: tuple[Path, Path]) -> None:
    row = {**ROW, "transform": str(folders[1] / "t.json.results.json")}
    with pytest.raises(OutputError, match="the batch would write what row 1 reads"):
        check(folders, TOY, row)


@pytest.mark.parametrize("inputs", ["out/1/a.tif", "out/1/*.tif", "out/1/deep/*.tif", "out/1"])
def test_what_lies_in_a_rows_output_folder_is_no_input_of_another(
    folders: tuple[Path, Path], tmp_path: Path, inputs: str
) -> None:
    rows = [{"inputs": "a.tif;b.tif"}, {"inputs": str(tmp_path / inputs)}]
    with pytest.raises(OutputError, match="row 1 would write what row 2 reads"):
        check(folders, load_tool("coregister_series"), *rows)


@pytest.mark.parametrize("others", ["dates", "dates/*.tif", "dates.csv"])
def test_what_an_input_stands_for_is_no_output_of_another(
    folders: tuple[Path, Path], others: str
) -> None:
    (folders[0] / "dates").mkdir()
    (folders[0] / "dates.csv").write_text("file\ndates/new.tif\n")
    written = {**ROW, "output": str(folders[0] / "dates/new.tif")}
    with pytest.raises(OutputError, match="row 1 would write what row 2 reads"):
        check(folders, TOY, written, {**ROW, "others": others})
    check(folders, TOY, {**ROW, "output": str(folders[1] / "new.tif")}, {**ROW, "others": "dates"})


def test_a_row_may_read_beside_the_output_folders_of_others(folders: tuple[Path, Path]) -> None:
    rows = [{"inputs": "a.tif;b.tif"}, {"inputs": "*.tif"}]
    check(folders, load_tool("coregister_series"), *rows)
