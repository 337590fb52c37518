"""The id of a call, the files that carry it, and the folders that it made."""

from __future__ import annotations

import json
import os
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster

from benchmarks.failures import run_of
from groundtie.declaration import tool_of
from groundtie.errors import OutputError
from groundtie.geometry.tie_point_files import read_tie_points, write_tie_points
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform, load_transform
from groundtie.rasters.atomic import Outputs, make_folder, write_json
from groundtie.rasters.delivery import warp_raster
from groundtie.rasters.reading import open_raster
from groundtie.runs import file_facts, file_state, run_of_call, run_tags, running
from groundtie.tools.coregister import coregister
from groundtie.tools.warp import warp

GRID = utm_grid(60, 50)


def id_of(tmp_path: Path, **changes: Any) -> str:
    """Return the id of a call of `warp`."""
    given = {
        "input": tmp_path / "a.tif",
        "output": tmp_path / "out.tif",
        "transform": tmp_path / "t.json",
        **changes,
    }
    declared = tool_of(warp)
    return declared.run_of_call(declared.check(given))


@pytest.fixture
def call(tmp_path: Path) -> Path:
    """Return a folder with what `warp` takes."""
    write_raster(tmp_path / "a.tif", np.arange(3000, dtype=np.uint16).reshape(50, 60), GRID)
    write_json(tmp_path / "t.json", Transform.nominal(GRID.crs, GRID).to_json())
    return tmp_path


def test_the_same_call_has_the_same_id(call: Path) -> None:
    assert id_of(call) == id_of(call, workers=3) == id_of(call, output=call / "other.tif")
    assert len(id_of(call)) == 16


def test_another_parameter_or_another_input_has_another_id(call: Path) -> None:
    first = id_of(call)
    assert id_of(call, resampling="nearest") != first
    os.utime(call / "a.tif", (1, 1))
    assert id_of(call) != first


@pytest.mark.parametrize("named", ["b.vrt", "vrt://a.tif?bands=1", "/vsizip/z.zip/a.tif"])
def test_another_state_of_a_file_behind_the_input_has_another_id(
    call: Path, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(call)
    source = call / ("z.zip" if "zip" in named else "a.tif")
    if named == "b.vrt":
        (call / named).write_text(
            "<VRTDataset><SourceFilename relativeToVRT='1'>a.tif</SourceFilename></VRTDataset>"
        )
    elif source.suffix == ".zip":
        with zipfile.ZipFile(source, "w") as archive:
            archive.write(call / "a.tif", "a.tif")
    given: Any = call / named if named == "b.vrt" else named
    first = id_of(call, input=given)
    assert id_of(call, input=given) == first
    os.utime(source, (1, 1))
    assert id_of(call, input=given) != first


def test_another_state_of_a_file_that_states_a_view_has_another_id(call: Path) -> None:
    view = call / "item.json"
    view.write_text("{}")
    declared = tool_of(coregister)
    checked = declared.check(
        {
            "reference": call / "a.tif",
            "input": call / "b.tif",
            "output": call / "out.tif",
            "views": f"camera azimuth=250 incidence=12; {view}",
        }
    )
    first = declared.run_of_call(checked)
    assert declared.run_of_call(checked) == first
    os.utime(view, (1, 1))
    assert declared.run_of_call(checked) != first


def test_with_an_array_each_call_has_an_id_of_its_own() -> None:
    given = {"input": np.zeros((4, 4)), "model": "affine"}
    assert run_of_call("warp", given) != run_of_call("warp", given)


def test_a_raster_of_a_tool_carries_its_calls_id_and_not_its_inputs(call: Path) -> None:
    warp(call / "a.tif", call / "out.tif", transform=call / "t.json")
    first = run_of(call / "out.tif")
    assert first == id_of(call)
    warp(call / "out.tif", call / "again.tif", transform=call / "t.json")
    assert run_of(call / "again.tif") not in (None, first)


@pytest.mark.parametrize("suffix", ["gpkg", "geojson", "csv"])
@pytest.mark.slow
def test_tie_points_carry_it_and_are_read_as_ever(tmp_path: Path, suffix: str) -> None:
    xy = GRID.pixel_to_map(np.array([[3.0, 4.0], [30.0, 40.0]]))
    nothing = TiePoints.none()
    points = replace(
        nothing,
        reference_xy=xy,
        input_px=GRID.map_to_pixel(xy),
        score=np.ones(2),
        covariance_px2=np.stack([np.eye(2)] * 2),
        forward_backward_error_px=np.zeros(2),
        is_check=np.zeros(2, bool),
        state=np.array(["used"] * 2),
        crs=GRID.crs,
    )
    transform = Transform.nominal(GRID.crs, GRID)
    path = tmp_path / f"p.{suffix}"
    write_tie_points(path, points, transform)
    assert run_of(path) is None
    with running("0123"):
        write_tie_points(path, points, transform)
    assert run_of(path) == "0123"
    np.testing.assert_allclose(read_tie_points(path, GRID).reference_xy, xy)


def test_a_transform_carries_it_and_is_read_as_ever(tmp_path: Path) -> None:
    with running("0123"):
        write_json(tmp_path / "t.json", Transform.nominal(GRID.crs, GRID).to_json())
    assert run_of(tmp_path / "t.json") == "0123"
    assert load_transform(tmp_path / "t.json").input_grid == GRID


def test_a_step_within_a_call_belongs_to_it() -> None:
    with running("outer"):
        with running("inner"):
            assert run_tags() == {"run": "outer"}
        assert run_tags("name") == {"name": "outer"}
    assert run_tags() == {}


def test_without_a_call_there_is_no_id(call: Path) -> None:
    with open_raster(call / "a.tif") as source, Outputs() as outputs:
        warp_raster(source, GRID.map_to_pixel, GRID, outputs.stage(call / "out.tif"))
    assert run_of(call / "out.tif") is None
    assert "run" not in json.loads((call / "t.json").read_text())
    with rasterio.open(call / "out.tif") as dataset:
        assert "GROUNDTIE_RUN" not in dataset.tags()


class TestFolders:
    def test_what_a_call_made_goes_if_nothing_came_into_it(self, tmp_path: Path) -> None:
        (tmp_path / "there").mkdir()
        with pytest.raises(OutputError), running("a"):
            for name in ("there", "there/new", "a/b", "filled/c"):
                make_folder(tmp_path / name)
            (tmp_path / "filled" / "file").touch()
            raise OutputError("no space")
        left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")}
        assert left == {"there", "filled", "filled/file"}

    def test_a_step_leaves_them_to_the_call_it_is_part_of(self, tmp_path: Path) -> None:
        with running("a"):
            with running("b"):
                make_folder(tmp_path / "new")
            assert (tmp_path / "new").is_dir()
        assert not (tmp_path / "new").exists()

    def test_outside_of_a_call_they_stay(self, tmp_path: Path) -> None:
        make_folder(tmp_path / "new")
        with running("a"):
            make_folder(tmp_path / "new")
        assert (tmp_path / "new").is_dir()

    def test_a_folder_that_cannot_be_made_leaves_none_above_it(self, tmp_path: Path) -> None:
        with pytest.raises(OutputError, match="too long"), running("a"):
            make_folder(tmp_path / "new" / ("n" * 300))
        assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("name", ["a\0b.tif", "\ud800.tif"])
def test_a_name_that_no_file_has_is_no_file(name: str) -> None:
    assert file_state(name) is None and file_facts(name) == (name,)
