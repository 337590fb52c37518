"""Rows become calls: paths, words of spreadsheets, names of outputs, and what must not meet."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from raster_files import write_raster
from rpc_models import camera_rpc
from toys import TOY

from groundtie.batches import calls, input_files
from groundtie.batches.calls import Call, make_calls
from groundtie.errors import ParameterError
from groundtie.sensor.rpc_files import write_rpc
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


def test_a_file_of_the_tables_folder_comes_before_gdals_names(
    folders: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folders[0] / "S1A:10.tif").touch()
    row = {**ROW, "input": "S1A:10.tif", "others": "S1A:10.tif;S1A:11.tif"}
    for place in (tmp_path, folders[0]):
        monkeypatch.chdir(place)
        (call,) = calls_of(folders, row)
        assert call.values["input"] == folders[0] / "S1A:10.tif"
        assert call.values["others"] == (folders[0] / "S1A:10.tif", "S1A:11.tif")


def test_required_outputs_have_the_names_of_their_rows(folders: tuple[Path, Path]) -> None:
    calls = calls_of(folders, *[{**ROW, "report": "{name}.html"}] * 9, {**ROW, "name": "Rome"})
    assert calls[0].outputs["output"] == folders[1] / "01.tif"
    assert calls[0].outputs["report"] == folders[1] / "01.html"
    assert calls[9].outputs == {"output": folders[1] / "Rome.tif"}


@pytest.mark.parametrize(
    "name",
    ["..", "../x", "B/../../x", "B/..", "..\\x", "B\\../x", "/tmp/x", "\\x", "D:x", "a\0b"],
)
def test_a_name_leads_not_out_of_the_output_folder(folders: tuple[Path, Path], name: str) -> None:
    """Where no output is named by it, it is a label."""
    first, second, third = calls_of(
        folders,
        {**ROW, "name": name},
        {**ROW, "name": name, "output": "of {name}.tif"},
        {**ROW, "name": name, "output": "c.tif"},
    )
    for call in (first, second):
        assert call.problem.startswith("the row's name ")
        assert call.outputs == {}
    assert third.problem == ""
    assert sorted(folders[0].parent.iterdir()) == sorted(folders)


def test_a_name_that_is_no_text_is_a_problem_of_its_row(folders: tuple[Path, Path]) -> None:
    """No table of results could state it."""
    bad, good = calls_of(folders, {**ROW, "name": "a\udcff", "output": "c.tif"}, ROW)
    assert bad.problem == r"the row's name 'a\udcff' is not UTF-8" and bad.name == r"a\udcff"
    assert good.problem == ""


@pytest.mark.parametrize("name", ["B/x", "v1.2..b", "..b", "S1A:10"])
def test_a_name_may_lead_into_it(folders: tuple[Path, Path], name: str) -> None:
    (call,) = calls_of(folders, {**ROW, "name": name})
    assert (call.problem, call.outputs) == ("", {"output": folders[1] / f"{name}.tif"})


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


def key_of_series(folders: tuple[Path, Path], inputs: Any) -> str:
    (call,) = make_calls(load_tool("coregister_series"), [{"inputs": inputs}], *folders, 1)
    assert call.problem == ""
    return call.key


@pytest.mark.parametrize("inputs", ["dates", "dates/*.tif", "dates.csv", "item.json"])
def test_the_key_stands_for_the_files_that_an_input_stands_for(
    folders: tuple[Path, Path], inputs: str
) -> None:
    (folders[0] / "dates").mkdir()
    date = folders[0] / "dates/1.tif"
    date.write_bytes(b"raster")
    (folders[0] / "dates.csv").write_text("file,name\ndates/1.tif,first\n")
    item = {"type": "Feature", "id": "1", "assets": {"data": {"href": "dates/1.tif"}}}
    (folders[0] / "item.json").write_text(json.dumps(item))
    first = key_of_series(folders, inputs)
    assert key_of_series(folders, inputs) == first
    with date.open("r+b") as file:  # in place: neither the folder nor its time changes
        file.write(b"ano")
    os.utime(date, (1e9, 1e9))
    assert key_of_series(folders, inputs) != first


@pytest.mark.parametrize("inputs", ["dates", "dates/*.tif"])
def test_the_key_stands_for_the_files_of_folders_and_patterns(
    folders: tuple[Path, Path], inputs: str
) -> None:
    (folders[0] / "dates").mkdir()
    for number in (1, 2):
        (folders[0] / f"dates/{number}.tif").write_bytes(b"raster")
    first = key_of_series(folders, inputs)
    (folders[0] / "dates/3.tif").touch()
    assert key_of_series(folders, inputs) != first


def test_files_of_one_name_in_two_folders_are_not_one(folders: tuple[Path, Path]) -> None:
    for name in "xy":
        (folders[0] / name).mkdir()
        (folders[0] / name / "b.tif").write_bytes(b"raster")
        os.utime(folders[0] / name / "b.tif", (1e9, 1e9))
    row = {"reference": "x/b.tif", "input": "y/b.tif", "size": "3", "output": "c.tif"}
    swapped = {**row, "reference": "y/b.tif", "input": "x/b.tif"}
    keys = [calls_of(folders, one)[0].key for one in (row, swapped)]
    assert keys[0] != keys[1]


@pytest.mark.parametrize(
    "name",
    ["b.tif.aux.xml", "b.tif.ovr", "b.tif.msk", "b.tfw", "b.TFW", "b.tifw", "b.wld", "b.RPB",
     "b_RPC.TXT", "b_rpc.txt", "b.tab"],
)  # fmt: skip
def test_the_key_stands_for_what_gdal_reads_beside_an_input(
    folders: tuple[Path, Path], name: str
) -> None:
    write_raster(folders[0] / "b.tif", np.ones((9, 9), np.uint8))
    (before,) = calls_of(folders, ROW)
    write_beside(folders[0] / name)
    with rasterio.open(folders[0] / "b.tif") as dataset:
        assert [Path(file).name for file in dataset.files] == ["b.tif", name]
    (after,) = calls_of(folders, ROW)
    assert after.key != before.key


@pytest.mark.parametrize(
    ("image", "name"),
    [
        *(("b.tif", f"b{ending}") for ending in (".xml", ".XML", ".rpc", ".eph", ".pvl", ".IMD")),
        ("b.TIF", "B.xml"),
        ("IMG_P1.TIF", "RPC_P1.XML"),
        ("IMG_P1.TIF", "DIM_P1.XML"),
        ("IMG_P1_R2C1.TIF", "RPC_P1.XML"),
        ("IMG_P1_R2C1.TIF", "dim_p1_r2c1.xml"),
    ],
)
def test_the_key_stands_for_metadata_of_missions_beside_an_input(
    folders: tuple[Path, Path], image: str, name: str
) -> None:
    (folders[0] / image).write_bytes(b"raster")
    row = {**ROW, "input": image}
    found = []
    for text in ("", "1", "2"):
        if text:
            (folders[0] / name).write_text(text)
            os.utime(folders[0] / name, (1, int(text)))
        (call,) = calls_of(folders, row)
        assert not call.problem
        found.append(call.key)
    assert len(set(found)) == 3


@pytest.mark.parametrize(
    "name", ["b.json", "b_extended.json", "../annotation/b.xml", "named.json", "./named.json"]
)
def test_the_key_stands_for_the_files_that_state_a_view(
    folders: tuple[Path, Path], name: str
) -> None:
    path = folders[0] / name
    stated = {"named.json": str(path), "./named.json": "radar azimuth=90 incidence=35; named.json"}
    views = {"views": stated[name]} if name in stated else {}
    row = {"reference": "b.tif", "surface_model": "a.tif", **views}
    path.parent.mkdir(exist_ok=True)
    found = []
    for azimuth in (90, 270):
        path.write_text(json.dumps({"properties": {"view:azimuth": azimuth}}))
        (call,) = make_calls(load_tool("mask_surface"), [row], *folders, 1)
        assert not call.problem
        found.append(call.key)
    assert found[0] != found[1]


def test_reports_and_tables_of_a_rasters_name_are_no_part_of_it(
    folders: tuple[Path, Path],
) -> None:
    """Nor is any file that the row itself writes beside its input."""
    row = {**ROW, "output": str(folders[0] / "B.tif"), "report": str(folders[0] / "b.html")}
    (before,) = calls_of(folders, row)
    for name in ("B.tif", "b.html", "b.json", "b.csv", "b.gpkg"):
        (folders[0] / name).touch()
    (after,) = calls_of(folders, row)
    assert not after.problem and after.key == before.key


@pytest.mark.parametrize("others", ["", "/vsizip/{0}/b.tif", "dates.csv"])
def test_the_key_stands_for_the_archive_that_an_input_lies_in(
    folders: tuple[Path, Path], others: str
) -> None:
    archive = folders[0] / "b.zip"
    archive.write_bytes(b"archive")
    (folders[0] / "dates.csv").write_text(f"file\n/vsizip/{archive}/b.tif\n")
    row = {**ROW, "others": others.format(archive)} if others else None
    row = row or {**ROW, "input": f"/vsizip/{archive}/b.tif"}
    (before,) = calls_of(folders, row)
    assert not before.problem and calls_of(folders, row)[0].key == before.key
    archive.write_bytes(b"another")
    os.utime(archive, (1e9, 1e9))
    assert calls_of(folders, row)[0].key != before.key


def test_an_input_of_which_no_file_is_known_has_never_the_same_key(
    folders: tuple[Path, Path],
) -> None:
    row = {**ROW, "input": "/vsimem/b.tif"}
    first, second = (calls_of(folders, row)[0] for _ in range(2))
    assert not first.problem and first.key != second.key


def test_an_input_on_a_server_counts_by_its_name(folders: tuple[Path, Path]) -> None:
    keys = [
        calls_of(folders, {**ROW, "input": f"/vsicurl/https://host/{name}"})[0].key
        for name in ("b.tif", "b.tif", "c.tif")
    ]
    assert keys[0] == keys[1] != keys[2]


@pytest.mark.parametrize("is_nested", [False, True])
def test_the_key_stands_for_what_a_virtual_input_is_made_of(
    folders: tuple[Path, Path], is_nested: bool
) -> None:
    source, path = folders[0] / "source.tif", folders[0] / "b.vrt"
    write_raster(source, np.ones((9, 9), np.uint8))
    rasterio.shutil.copy(source, path, driver="VRT")
    if is_nested:
        inner = path.rename(folders[0] / "inner.vrt")
        path.write_text(inner.read_text().replace(source.name, inner.name))
    row = {**ROW, "input": "b.vrt"}
    (before,) = calls_of(folders, row)
    assert calls_of(folders, row)[0].key == before.key
    write_raster(folders[0] / "source.tif", np.full((9, 9), 2, np.uint8))
    (after,) = calls_of(folders, row)
    assert after.key != before.key and not after.problem


def test_a_folder_is_listed_once_for_all_rows(
    folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    listed: list[Path] = []

    def names_in(folder: Path) -> dict[str, list[str]]:
        listed.append(folder)
        return input_files.names_in(folder)

    monkeypatch.setattr(calls, "names_in", names_in)
    found = calls_of(folders, *({**ROW, "output": f"{i}.tif"} for i in range(20)))
    assert len({call.key for call in found}) == 20
    assert listed == [folders[0]]


def write_beside(path: Path) -> None:
    """Write what GDAL takes for a part of `b.tif`."""
    if path.suffix.lower() in (".ovr", ".msk"):
        write_raster(path, np.ones((9, 9), np.uint8))
    elif path.suffix.lower() in (".rpb", ".txt"):
        write_rpc(path, camera_rpc())
    elif path.suffix == ".xml":
        path.write_text("<PAMDataset><Metadata><MDI key='a'>1</MDI></Metadata></PAMDataset>")
    elif path.suffix == ".tab":
        corners = [(0, 0), (9, 0), (0, 9)]
        lines = [f'({10 + x},{20 - y}) ({x},{y}) Label "p",' for x, y in corners]
        head = '!table\n!version 300\n\nDefinition Table\n  File "b.tif"\n  Type "RASTER"\n'
        lines[-1] = lines[-1].rstrip(",")
        path.write_text(head + "\n".join([*lines, "CoordSys Earth Projection 1, 104"]) + "\n")
    else:
        path.write_text("1\n0\n0\n-1\n10\n20\n")


def test_what_a_row_writes_beside_its_input_is_none_of_its_inputs(
    folders: tuple[Path, Path],
) -> None:
    (folders[0] / "gcps.csv").touch()
    refined = folders[0] / "b_RPC.TXT"
    row = {"image": "b.tif", "gcps": "gcps.csv", "output": str(refined)}
    (before,) = make_calls(load_tool("refine_rpc"), [row], *folders, 1)
    refined.touch()
    (after,) = make_calls(load_tool("refine_rpc"), [row], *folders, 1)
    assert before.problem == after.problem == ""
    assert after.key == before.key


def test_several_inputs_are_a_list_or_one_cell(folders: tuple[Path, Path]) -> None:
    series = load_tool("coregister_series")
    rows = [{"inputs": "a.tif;b.tif"}, {"inputs": ["a.tif", "b.tif"], "name": "again"}]
    first, second = make_calls(series, rows, *folders, 1)
    assert first.problem == second.problem == ""
    expected = (folders[0] / "a.tif", folders[0] / "b.tif")
    assert first.values["inputs"] == second.values["inputs"] == expected
    assert first.outputs == {"output_folder": folders[1] / "1"}
    assert second.outputs == {"output_folder": folders[1] / "again"}


def test_an_output_folder_that_none_can_be_costs_no_other_row(folders: tuple[Path, Path]) -> None:
    row = {"input": "a.tif"}
    rows = [{**row, "output": "\ud800/x.tif"}, {**row, "output": "y.tif"}]
    bad, good = make_calls(load_tool("filter_speckle"), rows, *folders, 1)
    assert "not UTF-8" in bad.problem and good.key and not good.problem


@pytest.mark.parametrize("href", ["a\\u0000b.tif", "\\ud800.tif"])
def test_an_item_of_a_file_that_none_can_be_costs_no_other_row(
    folders: tuple[Path, Path], href: str
) -> None:
    (folders[0] / "bad.json").write_text(
        f'{{"type": "Feature", "id": "a", "assets": {{"red": {{"href": "{href}"}}}}}}'
    )
    rows = [{"inputs": "bad.json"}, {"inputs": "a.tif"}]
    bad, good = make_calls(load_tool("coregister_series"), rows, *folders, 1)
    assert bad.row == 1 and good.key and not good.problem
