"""Whole registrations, against truth; what cannot be registered is refused or an error."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import fiona
import numpy as np
import pytest
import rasterio
from brightness_classifiers import bright_is_left_out
from raster_files import UTM, utm_grid, write_raster
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from textured_pairs import (
    TexturedPair,
    error_px,
    everywhere,
    listing,
    pixels,
    rewritten,
    rms,
    shift_on_map,
    write_textured_pair,
)

from groundtie import load_transform
from groundtie.cli import main
from groundtie.errors import NotRegisteredError
from groundtie.geometry.tie_points import USED
from groundtie.geometry.transform import Transform
from groundtie.progress import Progress
from groundtie.rasters.grid import Grid, reproject
from groundtie.registration.registration import Registration
from groundtie.tools.coregister import coregister

SIZE = (240, 220)


# --- each kind of misregistration, grid and file of tie points -------------------------------


@dataclass(frozen=True)
class Run:
    folder: Path
    result: Registration
    error_px: float

    @property
    def output(self) -> Path:
        return self.folder / "out.tif"


OUTPUT_GRIDS = {
    "shift": "untouched",
    "rotation": "reference",
    "scale": "input",
    "affine": "reference",
    "polynomial": "input",
}
TIE_POINTS = {
    "shift": "points.gpkg",
    "rotation": "points.geojson",
    "scale": "points.csv",
    "affine": "points.points",
    "polynomial": "points.gpkg",
}


@pytest.fixture(scope="module")
def run(simulated: Callable[[str], Any], tmp_path_factory: Any) -> Callable[[str], Run]:
    """Return the function that registers a simulated pair, once, with all outputs."""

    @cache
    def registered(kind: str) -> Run:
        pair, folder = simulated(kind), tmp_path_factory.mktemp(f"out-{kind}")
        result = coregister(
            pair.reference,
            pair.input,
            folder / "out.tif",
            search_radius=30.0,
            output_grid=OUTPUT_GRIDS[kind],
            tie_points=folder / TIE_POINTS[kind],
            transform=folder / "transform.json",
            report=folder / "report.html",
            workers=2,
        )
        return Run(folder, result, pair.error_px(result.transform))

    return registered


KINDS = tuple(OUTPUT_GRIDS)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_distortion_is_recovered(kind: str, run: Callable[[str], Run]) -> None:
    assert run(kind).result.verdict.accepted
    assert run(kind).error_px <= 1.0
    # What the verdict says is no better than the truth, which layover does not blur.
    assert run(kind).result.verdict.check_rmse_px > 0.5 * run(kind).error_px


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_all_files_appear_and_no_other(kind: str, run: Callable[[str], Run]) -> None:
    names = {"out.tif", TIE_POINTS[kind], "transform.json", "report.html", "report.json"}
    assert set(listing(run(kind).folder)) == names
    files = run(kind).result.files
    assert files["output"] == run(kind).output
    assert {path.name for path in files.values()} == names - {"report.json"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_stored_transform_is_that_of_the_result(kind: str, run: Callable[[str], Run]) -> None:
    stored = load_transform(run(kind).folder / "transform.json")
    xy = run(kind).result.tie_points.reference_xy
    np.testing.assert_array_equal(stored(xy), run(kind).result.transform(xy))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_numbers_beside_the_report_are_those_of_the_result(
    kind: str, run: Callable[[str], Run]
) -> None:
    numbers = json.loads((run(kind).folder / "report.json").read_text())
    assert numbers["verdict"] == run(kind).result.verdict.summary()
    summary = run(kind).result.summary()
    assert json.loads(json.dumps(summary, allow_nan=False))["verdict"] == numbers["verdict"]
    assert numbers["parameters"]["search_radius"] == 30.0
    lines = "\n".join(run(kind).result.lines())
    assert f"RMSE {run(kind).result.verdict.check_rmse_px:.2f} px" in lines
    assert str(run(kind).output) in lines


@pytest.mark.slow
def test_fields_are_left_without_a_mask(run: Callable[[str], Run]) -> None:
    mask = run("shift").result.mask
    assert mask.kind == "none" and "too few for a town" in mask.reason


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["shift", "rotation", "polynomial"])
def test_tie_points_lie_where_the_transform_says(kind: str, run: Callable[[str], Run]) -> None:
    points, verdict = run(kind).result.tie_points, run(kind).result.verdict
    right = points.take(points.used & ~points.is_check)
    assert np.median(np.hypot(*right.residual_px(run(kind).result.transform).T)) < 1.5
    assert verdict.fit_points == (~points.is_check).sum()
    assert verdict.fit_points_used == ((points.state == USED) & ~points.is_check).sum()
    assert verdict.check_points == points.is_check.sum()
    with fiona.open(run(kind).folder / TIE_POINTS[kind]) as layer:
        assert len(layer) == len(points)


@pytest.mark.slow
def test_untouched_pixels_get_a_shifted_geotransform(
    run: Callable[[str], Run], simulated: Callable[[str], Any]
) -> None:
    done, pair = run("shift"), simulated("shift")
    np.testing.assert_array_equal(pixels(done.output), pixels(pair.input))
    truth = load_transform(pair.folder / "truth.json")
    with rasterio.open(done.output) as out, rasterio.open(pair.input) as before:
        assert out.crs == before.crs
        for name in "abde":
            assert getattr(out.transform, name) == getattr(before.transform, name)
        corner = truth.inverse([[0.0, 0.0]])[0]
        assert np.hypot(*(np.array(out.xy(0, 0)) - corner)) < 0.7


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rotation", "affine"])
def test_the_reference_grid_is_the_references(
    kind: str, run: Callable[[str], Run], simulated: Callable[[str], Any]
) -> None:
    with rasterio.open(run(kind).output) as out, rasterio.open(simulated(kind).reference) as ref:
        assert (out.transform, out.crs, out.shape) == (ref.transform, ref.crs, ref.shape)
        with rasterio.open(simulated(kind).input) as before:
            assert (out.count, out.dtypes) == (before.count, before.dtypes)
            assert out.descriptions == before.descriptions


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["scale", "polynomial"])
def test_the_input_grid_has_the_inputs_pixels(
    kind: str, run: Callable[[str], Run], simulated: Callable[[str], Any]
) -> None:
    with rasterio.open(run(kind).output) as out, rasterio.open(simulated(kind).input) as before:
        assert out.res == pytest.approx(before.res)
        assert out.crs == before.crs
        # All that the input shows is there, and no more than the pixels that it reaches.
        transform = run(kind).result.transform
        xy = transform.inverse(transform.input_grid.outline(200))
        left, bottom, right, top = out.bounds
        low, high = np.array([left, bottom]), np.array([right, top])
        assert (np.abs(xy.min(axis=0) - low) <= 1).all()
        assert (np.abs(xy.max(axis=0) - high) <= 1).all()


# --- kinds of images -------------------------------------------------------------------------


def registered(pair: TexturedPair, folder: Path, **more: Any) -> Registration:
    return coregister(pair.reference, pair.input, folder / "out.tif", **{"workers": 2} | more)


@pytest.fixture(scope="module")
def stacked(textured: TexturedPair, tmp_path_factory: pytest.TempPathFactory) -> Registration:
    """Return the registration of the small pair as it is."""
    return registered(textured, tmp_path_factory.mktemp("stacked"))


@pytest.mark.slow
def test_the_registered_image_stacks_on_the_reference(
    textured: TexturedPair, stacked: Registration
) -> None:
    """Phase correlation of registered input and reference, neither of which saw the other's."""
    inner = (slice(20, -20), slice(20, -20))
    here = 2000.0 - pixels(Path(stacked.files["output"]))[0][inner]
    there = pixels(textured.reference)[0][inner].astype(float)
    assert np.corrcoef(here.ravel(), there.ravel())[0, 1] > 0.85
    (dx, dy), _ = cv2.phaseCorrelate(
        here, there, cv2.createHanningWindow(here.shape[::-1], cv2.CV_64F)
    )
    assert np.hypot(dx, dy) < 0.1


