from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from brightness_classifiers import bright_is_left_out
from canopies import forest_files
from raster_files import utm_grid, write_raster
from speckled_pairs import write_speckled_pair
from textured_pairs import TexturedPair, error_px, listing, pixels, shift_on_map

from groundtie import coregister, match_sar_sar
from groundtie.errors import NotRegisteredError
from groundtie.geometry.tie_point_files import read_tie_points
from groundtie.geometry.transform import load_transform
from groundtie.masks.used import OPEN
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.registration import pipeline
from groundtie.registration.registration import Registration
from groundtie.registration.rules import scene as scene_rules

SIZE = (300, 280)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    folder = tmp_path_factory.mktemp("speckled")
    return write_speckled_pair(folder, SIZE, shift_on_map(70.0, -45.0))


@pytest.fixture(scope="module")
def registration(
    files: TexturedPair, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Registration, Path]:
    """Return the pair's registration, and the folder of all its files."""
    folder = tmp_path_factory.mktemp("registered")
    found = match_sar_sar(
        files.reference,
        files.input,
        folder / "out.tif",
        tie_points=folder / "points.gpkg",
        transform=folder / "transform.json",
        report=folder / "report.html",
    )
    return found, folder


@pytest.mark.slow
def test_a_pair_is_registered_with_all_its_files(
    files: TexturedPair, registration: tuple[Registration, Path]
) -> None:
    found, folder = registration
    assert error_px(found.transform, files) < 0.4
    assert error_px(load_transform(folder / "transform.json"), files) < 0.4
    assert found.verdict.accepted
    report = json.loads((folder / "report.json").read_text())
    assert report["verdict"]["accepted"] is True
    assert "<html" in (folder / "report.html").read_text().lower()
    table = read_tie_points(folder / "points.gpkg", found.transform.input_grid)
    assert len(table.reference_xy) == len(found.tie_points)
    reference, registered = (
        np.log(pixels(path)[0][40:-40, 40:-40] + 1.0)
        for path in (files.reference, folder / "out.tif")
    )
    assert np.corrcoef(reference.ravel(), registered.ravel())[0, 1] > 0.5


@pytest.mark.slow
def test_results_state_notes_on_the_matching(registration: tuple[Registration, Path]) -> None:
    found, note = registration[0], "chips alone"
    assert found.evidence is not None
    assert note not in "\n".join(found.lines())
    estimate = replace(found.evidence.estimate, notes=(note,))
    noted = replace(found, evidence=replace(found.evidence, estimate=estimate))
    assert note in noted.lines()
    assert noted.summary()["notes"][-1] == note


@pytest.mark.slow
@pytest.mark.parametrize("image", ["reference", "input"])
def test_keypoints_that_a_classifier_leaves_out_take_no_part(
    files: TexturedPair, tmp_path: Path, image: str
) -> None:
    """The right half of an image is made brighter than the left one anywhere is."""
    paths = {"reference": files.reference, "input": files.input}
    values = pixels(paths[image])[0].astype(float)
    smooth = values[:, 150:].mean()
    values[:, 150:] += 4 * smooth
    grid = files.grid if image == "reference" else files.truth.input_grid
    paths[image] = write_raster(tmp_path / "bright.tif", values.astype(np.uint16), grid)
    classifier = bright_is_left_out(tmp_path / "c.json", 2.5 * smooth)
    found = match_sar_sar(
        *paths.values(),
        tmp_path / "out.tif",
        **{f"{image}_mask": classifier},
    )
    fit = found.tie_points.take(~found.tie_points.is_check)
    columns = {
        "reference": files.grid.map_to_pixel(fit.reference_xy)[:, 0],
        "input": fit.input_px[:, 0],
    }[image]
    assert len(columns) > 10
    # Chips may lie across the border, of which half their side of 81 px is beyond it at most.
    assert columns.max() < 150 + 41
    assert error_px(found.transform, files) < 1.0


@pytest.mark.slow
def test_check_points_lie_where_no_keypoint_was_seen(
    files: TexturedPair, registration: tuple[Registration, Path]
) -> None:
    points = registration[0].tie_points
    fit, check = (
        files.grid.map_to_pixel(points.reference_xy[points.is_check == c]) for c in (0, 1)
    )
    apart = np.linalg.norm(fit[:, None] - check[None], axis=2)
    assert len(check) >= 4
    assert apart.min() > 15


