"""Folders of series that are used again, where registrations are made up: no pixel is matched."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import UTM, write_raster
from rasterio.crs import CRS
from rasterio.windows import Window
from textured_pairs import texture

from groundtie.arrays import Raster
from groundtie.errors import NotRegisteredError, ParameterError, SameFileError
from groundtie.rasters.grid import Grid
from groundtie.series import registering
from groundtie.series.pairs import PairResult, PairTask, pair_key
from groundtie.tools.coregister_series import coregister_series

SIZE = 64
TABLES = {"series.csv", "series.gpkg", "series.json"}
PRECISE = tuple(tuple(1e-4 * (i == j) for j in range(6)) for i in range(6))


def register(task: PairTask, *_: Any) -> PairResult:
    """Accept a pair as it lies."""
    key = pair_key(task.first, task.second, task.settings, task.frame)
    names = task.first.name, task.second.name
    return PairResult(*names, key, True, "", "yes", 0.3, (0.0,) * 6, PRECISE)


@pytest.fixture(autouse=True)
def _made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registering, "register_pair", register)


def dates_at(folder: Path, crs: CRS, left: float, *names: str) -> Path:
    folder.mkdir(exist_ok=True)
    grid = Grid(Affine(10, 0, left, 0, -10, 5_000_000), crs, SIZE, SIZE)
    for name in names:
        write_raster(folder / f"{name}.tif", 100 + 10 * texture(SIZE, SIZE).astype("f4"), grid)
    return folder


def frame_of(folder: Path) -> Any:
    return json.loads((folder / "series.json").read_text())["frame"]


def test_another_series_in_a_folder_has_a_frame_of_its_own(tmp_path: Path) -> None:
    """Without a reference, a series is known by the place of its first date alone."""
    out = tmp_path / "out"
    there = dates_at(tmp_path / "there", CRS.from_epsg(32635), 300_000, "c", "d")
    coregister_series(out, [dates_at(tmp_path / "here", UTM, 500_000, "a", "b")])
    coregister_series(out, [there])
    coregister_series(tmp_path / "alone", [there])
    assert frame_of(out) == frame_of(tmp_path / "alone")
    assert CRS.from_wkt(frame_of(out)["crs"]) == CRS.from_epsg(32635)


def test_a_further_date_does_not_change_the_frame(tmp_path: Path) -> None:
    out, dates = tmp_path / "out", dates_at(tmp_path / "dates", UTM, 500_000, "a", "b", "c")
    coregister_series(out, [dates])
    before = frame_of(out)
    dates_at(dates, UTM, 500_100, "d", "e", "f")
    found = coregister_series(out, [dates])
    assert frame_of(out) == before and found.reused_pairs > 0


@pytest.mark.parametrize("is_linked", [False, True])
def test_no_series_is_written_beside_its_dates_or_links_to_them(
    tmp_path: Path, is_linked: bool
) -> None:
    """Of a folder of links, too: the next run would take what was written for dates."""
    dates = dates_at(tmp_path / "dates", UTM, 500_000, "a", "b")
    if is_linked:
        links = tmp_path / "links"
        links.mkdir()
        for path in dates.iterdir():
            (links / path.name).symlink_to(path)
        dates = links
    with pytest.raises(SameFileError, match="the output folder holds an input"):
        coregister_series(dates, [dates])
    assert sorted(path.name for path in dates.iterdir()) == ["a.tif", "b.tif"]


@pytest.mark.parametrize(("grid", "share"), [("reference", None), ("input", 0.5)])
def test_what_is_written_beyond_the_overlap_is_stated(
    tmp_path: Path, grid: str, share: float | None
) -> None:
    """The second date lies half a width farther to the east."""
    dates = dates_at(tmp_path / "dates", UTM, 500_000, "a")
    dates_at(dates, UTM, 500_000 + 5 * SIZE, "b")
    files = tmp_path / "out", [dates], dates / "a.tif", tmp_path / "r.html"
    found = coregister_series(*files[:2], reference=files[2], report=files[3], output_grid=grid)
    reference, registered = found.rows()
    assert reference["outside_of_overlap"] is None
    assert registered["outside_of_overlap"] == pytest.approx(share, abs=0.01)
    stated = [line for line in found.lines() if "outside of the overlap" in line]
    assert [("50%" in line, "(b)" in line) for line in stated] == [(True, True)] * bool(share)
    assert ("outside of the overlap" in files[3].read_text()) == bool(share)


def test_a_name_that_is_too_long_is_an_error_before_any_matching(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registering, "register_pair", None)
    long = "x" * 238
    dates, out = dates_at(tmp_path / "dates", UTM, 500_000, long, "y"), tmp_path / "out"
    with pytest.raises(ParameterError, match=r"name that is too long by 2 bytes.*: xxx") as error:
        coregister_series(out, [dates], reference=dates / "y.tif")
    assert "\n" not in str(error.value) and not out.exists()


def test_the_name_of_the_reference_may_be_long(tmp_path: Path) -> None:
    """It is not written."""
    long = "x" * 238
    dates = dates_at(tmp_path / "dates", UTM, 500_000, long, "x" * 236)
    coregister_series(tmp_path / "out", [dates], reference=dates / f"{long}.tif")
    assert (tmp_path / "out" / f"{'x' * 236}_registered.cog.tif").exists()


@pytest.mark.parametrize("kind", ["array", "raster", "dataset"])
@pytest.mark.parametrize("place", ["reference", "inputs"])
def test_what_has_no_file_is_one_line(tmp_path: Path, kind: str, place: str) -> None:
    dates = dates_at(tmp_path / "dates", UTM, 500_000, "a", "b")
    values = np.ones((SIZE, SIZE), np.float32)
    with rasterio.open(dates / "a.tif") as dataset:
        of_kind = {"array": values, "raster": Raster(values), "dataset": dataset}
        given: dict[str, Any] = {"inputs": [dates], place: of_kind[kind]}
        if place == "inputs" and kind != "raster":
            given["inputs"] = [given["inputs"]]
        with pytest.raises(ParameterError, match=rf"{place} must be (a path|paths), not") as error:
            coregister_series(tmp_path / "out", **given)
    assert "\n" not in str(error.value)


def refuse(task: PairTask, *_: Any) -> PairResult:
    """Refuse a pair."""
    key = pair_key(task.first, task.second, task.settings, task.frame)
    return PairResult(task.first.name, task.second.name, key, False, "a rule", "no")


def test_a_series_that_is_refused_leaves_nothing_of_an_earlier_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What lies there must not seem to be registered; what others put there stays."""
    out, dates = tmp_path / "out", dates_at(tmp_path / "dates", UTM, 500_000, "a", "b")
    coregister_series(out, [dates])
    names = {f"{name}_registered.cog.tif" for name in "ab"}
    assert {path.name for path in out.iterdir()} == {*names, *TABLES}
    (out / "notes.txt").write_text("mine")
    # Another program wrote it anew: it is no raster of this series any more.
    shutil.copy(dates / "a.tif", out / "a_registered.cog.tif")
    monkeypatch.setattr(registering, "register_pair", refuse)
    with pytest.raises(NotRegisteredError):
        coregister_series(out, [dates], max_error=1.0)
    assert {path.name for path in out.iterdir()} == {"notes.txt", "a_registered.cog.tif"}