@pytest.mark.slow
def test_any_number_of_threads_gives_the_same_result(
    textured: TexturedPair, stacked: Registration, tmp_path: Path
) -> None:
    alone = registered(textured, tmp_path, workers=1)
    assert alone.transform.to_json() == stacked.transform.to_json()
    np.testing.assert_array_equal(alone.tie_points.input_px, stacked.tie_points.input_px)


def grid_elsewhere(crs: CRS) -> Grid:
    """Return a grid in another CRS that covers the textured pair with a margin of 5 pixels."""
    near = utm_grid(*SIZE)
    outline = reproject(near.pixel_to_map(near.outline()), UTM, crs)
    size = 10.0 if crs.is_projected else 10.0 / 111_195
    low, high = outline.min(axis=0) - 5 * size, outline.max(axis=0) + 5 * size
    width, height = np.ceil((high - low) / size).astype(int)
    return Grid(rasterio.Affine(size, 0, low[0], 0, -size, high[1]), crs, int(width), int(height))


@pytest.mark.slow
@pytest.mark.parametrize(("epsg", "output_grid"), [(4326, "input"), (32633, "reference")])
def test_an_input_in_another_crs(tmp_path: Path, epsg: int, output_grid: str) -> None:
    grid = grid_elsewhere(CRS.from_epsg(epsg))
    pair = write_textured_pair(tmp_path, SIZE, shift_on_map(40, 50), input_grid=grid)
    result = registered(pair, tmp_path, output_grid=output_grid)
    assert error_px(result.transform, pair) < 0.3
    with rasterio.open(tmp_path / "out.tif") as out:
        assert out.crs == (grid.crs if output_grid == "input" else UTM)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [2.0, 0.5])