def test_another_place_is_refused_and_leaves_its_report_only(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    other = write_speckled_pair(tmp_path / "in", SIZE, shift_on_map(0, 0), input_seed=77)
    with pytest.raises(NotRegisteredError):
        match_sar_sar(
            other.reference, other.input, tmp_path / "o.tif", report=tmp_path / "report.html"
        )
    assert set(listing(tmp_path)) >= {"report.html", "report.json"}
    assert not (tmp_path / "o.tif").exists()


@pytest.mark.slow
def test_ground_between_forests_is_matched_where_the_whole_is_refused(tmp_path: Path) -> None:
    found = match_sar_sar(*forest_files(tmp_path, 0.3, 1), tmp_path / "out.tif")
    assert (found.mask.kind, found.mask.image, found.spec.tries) == (OPEN, "reference", 2)
    grid = utm_grid(420, 420, 1.0)
    px = grid.places()
    error = np.hypot(*(found.transform(grid.pixel_to_map(px)) - px).T)
    assert np.sqrt(np.mean(error**2)) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_canopies_are_no_evidence_against_the_ground(tmp_path: Path, seed: int) -> None:
    """Three quarters are forest, which agrees with itself."""
    with pytest.raises(
        NotRegisteredError, match="the ground between forests and settlements"
    ) as error:
        match_sar_sar(*forest_files(tmp_path, 0.75, seed), tmp_path / "out.tif")
    assert error.value.verdict is not None
    assert error.value.verdict.rule == "ground elsewhere"
    assert not (tmp_path / "out.tif").exists()


@pytest.mark.slow
def test_an_image_that_may_show_a_town_to_a_camera_is_in_doubt(
    files: TexturedPair, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without its speckle, the input may be a camera's."""
    bright = cv2.blur(pixels(files.input)[0], (7, 7))
    bright[::8] *= 6
    calm = write_raster(tmp_path / "in.tif", bright, files.truth.input_grid)
    found = match_sar_sar(files.reference, calm, tmp_path / "out.tif")
    assert error_px(found.transform, files) < 1.0
    monkeypatch.setattr(scene_rules, "_CLEAR_SHARE", 1.1)
    monkeypatch.setattr(pipeline, "ground_instead", lambda *_: None)
    with pytest.raises(NotRegisteredError, match="as roofs may"):
        match_sar_sar(files.reference, calm, tmp_path / "other.tif")
    # Two radar images are not.
    match_sar_sar(files.reference, files.input, tmp_path / "other.tif")


@pytest.mark.slow
def test_images_without_georeferencing_may_be_turned(tmp_path: Path) -> None:
    turned = write_speckled_pair(tmp_path, SIZE, shift_on_map(0, 0))
    values = np.rot90(pixels(turned.input)[0]).copy()
    plain = [
        write_raster(tmp_path / f"{name}.tif", image)
        for name, image in (("plain", pixels(turned.reference)[0]), ("turned", values))
    ]
    found = match_sar_sar(*plain, tmp_path / "out.tif")
    grid = Grid(PIXEL_COORDINATES, None, *SIZE)
    px = np.array([[50.0, 60.0], [200.0, 100.0], [150.0, 220.0]])
    # Counter-clockwise: columns become rows from below.
    expected = np.column_stack([px[:, 1], SIZE[0] - 1 - px[:, 0]])
    off = found.transform(grid.pixel_to_map(px)) - expected
    assert np.hypot(*off.T).max() < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("image", ["reference", "input"])
def test_keypoints_on_a_mask_of_either_image_take_no_part(
    files: TexturedPair, tmp_path: Path, image: str
) -> None:
    """Bright bars on the left of one image: what is found there is not matched."""
    values = pixels(getattr(files, image))[0].copy()
    values[:, :90] = np.clip(values[:, :90].astype(float) * 30, 1, 65_535).astype(values.dtype)
    bright = write_raster(tmp_path / "bright.tif", values, files.grid)
    pair = replace(files, **{image: bright})
    shown = np.ones(SIZE[::-1], np.uint8)
    shown[:, :90] = 0
    mask = write_raster(tmp_path / "mask.tif", shown, files.grid)
    found = match_sar_sar(
        pair.reference, pair.input, tmp_path / "out.tif", **{f"{image}_mask": mask}
    )
    points = found.tie_points.take(~found.tie_points.is_check)
    on_reference = files.grid.map_to_pixel(points.reference_xy)
    px = on_reference if image == "reference" else points.input_px
    assert len(px) > 10
    # Chips may lie across the border, of which half their side of 81 px is beyond it at most.
    assert px[:, 0].min() > 89 - 41
    assert error_px(found.transform, files) < 0.8


def lifted(files: TexturedPair, folder: Path, share: float, by_px: int) -> TexturedPair:
    """Return a pair of which a share of the rows, in bands, is displaced along columns."""
    values = pixels(files.input)[0]
    band = 35
    rows = np.arange(len(values)) % band < share * band
    moved = np.where(rows[:, None], np.roll(values, by_px, axis=1), values)
    return replace(files, input=write_raster(folder / "lifted.tif", moved, files.grid))


@pytest.mark.slow
def test_elevated_objects_are_not_taken_for_the_ground(files: TexturedPair, tmp_path: Path) -> None:
    pair = lifted(files, tmp_path, 0.5, 9)
    with pytest.raises(NotRegisteredError) as refused:
        match_sar_sar(pair.reference, pair.input, tmp_path / "out.tif")
    assert not (tmp_path / "out.tif").exists()
    assert "ground and elevated objects" in str(refused.value)


def on_many_heights(files: TexturedPair, folder: Path, side_px: int, seed: int) -> TexturedPair:
    """Return a pair of which seven in ten tiles stand 2 to 6 px high, displaced along columns."""
    random, values = np.random.default_rng(seed), pixels(files.input)[0]
    moved = values.copy()
    for row in range(0, len(values), side_px):
        for col in range(0, values.shape[1], side_px):
            height = int(random.integers(2, 7)) if random.random() < 0.7 else 0
            cols = np.clip(np.arange(col, min(col + side_px, values.shape[1])) - height, 0, None)
            moved[row : row + side_px, col : col + side_px] = values[row : row + side_px, cols]
    return replace(files, input=write_raster(folder / "heights.tif", moved, files.truth.input_grid))


@pytest.mark.slow
@pytest.mark.parametrize(("tool", "side_px"), [(match_sar_sar, 16), (coregister, 28)])
def test_a_model_through_many_heights_is_refused(
    files: TexturedPair, tmp_path: Path, tool: Callable[..., object], side_px: int
) -> None:
    """Check points agree with it as well as with the ground, which it is 3 px off."""
    pair = on_many_heights(files, tmp_path, side_px, seed=1)
    with pytest.raises(NotRegisteredError) as refused:
        tool(pair.reference, pair.input, tmp_path / "out.tif")
    assert refused.value.verdict is not None
    assert refused.value.verdict.rule == "uncertain transform"
    assert not (tmp_path / "out.tif").exists()
