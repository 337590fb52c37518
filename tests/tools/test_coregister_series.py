"""Whole series against truth: what is registered, what is left out, and what lies in the folder."""

from __future__ import annotations

import csv
import json
import pickle
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fiona
import numpy as np
import pytest
import rasterio
import rasterio.shutil
from loopback_cluster import cluster
from raster_files import utm_grid, write_raster
from series_dates import Dates, write_dates
from textured_pairs import listing, pixels, texture

import groundtie
from groundtie.cli import main
from groundtie.errors import NotRegisteredError, SameFileError
from groundtie.geometry.transform import Transform
from groundtie.progress import Progress
from groundtie.runs import running
from groundtie.series.series import Series
from groundtie.stac_items import read_items
from groundtie.tools.coregister_series import coregister_series

ELSEWHERE, CLOUDY = 2, 3
GOOD = (0, 1, 4, 5)
SIZE = 160
OPTIONS: dict[str, Any] = {"search_radius": 120.0, "workers": 2}


@dataclass(frozen=True)
class Run:
    dates: Dates
    folder: Path
    report: Path
    result: Series


@pytest.fixture(scope="module")
def run(tmp_path_factory: Any) -> Run:
    """A series of six dates, of which two do not belong, with all outputs."""
    folder = tmp_path_factory.mktemp("series")
    dates = write_dates(folder / "dates", 6, SIZE, elsewhere=[ELSEWHERE], cloudy=[CLOUDY])
    out, report = folder / "out", folder / "report.html"
    result = coregister_series(
        out, [dates.folder], reference=dates.files[0], report=report, **OPTIONS
    )
    return Run(dates, out, report, result)


def error_px(transform: Transform, dates: Dates, date: int, reference: int) -> float:
    """Return by how much a transform misses the truth between two dates, in pixels."""
    grid = transform.input_grid
    px = np.array([[30.0, 30.0], [130.0, 50.0], [80.0, 120.0]])
    true = px + dates.displacement_px[date] - dates.displacement_px[reference]
    return float(np.hypot(*(transform(grid.pixel_to_map(px)) - true).T).max())


@pytest.mark.slow
def test_good_dates_are_registered_and_the_others_named(run: Run) -> None:
    names = run.dates.names
    assert [one.name for one in run.result.registered] == [names[date] for date in GOOD[1:]]
    left = {one.name: one.verdict.rule for one in run.result.left_out}
    assert left == dict.fromkeys((names[k] for k in (ELSEWHERE, CLOUDY)), "date not linked")
    transforms = run.result.transforms()
    for date in GOOD[1:]:
        assert error_px(transforms[names[date]], run.dates, date, 0) < 0.3


@pytest.mark.slow
def test_loops_close(run: Run) -> None:
    loops = run.result.loops()
    assert loops["count"] >= 2 and loops["closed"] == loops["count"]
    assert loops["largest_px"] < 0.3
    assert all(one.verdict.evidence.is_confirmed for one in run.result.registered)


@pytest.mark.slow
def test_all_files_and_no_others(run: Run) -> None:
    rasters = {f"{run.dates.names[date]}_registered.cog.tif" for date in GOOD[1:]}
    assert set(listing(run.folder)) == {*rasters, "series.csv", "series.gpkg", "series.json"}
    assert run.report.is_file() and run.report.with_suffix(".json").is_file()


@pytest.mark.slow
def test_the_folder_is_a_catalogue_of_cloud_optimized_files(run: Run) -> None:
    items, _ = read_items(run.folder / "series.json")
    names = [f"{run.dates.names[date]}_registered" for date in GOOD[1:]]
    assert [item.id for item in items] == names
    assert [item.time for item in items] == [
        f"2021-{date + 1:02d}-10T00:00:00Z" for date in GOOD[1:]
    ]
    for item in items:
        path = item.raster(None)
        assert path == run.folder / f"{item.id}.cog.tif"
        with rasterio.open(path) as raster:
            assert raster.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
            assert raster.transform == utm_grid(SIZE, SIZE).transform
    stored = json.loads((run.folder / "series.json").read_text())
    fields = [one["properties"] for one in stored["features"]]
    with rasterio.open(run.dates.files[0]) as reference:
        assert all(one["proj:shape"] == [*reference.shape] for one in fields)
        rows = {row["name"]: row for row in stored["dates"]}
        sigmas_m = [rows[run.dates.names[date]]["sigma_px"] * reference.res[0] for date in GOOD[1:]]
    found = [one["accuracy:geometric_rmse"] for one in fields]
    np.testing.assert_allclose(found, sigmas_m)