def test_an_input_of_another_pixel_size(tmp_path: Path, ratio: float) -> None:
    size = (380, 360) if ratio > 1 else SIZE
    pair = write_textured_pair(tmp_path, size, shift_on_map(60, 30), input_pixel_ratio=ratio)
    result = registered(pair, tmp_path)
    assert error_px(result.transform, pair) * ratio < 0.5  # in reference pixels


@pytest.mark.slow
def test_images_without_georeferencing(textured: TexturedPair, tmp_path: Path) -> None:
    def bare(values: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
        return values, {"grid": None}

    pair = rewritten(textured, tmp_path, reference=bare, input=bare)
    result = registered(pair, tmp_path)
    xy = everywhere(textured.grid)
    px = textured.grid.map_to_pixel(xy)
    assert rms(result.transform(px) - textured.truth(xy)) < 0.3
    assert result.transform.crs is None


def decibels(values: np.ndarray) -> np.ndarray:
    db = 20 * np.log10(values.astype(np.float32)) - 70
    db[30:70, 40:90] = np.nan
    db[150, 150] = -np.inf
    return db


def speckled(values: np.ndarray) -> np.ndarray:
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, values.shape)
    return (values * np.exp(1j * phase)).astype(np.complex64)


def transparent(values: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
    alpha = np.full_like(values, 65_535)
    alpha[:, :60] = 0
    interpretation = [ColorInterp.gray, ColorInterp.alpha]
    return np.stack([np.where(alpha, values, 9), alpha]), {"colorinterp": interpretation}


def with_nodata(values: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
    values = values.copy()
    values[:70] = 0
    return values, {"nodata": 0}


def as_bytes(values: np.ndarray) -> np.ndarray:
    return np.clip(values / 12, 1, 255).astype(np.uint8)


VARIANTS: dict[str, dict[str, Any]] = {
    "decibels with NaN": {"reference": decibels},
    "complex": {"reference": speckled},
    "alpha": {"input": transparent},
    "nodata": {"input": with_nodata, "reference": as_bytes},
    "signed, negative": {"input": lambda v: (v.astype(np.int32) - 2000).astype(np.int16)},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", VARIANTS)
def test_kinds_of_pixels(textured: TexturedPair, tmp_path: Path, name: str) -> None:
    pair = rewritten(textured, tmp_path, **VARIANTS[name])
    said: list[str] = []
    progress = Progress(lambda fraction, message: said.append(message))
    result = registered(pair, tmp_path, progress=progress)
    assert error_px(result.transform, textured) < 0.3
    amplitude = [message for message in said if "amplitude" in message]
    assert len(amplitude) == (name == "complex")
    with rasterio.open(pair.input) as before, rasterio.open(tmp_path / "out.tif") as out:
        assert (out.count, out.dtypes, out.nodata) == (before.count, before.dtypes, before.nodata)
        assert out.colorinterp == before.colorinterp


@pytest.mark.slow
def test_bands_and_masks_say_what_takes_part(textured: TexturedPair, tmp_path: Path) -> None:
    """The second band is right; a part of it shows something else and is masked out."""
    rng = np.random.default_rng(0)

    def banded(values: np.ndarray) -> np.ndarray:
        wrong = rng.integers(1, 3000, values.shape).astype(np.uint16)
        spoiled = values.copy()
        spoiled[:, :80] = np.roll(values, 6, axis=1)[:, :80]
        return np.stack([wrong, spoiled])

    pair = rewritten(textured, tmp_path, input=banded)
    mask = np.ones(SIZE[::-1], np.uint8)
    mask[:, :80] = 0
    masked = write_raster(tmp_path / "mask.tif", mask, textured.grid)
    result = registered(pair, tmp_path, input_band=2, input_mask=masked, model="affine")
    assert error_px(result.transform, textured) < 0.3
    assert pixels(tmp_path / "out.tif").shape == (2, *SIZE[::-1])


@pytest.mark.slow
def test_what_a_classifier_leaves_out_takes_no_part(textured: TexturedPair, tmp_path: Path) -> None:
    """A part of the input shows something else, and is brighter."""

    def clouded(values: np.ndarray) -> np.ndarray:
        shown = values.copy()
        shown[:, :80] = 3000 + np.roll(values, 6, axis=1)[:, :80]
        return shown

    pair = rewritten(textured, tmp_path, input=clouded)
    classifier = bright_is_left_out(tmp_path / "c.json", 3300)
    result = registered(pair, tmp_path, input_mask=classifier, model="affine")
    assert error_px(result.transform, textured) < 0.3
    # A third of a chip's pixels may lie where nothing takes part.
    assert result.tie_points.input_px[result.tie_points.used][:, 0].min() > 60


@pytest.mark.slow
@pytest.mark.parametrize("model", ["rigid", "tps"])
def test_a_model_that_is_asked_for_is_taken(
    textured: TexturedPair, tmp_path: Path, model: str
) -> None:
    result = registered(textured, tmp_path, model=model)
    assert result.transform.model.kind == model
    assert error_px(result.transform, textured) < 0.5


@pytest.mark.slow
def test_a_copy_is_registered_to_itself_by_nothing(textured: TexturedPair, tmp_path: Path) -> None:
    copy = write_raster(tmp_path / "copy.tif", pixels(textured.reference), textured.grid)
    result = registered(replace(textured, input=copy), tmp_path)
    xy = everywhere(textured.grid)
    assert rms(result.transform(xy) - textured.grid.map_to_pixel(xy)) < 0.05


@pytest.mark.slow
def test_an_accepted_registration_on_the_command_line(
    textured: TexturedPair, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    args = [
        "coregister",
        str(textured.reference),
        str(textured.input),
        str(tmp_path / "out.tif"),
        "--json",
        "--workers",
        "2",
    ]
    assert main(args) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    summary = json.loads(printed.out)
    assert summary["verdict"]["accepted"] is True
    assert summary["files"] == {"output": str(tmp_path / "out.tif")}
    assert error_px(Transform.from_json(summary["transform"]), textured) < 0.3


# --- real images -----------------------------------------------------------------------------


def real_pair(
    data: Path, case: str, folder: Path, shift_m: tuple[float, float]
) -> tuple[Path, Path]:
    """Write a real pair with pixels of 10 m and an input that claims to lie elsewhere."""
    cases = {entry["id"]: entry for entry in json.loads((data / "cases.json").read_text())}
    paths = []
    for name, shift in (("reference", (0.0, 0.0)), ("input", shift_m)):
        values = pixels(data / cases[case][name])
        grid = utm_grid(*values.shape[:0:-1]).shifted(*shift)
        paths.append(write_raster(folder / f"{case}-{name}.tif", values, grid))
    return paths[0], paths[1]


def truth_of(data: Path, case: str) -> tuple[np.ndarray, float]:
    cases = {entry["id"]: entry for entry in json.loads((data / "cases.json").read_text())}
    truth = cases[case]["truth"]
    return np.array(truth["reference_to_input"]), truth["sigma_px"]


@pytest.mark.slow
@pytest.mark.parametrize("case", ["so-fields", "so-sentinel", "so-rosenheim"])
def test_real_images(real_data: Path, tmp_path: Path, case: str) -> None:
    reference, input = real_pair(real_data, case, tmp_path, (120.0, -80.0))
    result = coregister(reference, input, tmp_path / "out.tif", search_radius=250.0, workers=2)
    with rasterio.open(reference) as raster:
        grid = utm_grid(raster.width, raster.height)
    xy = everywhere(grid)
    matrix, sigma_px = truth_of(real_data, case)
    truth = np.column_stack([grid.map_to_pixel(xy), np.ones(len(xy))]) @ matrix.T
    assert rms(result.transform(xy) - truth) <= sigma_px + 1


@pytest.mark.slow
def test_real_images_of_two_places_are_refused(real_data: Path, tmp_path: Path) -> None:
    reference, _ = real_pair(real_data, "so-fields", tmp_path, (0.0, 0.0))
    _, input = real_pair(real_data, "so-rosenheim", tmp_path, (0.0, 0.0))
    before = listing(tmp_path)
    with pytest.raises(NotRegisteredError):
        coregister(reference, input, tmp_path / "out.tif", workers=2)
    assert listing(tmp_path) == before


@pytest.mark.parametrize(("dates", "band"), [(("1985", "1990"), 4), (("2015", "2020"), 1)])
@pytest.mark.slow
def test_dates_of_one_camera_on_one_grid_are_registered(
    real_data: Path, dates: tuple[str, str], band: int
) -> None:
    """Most products lie on one grid, on whole pixels as what is drawn does."""
    reference, input = (real_data / f"series/river/{date}.tif" for date in dates)
    found = coregister(reference, input, reference_band=band, input_band=band)
    assert found.verdict.accepted and found.transform is not None
    grid = found.transform.input_grid
    assert grid is not None
    px = np.array([[50.0, 50.0], [400.0, 300.0]])
    np.testing.assert_allclose(found.transform(grid.pixel_to_map(px)), px, atol=1.0)
