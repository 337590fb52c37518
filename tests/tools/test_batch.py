"""`batch` on this machine and on a cluster of two workers: the same files, whoever dies."""

from __future__ import annotations

import csv
import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from assessed_files import written_files
from loopback_cluster import Cluster, cluster
from noise_pairs import write_pair
from raster_files import utm_grid, write_raster

import groundtie
from groundtie.cli import main
from groundtie.errors import ParameterError, SameFileError

# Of Debian 12's tornado, by Dask's own client.
pytestmark = pytest.mark.filterwarnings("ignore:make_current is deprecated:DeprecationWarning")

ROWS = 4


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with radar images and a table that has them filtered."""
    folder = tmp_path_factory.mktemp("batch")
    random = np.random.default_rng(3)
    for number in range(ROWS):
        power = random.exponential(size=(96, 96)).astype(np.float32)
        write_raster(folder / f"{number}.tif", np.sqrt(power), utm_grid(96, 96))
    lines = ["input,output,window", *[f"{n}.tif,{n}.tif,5" for n in range(ROWS)]]
    (folder / "t.csv").write_text("\n".join(lines))
    return folder


@pytest.fixture(scope="module")
def alone(images: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return what one process makes of them, each by a call of its own."""
    folder = tmp_path_factory.mktemp("alone")
    for number in range(ROWS):
        groundtie.filter_speckle(images / f"{number}.tif", folder / f"{number}.tif", window=5)
    return contents(folder)


@pytest.fixture(scope="module")
def two_workers() -> Iterator[Cluster]:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with cluster() as found:
        yield found


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.tif"))}


def run(images: Path, folder: Path, *options: str) -> int:
    words = ["batch", "filter-speckle", str(images / "t.csv"), "--output-folder", str(folder)]
    return main([*words, *options])