@pytest.mark.slow
def test_registered_dates_show_the_same_ground(run: Run) -> None:
    reference = pixels(run.dates.files[0])[0].astype(float)
    for date in GOOD[1:]:
        path = run.folder / f"{run.dates.names[date]}_registered.cog.tif"
        registered = pixels(path)[0].astype(float)
        both = (registered > 0)[20:-20, 20:-20]
        before = pixels(run.dates.files[date])[0].astype(float)
        after, nominal = (
            np.corrcoef(image[20:-20, 20:-20][both], reference[20:-20, 20:-20][both])[0, 1]
            for image in (registered, before)
        )
        assert after > 0.85 > nominal


@pytest.mark.slow
def test_the_tables_say_the_same(run: Run) -> None:
    with (run.folder / "series.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    stored = json.loads((run.folder / "series.json").read_text())
    with fiona.open(run.folder / "series.gpkg") as layer:
        features = list(layer)
    assert [row["name"] for row in rows] == run.dates.names
    assert rows[0]["state"] == "reference"
    for row, feature, values in zip(rows, features, stored["dates"], strict=True):
        assert row["state"] == feature["properties"]["state"] == values["state"]
        assert (feature["geometry"] is None) == (row["state"] == "left out")
    true = run.dates.displacement_px - run.dates.displacement_px[0]
    for date in GOOD[1:]:
        found = [float(rows[date][f"shift_{axis}_px"]) for axis in "xy"]
        np.testing.assert_allclose(found, true[date], atol=0.3)
        # Rows run downwards, the map's y upwards; pixels are of 10 m.
        metres = [float(rows[date][f"shift_{axis}_m"]) for axis in "xy"]
        np.testing.assert_allclose(metres, np.multiply(found, [10, -10]), atol=1e-6)
        transform = Transform.from_json(stored["dates"][date]["transform"])
        assert error_px(transform, run.dates, date, 0) < 0.3
    assert {one["first"] for one in stored["pairs"]} >= {run.dates.names[0]}


@pytest.mark.slow
def test_the_report_names_who_is_left_out_first(run: Run) -> None:
    page = run.report.read_text(encoding="utf-8")
    for date in (ELSEWHERE, CLOUDY):
        assert f"<b>{run.dates.names[date]}</b> is left out" in page
    table = page[page.index("Dates, the worst first") :]
    assert table.index(run.dates.names[CLOUDY]) < table.index(run.dates.names[1])
    numbers = json.loads(run.report.with_suffix(".json").read_text())
    assert numbers["verdict"] == {"accepted": True, "registered": 3, "left_out": 2}


@pytest.mark.slow
def test_a_further_date_is_registered_alone(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    shutil.copytree(run.folder, folder)
    before = listing(folder)
    more = write_dates(tmp_path / "more", 7, SIZE)
    result = coregister_series(
        folder, [run.dates.folder, more.files[6]], reference=run.dates.files[0], **OPTIONS
    )
    assert more.names[6] in {one.name for one in result.registered}
    assert 0 < result.registered_pairs <= 2 and result.reused_pairs > 5
    after = listing(folder)
    kept = [name for name in before if name.endswith(".tif")]
    assert {name: after[name] for name in kept} == {name: before[name] for name in kept}


@pytest.mark.slow
def test_the_same_call_does_nothing_again(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    shutil.copytree(run.folder, folder)
    with running("a batch's row") as call:
        result = coregister_series(
            folder, [run.dates.folder], reference=run.dates.files[0], **OPTIONS
        )
    assert result.registered_pairs == 0
    assert result.rows() == run.result.rows()
    # A batch resumes by these, whichever call wrote them.
    assert {path.name for path in call.files} == set(listing(folder))


@pytest.mark.slow
def test_without_a_reference_and_with_untouched_pixels(tmp_path: Path) -> None:
    dates = write_dates(tmp_path / "dates", 3, SIZE, seed=3)
    result = groundtie.register_series(
        tmp_path / "out", [dates.folder], output_grid="untouched", **OPTIONS
    )
    assert len(result.registered) == 3 and not result.left_out
    found = np.array([one.verdict.displacement for one in result.dates])[:, :2]
    np.testing.assert_allclose(found.mean(axis=0), 0.0, atol=1e-9)
    true = dates.displacement_px - dates.displacement_px.mean(axis=0)
    np.testing.assert_allclose(found, true, atol=0.3)
    for path, shift in zip(dates.files, true, strict=True):
        out = tmp_path / "out" / f"{path.stem}_registered.cog.tif"
        np.testing.assert_array_equal(pixels(out), pixels(path))
        with rasterio.open(out) as moved, rasterio.open(path) as before:
            assert moved.transform.c - before.transform.c == pytest.approx(-10 * shift[0], abs=3)
            assert moved.transform.f - before.transform.f == pytest.approx(10 * shift[1], abs=3)


@pytest.mark.slow
def test_radar_dates_are_registered_and_one_of_another_place_is_named(tmp_path: Path) -> None:
    dates = write_dates(tmp_path / "dates", 5, 220, elsewhere=[3], looks=1.0)
    found = coregister_series(tmp_path / "out", [dates.folder], reference=dates.files[0], **OPTIONS)
    names = dates.names
    assert all(one.date.is_radar for one in found.dates if one.date is not None)
    assert {one.name: one.verdict.rule for one in found.left_out} == {names[3]: "date not linked"}
    for date in (1, 2, 4):
        assert error_px(found.transforms()[names[date]], dates, date, 0) < 0.3
    loops = found.loops()
    assert loops["count"] >= 2 and loops["closed"] == loops["count"]


@pytest.mark.slow
def test_a_refused_series_leaves_its_report_and_exits_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dates = write_dates(tmp_path / "dates", 3, 130, elsewhere=[1, 2])
    report = tmp_path / "report.html"
    words = ["coregister-series", str(tmp_path / "out"), *map(str, dates.files[1:])]
    words += ["--reference", str(dates.files[0]), "--report", str(report)]
    assert main(words) == 3
    error = capsys.readouterr().err
    assert error.startswith("groundtie: error: none of 2 dates was registered")
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()
    assert set(listing(tmp_path)) >= {"report.html", "report.json"}
    assert "Refused" in report.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_damaged_file_costs_its_date_alone_and_its_raster(run: Run, tmp_path: Path) -> None:
    out, inputs = tmp_path / "out", tmp_path / "dates"
    shutil.copytree(run.folder, out)
    shutil.copytree(run.dates.folder, inputs)
    names, damaged = run.dates.names, GOOD[-1]
    assert (out / f"{names[damaged]}_registered.cog.tif").is_file()
    (inputs / run.dates.files[damaged].name).write_bytes(b"no raster")
    result = coregister_series(
        out,
        [path for k, path in enumerate(run.dates.files) if k != damaged]
        + [inputs / run.dates.files[damaged].name],
        reference=run.dates.files[0],
        **OPTIONS,
    )
    assert [one.name for one in result.registered] == [names[k] for k in GOOD[1:-1]]
    left = {one.name: one.verdict.rule for one in result.left_out}
    assert left[names[damaged]] == "date not readable"
    # It must not lie there as if it was registered.
    assert not (out / f"{names[damaged]}_registered.cog.tif").exists()


def test_cancelling_leaves_nothing(tmp_path: Path) -> None:
    dates = write_dates(tmp_path / "dates", 2, 64)
    with pytest.raises(groundtie.errors.CancelledError):
        coregister_series(
            tmp_path / "out", [dates.folder], progress=Progress(is_cancelled=lambda: True)
        )
    assert not (tmp_path / "out").exists()


def cancelled_after(pairs: int) -> Progress:
    """Return progress that is cancelled when one more registration begins."""
    begun = 0

    def report(fraction: float, message: str) -> None:
        nonlocal begun
        begun += message.startswith("registering")

    return Progress(report, is_cancelled=lambda: begun > pairs)


@pytest.mark.slow
def test_a_cancelled_series_goes_on_where_it_was(tmp_path: Path) -> None:
    dates = write_dates(tmp_path / "dates", 4, SIZE)
    options = {**OPTIONS, "reference": dates.files[0]}
    whole = coregister_series(tmp_path / "whole", [dates.folder], **options)
    out = tmp_path / "out"
    unfinished = out / "series.unfinished.jsonl"
    for pairs in (2, 1):
        with pytest.raises(groundtie.errors.CancelledError, match="goes on with what was"):
            coregister_series(out, [dates.folder], progress=cancelled_after(pairs), **options)
        assert [path.name for path in out.iterdir()] == [unfinished.name]
    with unfinished.open("a") as file:
        file.write('\n{"reference_key": "a line that was cut off')
    again = coregister_series(out, [dates.folder], **options)
    assert again.reused_pairs == 3
    assert again.registered_pairs == whole.registered_pairs - 3 > 0
    assert again.rows() == whole.rows()
    assert set(listing(out)) == set(listing(tmp_path / "whole"))
    for path in sorted(out.glob("*.tif")):
        np.testing.assert_array_equal(pixels(path), pixels(tmp_path / "whole" / path.name))


@pytest.mark.slow
def test_a_killed_series_goes_on_where_it_was(tmp_path: Path) -> None:
    dates = write_dates(tmp_path / "dates", 5, SIZE)
    out = tmp_path / "out"
    unfinished = out / "series.unfinished.jsonl"
    words = ["coregister-series", str(out), str(dates.folder), "--search-radius", "120"]
    words += ["--reference", str(dates.files[0]), "--workers", "2"]
    with subprocess.Popen([sys.executable, "-m", "groundtie", *words]) as process:
        while process.poll() is None:
            if unfinished.exists() and unfinished.stat().st_size:
                break
            time.sleep(0.01)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    again = coregister_series(out, [dates.folder], reference=dates.files[0], **OPTIONS)
    assert again.reused_pairs > 0 and len(again.registered) == 4
    assert not unfinished.exists()


@pytest.mark.slow
def test_a_refused_series_keeps_no_registrations(tmp_path: Path) -> None:
    dates = write_dates(tmp_path / "dates", 3, 130, elsewhere=[1, 2])
    for folder in ("new", "there"):
        out = tmp_path / folder
        if folder == "there":
            out.mkdir()
        with pytest.raises(NotRegisteredError):
            coregister_series(out, [dates.folder], reference=dates.files[0], **OPTIONS)
        assert out.exists() == (folder == "there")
        assert not out.exists() or not [*out.iterdir()]


@pytest.mark.slow
def test_a_date_beside_the_map_of_the_series_costs_no_other(tmp_path: Path) -> None:
    """It is reached by the date between; the reference's grid has no pixel of it."""
    ground, rng = 128 + 40 * texture(300, 840), np.random.default_rng(3)
    files = []
    for number, first in enumerate((0, 220, 440)):
        seen = ground[:, first : first + 400] + 2 * rng.normal(size=(300, 400))
        whole = utm_grid(840, 300)
        grid = whole.window(first + (0, 2, -1)[number], 0, 400, 300)
        files.append(write_raster(tmp_path / f"d{number}.tif", seen.astype(np.float32), grid))
    out = tmp_path / "out"
    series = coregister_series(out, files, reference=files[0], **OPTIONS)
    rows = {row["name"]: row for row in series.rows()}
    assert rows["d1"]["file"] and rows["d2"]["state"] == "registered"
    assert rows["d2"]["file"] is None and "no raster" in rows["d2"]["reason"]
    assert [path.name for path in out.glob("*.cog.tif")] == ["d1_registered.cog.tif"]


def test_the_output_folder_holds_nothing_that_a_virtual_date_is_made_of(tmp_path: Path) -> None:
    """A raster of the folder's own dates would be written over it, or it would be removed."""
    dates = write_dates(tmp_path / "dates", 2, 64)
    virtual = tmp_path / "virtual.vrt"
    rasterio.shutil.copy(dates.files[0], virtual, driver="VRT")
    other = dates.files[1].rename(tmp_path / "other.tif")
    with pytest.raises(SameFileError, match="the output folder holds an input"):
        coregister_series(dates.folder, [virtual, other], **OPTIONS)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["{out}", "{dates}/none.tif"], "there is no file"),
        (["{out}", "{one}"], "a series needs two dates at least"),
        (["{dates}", "{dates}"], "the output folder holds an input"),
        (["{out}", "{dates}", "--reference", "{dates}/none.tif"], "there is no file"),
        (["{out}", "{dates}", "--reference-mask", "{one}"], "needs a reference"),
        (["{out}", "{dates}", "--model", "affine", "--output-grid", "untouched"], "translation"),
        (["{out}", "{dates}", "--report", "{out}/series.html"], "--report would also write"),
        (["{out}", "{dates}", "--report", "{dates}/none/a.html"], "folder of"),
        (["{other}", "{dates}"], "is no series that can be continued"),
        (["{out}"], "Missing argument"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    dates = write_dates(tmp_path / "dates", 2, 64)
    other = tmp_path / "other"
    other.mkdir()
    (other / "series.json").write_text('{"format": "something"}')
    names = {
        "out": tmp_path / "out", "dates": dates.folder, "one": dates.files[0], "other": other
    }  # fmt: skip
    assert main(["coregister-series", *(word.format(**names) for word in words)]) == 2
    error = capsys.readouterr().err
    assert message in error and len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_dates_with_nothing_to_match_are_refused(tmp_path: Path) -> None:
    grid = utm_grid(100, 100)
    flat = [write_raster(tmp_path / f"{k}.tif", np.full((100, 100), 7 + k, np.uint8), grid)
            for k in range(2)]  # fmt: skip
    with pytest.raises(NotRegisteredError, match="none of"):
        coregister_series(tmp_path / "out", flat)


class Elsewhere(ThreadPoolExecutor):
    """Runs tasks as another machine would: by what can be sent there."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        sent = pickle.dumps(fn)
        # Names and numbers, no pixels.
        assert len(sent) < 20_000
        return super().submit(lambda: pickle.loads(pickle.dumps(pickle.loads(sent)())))


@pytest.mark.slow
def test_pairs_that_run_elsewhere_make_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dates = write_dates(tmp_path / "dates", 3, SIZE)
    monkeypatch.chdir(tmp_path)
    options = {**OPTIONS, "reference": dates.files[0]}
    here = coregister_series("here", ["dates"], **options)
    with Elsewhere(2) as executor:
        there = coregister_series("there", ["dates"], executor=executor, **options)
    assert len(here.registered) == 2 and there.registered_pairs == here.registered_pairs
    written = sorted((tmp_path / "here").glob("*.tif"))
    assert len(written) == 2
    for path in written:
        assert (tmp_path / "there" / path.name).read_bytes() == path.read_bytes()
    again = coregister_series("there", ["dates"], **options)
    assert (again.registered_pairs, again.reused_pairs) == (0, there.registered_pairs)


@pytest.mark.slow
def test_a_cluster_registers_the_same(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    dates = write_dates(tmp_path / "dates", 3, SIZE)
    coregister_series(tmp_path / "here", [dates.folder], **OPTIONS)
    with cluster() as workers:
        coregister_series(tmp_path / "there", [dates.folder], scheduler=workers.address, **OPTIONS)
    written = sorted((tmp_path / "here").glob("*.tif"))
    assert len(written) == 3
    for path in written:
        assert (tmp_path / "there" / path.name).read_bytes() == path.read_bytes()


@pytest.mark.slow
def test_another_band_is_registered_anew(tmp_path: Path) -> None:
    dates = write_dates(tmp_path / "dates", 2, SIZE)
    options = {**OPTIONS, "reference": dates.files[0]}
    coregister_series(tmp_path / "out", [dates.folder], **options)
    again = coregister_series(tmp_path / "out", [dates.folder], band=1, **options)
    assert (again.registered_pairs, again.reused_pairs) == (1, 0)


@pytest.mark.slow
def test_what_a_missions_mask_hides_takes_no_part(tmp_path: Path) -> None:
    """A deck that lies still over a third of all dates, and masks of it with larger pixels."""
    dates = write_dates(tmp_path / "dates", 3, SIZE)
    deck = np.random.default_rng(5).normal(3000, 300, (SIZE, SIZE // 3))
    scl = np.full((SIZE // 2, SIZE // 2), 4, np.uint8)
    scl[:, : SIZE // 6 + 1] = 9
    rows = ["file,mask,mask_values"]
    for path in dates.files:
        with rasterio.open(path, "r+") as raster:
            values = raster.read(1)
            values[:, : SIZE // 3] = deck
            raster.write(values, 1)
        mask = write_raster(path.with_suffix(".scl.tif"), scl, utm_grid(80, 80, 20.0))
        rows.append(f"{path.name},{mask.name},scl")
    table = dates.folder / "dates.csv"
    table.write_text("\n".join(rows))
    options = {**OPTIONS, "reference": dates.files[0]}
    found = coregister_series(tmp_path / "out", [table], **options)
    assert [one.name for one in found.registered] == dates.names[1:]
    transforms = found.transforms()
    for date in (1, 2):
        assert error_px(transforms[dates.names[date]], dates, date, 0) < 0.3
    assert "masks: of 3 dates, 0 of them found beside the image" in found.lines()
    stored = json.loads((tmp_path / "out" / "series.json").read_text())
    assert [one["mask"]["values"] for one in stored["dates"]] == ["scl"] * 3
    with ThreadPoolExecutor(1) as pool:
        elsewhere = coregister_series(tmp_path / "other", [table], executor=pool, **options)
    for name, one in elsewhere.transforms().items():
        assert one.to_json() == transforms[name].to_json()
