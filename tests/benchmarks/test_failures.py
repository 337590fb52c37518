"""A sample of `make failures`, and what it finds where files are written carelessly."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster

from benchmarks import failures
from benchmarks.failing import in_child
from benchmarks.failures import OLD, Findings, Job, steps_of
from groundtie.geometry.transform import Transform
from groundtie.rasters.atomic import Outputs, write_json
from groundtie.rasters.delivery import warp_raster
from groundtie.rasters.reading import open_raster

GRID = utm_grid(600, 520)


@pytest.fixture
def raster(tmp_path: Path) -> Path:
    noise = np.random.default_rng(0).integers(0, 60000, (520, 600)).astype(np.uint16)
    return write_raster(tmp_path / "a.tif", noise, GRID)


@pytest.fixture
def careful(raster: Path) -> Job:
    """Return a job that writes two files as the tools do."""

    def work(folder: Path) -> None:
        with Outputs() as outputs, open_raster(raster) as source:
            write_json(outputs.stage(folder / "t.json"), Transform.nominal(None, GRID).to_json())
            warp_raster(source, GRID.map_to_pixel, GRID, outputs.stage(folder / "out.tif"))

    return Job("careful", ("t.json", "out.tif"), work)


@pytest.fixture
def careless(raster: Path) -> Job:
    """Return a job that writes straight to its final names, and without an id."""

    def work(folder: Path) -> None:
        with open_raster(raster) as source:
            warp_raster(source, GRID.map_to_pixel, GRID, folder / "out.tif")
        (folder / "t.json").write_text("{}" + " " * 99)

    return Job("careless", ("t.json", "out.tif"), work)


def before(job: Job, tmp_path: Path) -> Path:
    folder = tmp_path / "before"
    folder.mkdir()
    job.as_run(folder, OLD)
    return folder


@pytest.mark.slow
def test_a_sample(careful: Job, tmp_path: Path) -> None:
    old, work, found = before(careful, tmp_path), tmp_path / "work", Findings()
    count = steps_of(careful, tmp_path / "before")
    assert count > 10
    for step in range(2, count + 1, 4):
        failures.kill(careful, old, step, found, work)
    for percent in (0, 40, 99):
        failures.limit(careful, old, percent, found, work)
    assert found.wrong == []
    assert sum(found.tried.values()) > 5


@pytest.mark.slow
def test_a_sample_on_full_disks(careful: Job, tmp_path: Path) -> None:
    old, found = before(careful, tmp_path), Findings()
    try:
        for percent in (1, 50, 110):
            failures.fill(careful, old, percent, found, tmp_path / "work")
        failures.lock(careful, old, found, tmp_path / "work")
    except PermissionError as error:
        pytest.skip(f"NOT TESTED on full and read-only disks: {error}")
    assert found.wrong == []


@pytest.mark.slow
def test_careless_jobs_are_found(careless: Job, tmp_path: Path) -> None:
    old, work, found = before(careless, tmp_path), tmp_path / "work", Findings()
    failures.kill(careless, old, 2, found, work)
    failures.kill(careless, old, 5, found, work)
    failures.limit(careless, old, 30, found, work)
    text = "\n".join(found.wrong)
    assert "out.tif is not whole" in text
    assert "a mixed set" in text
    assert "the old files changed" in text


def test_how_a_child_ends() -> None:
    assert in_child(lambda: None).how == "done"
    bug = in_child(partial(int, "x"))
    assert bug.how == "bug"
    assert "ValueError" in bug.text

    def crash() -> None:
        import ctypes

        ctypes.string_at(0)

    assert in_child(crash).how == "crash"