@pytest.mark.slow
def test_processes_make_the_same_bytes(
    images: Path, alone: dict[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(images, tmp_path, "--workers", "2") == 0
    assert contents(tmp_path) == alone
    assert capsys.readouterr().out.startswith("4 rows: 4 done, 0 refused, 0 failed\n")
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.tif")}
    assert run(images, tmp_path, "--resume", "--json") == 0
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.tif")} == before
    assert json.loads(capsys.readouterr().out)["resumed"] == ROWS


@pytest.mark.slow
def test_a_cluster_makes_the_same_bytes(
    images: Path, alone: dict[str, bytes], tmp_path: Path, two_workers: Cluster
) -> None:
    assert run(images, tmp_path, "--scheduler", two_workers.address) == 0
    assert contents(tmp_path) == alone


@pytest.mark.slow
def test_a_cluster_registers_as_one_process_does(tmp_path: Path, two_workers: Cluster) -> None:
    write_pair(tmp_path, 3)
    asked = {"search_radius": 8.0, "model": "translation"}
    row = {"reference": "reference.tif", "input": "input.tif", "transform": "{name}.json", **asked}
    (tmp_path / "t.json").write_text(json.dumps([{**row, "name": "a"}]))
    result = groundtie.batch(
        "coregister", tmp_path / "t.json", tmp_path / "out", scheduler=two_workers.address
    )
    assert result.exit_code == 0
    groundtie.coregister(
        tmp_path / "reference.tif",
        tmp_path / "input.tif",
        tmp_path / "one.tif",
        transform=tmp_path / "one.json",
        workers=1,
        **asked,
    )
    for ending in ("tif", "json"):
        expected = (tmp_path / f"one.{ending}").read_bytes()
        assert (tmp_path / f"out/a.{ending}").read_bytes() == expected


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_nothing(
    images: Path, alone: dict[str, bytes], tmp_path: Path
) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with cluster() as found:
        log = tmp_path / "t.csv.log.jsonl"

        def kill() -> None:
            while not log.exists():
                time.sleep(0.005)
            os.kill(found.workers[0], signal.SIGKILL)  # at the first rows

        killer = threading.Thread(target=kill)
        killer.start()
        assert run(images, tmp_path, "--scheduler", found.address) == 0
        killer.join()
    assert contents(tmp_path) == alone
    assert not [path for path in tmp_path.iterdir() if ".tif" in path.name and path.name[0] == "."]


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_one_line(
    images: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr("groundtie.executors._CONNECT_SECONDS", 0.5)
    assert run(images, tmp_path, "--scheduler", "tcp://127.0.0.1:9") == 2
    out, err = capsys.readouterr()
    assert (out, err) == (
        "",
        "groundtie: error: no Dask scheduler answers at tcp://127.0.0.1:9\n",
    )
    assert list(tmp_path.iterdir()) == []


def test_tables_that_differ_by_their_endings_have_results_of_their_own(
    images: Path, tmp_path: Path
) -> None:
    values = {"input": str(images / "0.tif"), "window": 5}
    (tmp_path / "b.csv").write_text(",".join(values) + "\n" + ",".join(map(str, values.values())))
    (tmp_path / "b.json").write_text(json.dumps([{**values, "output": "of_json.tif"}]))
    for resume in (False, True):
        for table, output in (("b.csv", "1.tif"), ("b.json", "of_json.tif")):
            with ThreadPoolExecutor(1) as executor:
                result = groundtie.batch(
                    "filter_speckle", tmp_path / table, resume=resume, executor=executor
                )
            assert [row.resumed for row in result.rows] == [resume]
            assert result.rows[0].outputs() == {"output": str(tmp_path / output)}
    for table, output in (("b.csv", "1.tif"), ("b.json", "of_json.tif")):
        written = json.loads((tmp_path / f"{table}.results.json").read_text())
        assert written["rows"][0]["outputs"] == {"output": str(tmp_path / output)}
        with (tmp_path / f"{table}.results.csv").open(newline="") as file:
            assert [row["output"] for row in csv.DictReader(file)] == [str(tmp_path / output)]


def resumed(table: Path) -> tuple[list[str], list[bool]]:
    """Resume a batch; return how its rows ended, and which of them did not run."""
    tool = "assess" if table.stem == "assess" else "simulate"
    with ThreadPoolExecutor(1) as executor:
        found = groundtie.batch(tool, table, resume=True, executor=executor)
    return [row.outcome.status for row in found.rows], [row.resumed for row in found.rows]


@pytest.mark.parametrize("gone", ["in/2.json", "in/2.html"])
@pytest.mark.slow
def test_a_report_without_its_numbers_is_written_again(tmp_path: Path, gone: str) -> None:
    files = written_files(tmp_path)
    table = files.path("assess.csv")
    rows = ["max_error", "5", "0.1"]  # of which the points are 0.5 px off
    columns = ["transform,check_points,report", *["t.json,check.csv,{name}.html"] * 2]
    lines = [",".join(cells) for cells in zip(columns, rows, strict=True)]
    table.write_text("\n".join(lines))
    assert resumed(table) == (["done", "refused"], [False, False])
    assert resumed(table) == (["done", "refused"], [True, True])
    (tmp_path / gone).unlink()
    assert resumed(table) == (["done", "refused"], [True, False])
    assert (tmp_path / gone).is_file()


@pytest.mark.slow
def test_a_folder_from_which_a_file_is_gone_is_written_again(tmp_path: Path) -> None:
    table = tmp_path / "pairs.csv"
    table.write_text("size,seed\n80,1\n80,2")
    assert resumed(table)[1] == [False, False]
    assert resumed(table)[1] == [True, True]
    (tmp_path / "2" / "dsm.tif").unlink()
    (tmp_path / "1" / "notes.txt").touch()  # which no row wrote
    assert resumed(table) == (["done", "done"], [True, False])
    assert (tmp_path / "2" / "dsm.tif").is_file()


def test_a_table_that_is_refused_leaves_no_folder(images: Path, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"input,output\n{images}/0.tif,a/x.tif\n{images}/1.tif,a/x.tif")
    with pytest.raises(SameFileError, match="both write"):
        groundtie.batch("filter_speckle", tmp_path / "t.csv", tmp_path / "new" / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


@pytest.mark.slow
def test_the_summary_lies_beside_the_table_by_default(images: Path, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("input\nnone.tif\n")
    assert main(["batch", "filter-speckle", str(tmp_path / "t.csv"), "--workers", "1"]) == 2
    with (tmp_path / "t.csv.results.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["status"] == "failed" and str(tmp_path / "none.tif") in row["message"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "t.csv",
        "t.csv.log.jsonl",
        "t.csv.results.csv",
        "t.csv.results.json",
    ]


def test_a_batch_runs_no_batch(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="tool must be one of"):
        groundtie.batch("batch", tmp_path / "t.csv")
