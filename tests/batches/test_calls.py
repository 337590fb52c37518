"""Rows become calls: paths, words of spreadsheets, names of outputs, and what must not meet."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from toys import TOY

from groundtie.batches.calls import Call, make_calls
from groundtie.errors import OutputError, ParameterError, SameFileError
from groundtie.tools import load_tool

ROW = {"reference": "a.tif", "input": "b.tif", "size": "3"}


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    for name in ("a.tif", "b.tif"):
        (tmp_path / "in" / name).write_bytes(b"raster")
    return tmp_path / "in", tmp_path / "out"


def calls_of(folders: tuple[Path, Path], *rows: dict[str, Any]) -> list[Call]:
    return make_calls(TOY, rows, *folders, 1)


def test_paths_begin_at_their_folders(folders: tuple[Path, Path], tmp_path: Path) -> None:
    row = {**ROW, "output": "sub/c.tif", "report": str(tmp_path / "r.html"), "mask": "/vsimem/m"}
    (call,) = calls_of(folders, row)
    assert call.problem == ""
    assert call.values["input"] == folders[0] / "b.tif"
    assert call.values["mask"] == "/vsimem/m"
    assert call.outputs == {
        "output": folders[1] / "sub/c.tif",
        "report": tmp_path / "r.html",
    }
    assert (folders[1] / "sub").is_dir()


def test_required_outputs_have_the_names_of_their_rows(folders: tuple[Path, Path]) -> None:
    calls = calls_of(folders, *[{**ROW, "report": "{name}.html"}] * 9, {**ROW, "name": "Rome"})
    assert calls[0].outputs["output"] == folders[1] / "01.tif"
    assert calls[0].outputs["report"] == folders[1] / "01.html"
    assert calls[9].outputs == {"output": folders[1] / "Rome.tif"}


@pytest.mark.parametrize(("word", "value"), [("yes", True), ("No", False), ("1", True), (0, False)])
def test_flags_are_words(folders: tuple[Path, Path], word: Any, value: bool) -> None:
    (call,) = calls_of(folders, {**ROW, "careful": word})
    assert call.values["careful"] is value


def test_workers_are_those_of_the_row(folders: tuple[Path, Path]) -> None:
    first, second = make_calls(TOY, [ROW, {**ROW, "workers": 2}], *folders, 5)
    assert (first.values["workers"], second.values["workers"]) == (5, 2)


def test_a_number_may_stand_for_a_text(folders: tuple[Path, Path]) -> None:
    (call,) = calls_of(folders, {**ROW, "title": 7})
    assert call.values["title"] == "7"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"size": "ten"}, "size must be a number, not 'ten'"),
        ({"size": None}, "size is missing"),
        ({"careful": "perhaps"}, "careful must be true or false"),
        ({"output": "c.pdf"}, "output must end in .tif"),
        ({"output": 3}, "output must be a path, not 3"),
        ({"input": "a.tif"}, "input is the same raster as reference"),
    ],
)
def test_a_bad_row_has_its_problem_and_no_other_row_has(
    folders: tuple[Path, Path], change: dict[str, Any], message: str
) -> None:
    bad = {key: value for key, value in {**ROW, **change}.items() if value is not None}
    first, second = calls_of(folders, bad, ROW)
    assert message in first.problem
    assert second.problem == ""


def test_a_column_that_the_tool_does_not_know_is_an_error_of_the_table(
    folders: tuple[Path, Path],
) -> None:
    with pytest.raises(ParameterError, match="a column colour, which toy does not know"):
        calls_of(folders, ROW, {**ROW, "colour": "red"})


def test_two_rows_may_not_write_one_file(folders: tuple[Path, Path]) -> None:
    row = {**ROW, "output": "c.tif"}
    with pytest.raises(SameFileError, match=r"rows 1 and 2 both write .*c\.tif"):
        calls_of(folders, row, {**row, "seed": 3, "output": "sub/../c.tif"})


def test_no_row_may_write_what_another_reads(folders: tuple[Path, Path]) -> None:
    other = {**ROW, "input": "c.tif", "output": str(folders[0] / "b.tif")}
    with pytest.raises(OutputError, match="row 2 would write what row 1 reads"):
        calls_of(folders, ROW, other)


def test_the_key_stands_for_files_parameters_and_outputs(folders: tuple[Path, Path]) -> None:
    def key(**change: Any) -> str:
        (call,) = calls_of(folders, {**ROW, **change})
        return call.key

    first = key()
    assert key() == first
    assert key(name="1") == first
    assert len({first, key(seed=8), key(output="d.tif"), key(report="r.html")}) == 4
    os.utime(folders[0] / "b.tif", (1e9, 1e9))
    assert key() != first


def test_what_lies_beside_an_output_is_no_other_rows(folders: tuple[Path, Path]) -> None:
    pair = {"reference": "a.tif", "input": "b.tif"}
    rows = [{**pair, "report": "r.html"}, {**pair, "transform": "r.json"}]
    with pytest.raises(SameFileError, match="rows 1 and 2 both write"):
        make_calls(load_tool("coregister"), rows, *folders, 1)


def test_what_a_series_writes_is_no_input_of_another(folders: tuple[Path, Path]) -> None:
    rows = [{"inputs": "a.tif;b.tif"}, {"inputs": [str(folders[1] / "1/series.json")]}]
    with pytest.raises(OutputError, match="row 1 would write what row 2 reads"):
        make_calls(load_tool("coregister_series"), rows, *folders, 1)


def test_several_inputs_are_a_list_or_one_cell(folders: tuple[Path, Path]) -> None:
    series = load_tool("coregister_series")
    rows = [{"inputs": "a.tif;b.tif"}, {"inputs": ["a.tif", "b.tif"], "name": "again"}]
    first, second = make_calls(series, rows, *folders, 1)
    assert first.problem == second.problem == ""
    expected = (folders[0] / "a.tif", folders[0] / "b.tif")
    assert first.values["inputs"] == second.values["inputs"] == expected
    assert first.outputs == {"output_folder": folders[1] / "1"}
    assert second.outputs == {"output_folder": folders[1] / "again"}