def test_a_series_that_is_refused_leaves_the_files_of_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, dates = tmp_path / "out", dates_at(tmp_path / "dates", UTM, 500_000, "a", "b")
    out.mkdir()
    (out / "series.csv").write_text("mine")
    monkeypatch.setattr(registering, "register_pair", refuse)
    with pytest.raises(NotRegisteredError):
        coregister_series(out, [dates])
    assert [path.name for path in out.iterdir()] == ["series.csv"]


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def blacken(path: Path) -> None:
    """Set pixels to 0: the file's tags stay."""
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="YES") as dataset:
        dataset.write(np.zeros((1, 20, 20), dataset.dtypes[0]), window=Window(0, 0, 20, 20))


@pytest.mark.parametrize("damage", [truncate, blacken, Path.unlink])
def test_a_raster_that_was_changed_since_is_made_again(
    tmp_path: Path, damage: Callable[[Path], None]
) -> None:
    out, dates = tmp_path / "out", dates_at(tmp_path / "dates", UTM, 500_000, "a", "b")
    coregister_series(out, [dates])
    files = [out / f"{name}_registered.cog.tif" for name in "ab"]
    before = [file.read_bytes() for file in files]
    damage(files[0])
    untouched = files[1].stat().st_mtime_ns
    assert coregister_series(out, [dates]).registered_pairs == 0
    assert [file.read_bytes() for file in files] == before
    assert files[1].stat().st_mtime_ns == untouched
    times = [file.stat().st_mtime_ns for file in files]
    coregister_series(out, [dates])
    assert [file.stat().st_mtime_ns for file in files] == times
