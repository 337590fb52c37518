from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from brightness_classifiers import bright_is_left_out
from raster_files import write_raster
from specified_runs import register_specified
from textured_pairs import (
    TexturedPair,
    error_px,
    listing,
    pixels,
    shift_on_map,
    write_textured_pair,
)

from groundtie import match_optical
from groundtie.errors import NotRegisteredError, ParameterError
from groundtie.features.classifier_training import Training, train_classifier
from groundtie.geometry.tie_point_files import read_tie_points
from groundtie.geometry.transform import load_transform
from groundtie.masks import ground
from groundtie.matching.shared_content import Sensors
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.registration import pipeline
from groundtie.registration.registration import Registration
from groundtie.registration.rules import scene as scene_rules
from groundtie.registration.scene import ImageFacts, SceneInfo
from groundtie.registration.specification import MATCHERS, OPTICAL

SIZE = (300, 280)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    # The input's contrast is inverted.
    folder = tmp_path_factory.mktemp("textured")
    return write_textured_pair(folder, SIZE, shift_on_map(70.0, -45.0), noise=0.1)


@pytest.fixture(scope="module")
def registration(
    files: TexturedPair, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Registration, Path]:
    """Return the pair's registration, and the folder of all its files."""
    folder = tmp_path_factory.mktemp("registered")
    found = match_optical(
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
    assert error_px(found.transform, files) < 0.3
    assert error_px(load_transform(folder / "transform.json"), files) < 0.3
    report = json.loads((folder / "report.json").read_text())
    assert report["verdict"]["accepted"] is True
    table = read_tie_points(folder / "points.gpkg", found.transform.input_grid)
    assert len(table.reference_xy) == len(found.tie_points)
    reference, registered = (
        pixels(path)[0][40:-40, 40:-40].astype(float)
        for path in (files.reference, folder / "out.tif")
    )
    assert np.corrcoef(reference.ravel(), registered.ravel())[0, 1] < -0.9


@pytest.mark.slow
@pytest.mark.parametrize("matcher", MATCHERS)
def test_every_matcher_finds_it_where_contrast_is_alike(
    files: TexturedPair, tmp_path: Path, matcher: str
) -> None:
    upright = write_raster(
        tmp_path / "in.tif", 4000 - pixels(files.input)[0], files.truth.input_grid
    )
    found = register_specified(replace(OPTICAL, matcher=matcher), files.reference, upright)
    assert error_px(found.transform, files) < 0.5


@pytest.mark.slow
def test_check_points_lie_where_no_keypoint_was_seen(
    files: TexturedPair, registration: tuple[Registration, Path]
) -> None:
    found, _ = registration
    fit, check = (
        files.grid.map_to_pixel(found.tie_points.reference_xy[found.tie_points.is_check == c])
        for c in (0, 1)
    )
    apart = np.linalg.norm(fit[:, None] - check[None], axis=2)
    assert len(check) >= 4
    assert apart.min() > 15


@pytest.mark.slow
def test_another_place_is_refused_and_leaves_its_report_only(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    other = write_textured_pair(tmp_path / "in", SIZE, shift_on_map(0, 0), input_seed=77)
    with pytest.raises(NotRegisteredError):
        match_optical(
            other.reference, other.input, tmp_path / "o.tif", report=tmp_path / "report.html"
        )
    assert set(listing(tmp_path)) >= {"report.html", "report.json"}
    assert not (tmp_path / "o.tif").exists()


@pytest.mark.slow
@pytest.mark.parametrize("is_radar", [True, False])
def test_a_radar_image_that_may_show_a_town_is_in_doubt(
    files: TexturedPair, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_radar: bool
) -> None:
    """Refused as a whole, it is tried by its ground, which counts."""
    sensors = Sensors.DIFFERENT if is_radar else Sensors.CAMERAS
    monkeypatch.setattr(SceneInfo, "apparent", sensors)
    monkeypatch.setattr(SceneInfo, "is_despeckled_town", False)
    # Too few strong scatterers for a town, too many for one to be ruled out.
    monkeypatch.setattr(ImageFacts, "strong_share", 0.1)
    monkeypatch.setattr(scene_rules, "_CLEAR_SHARE", 1.1)
    # Pixels of 10 m resolve streets.
    monkeypatch.setattr(ground, "_COARSEST_M", 10.0)
    found = match_optical(files.reference, files.input, tmp_path / "out.tif")
    expected = ("ground", 2) if is_radar else ("none", 1)
    assert (found.mask.kind, found.spec.tries) == expected
    if is_radar:
        monkeypatch.setattr(pipeline, "ground_instead", lambda *_: None)
        with pytest.raises(NotRegisteredError, match="as roofs may"):
            match_optical(files.reference, files.input, tmp_path / "other.tif")
        assert not (tmp_path / "other.tif").exists()


@pytest.mark.slow
def test_images_without_georeferencing_may_be_turned_and_larger(tmp_path: Path) -> None:
    pair = write_textured_pair(tmp_path, SIZE, shift_on_map(0, 0), noise=0.1)
    values = np.kron(np.rot90(pixels(pair.input)[0]), np.ones((2, 2), np.uint16))[:, 60:]
    plain = [
        write_raster(tmp_path / f"{name}.tif", image)
        for name, image in (("plain", pixels(pair.reference)[0]), ("turned", values))
    ]
    found = match_optical(*plain, tmp_path / "out.tif")
    px = np.array([[50.0, 60.0], [200.0, 100.0], [150.0, 220.0]])
    # Counter-clockwise: columns become rows from below; every pixel becomes four.
    turned = np.column_stack([px[:, 1], SIZE[0] - 1 - px[:, 0]])
    expected = 2 * turned + 0.5 - [60, 0]
    off = found.transform(Grid(PIXEL_COORDINATES, None, *SIZE).pixel_to_map(px)) - expected
    assert np.hypot(*off.T).max() < 1.5


@pytest.mark.slow
def test_what_a_coarser_image_shows_is_matched_all_over(tmp_path: Path) -> None:
    """Without georeferencing, an image of fewer pixels may show just as much."""
    pair = write_textured_pair(tmp_path, SIZE, shift_on_map(0, 0), noise=0.05)
    reference = np.kron(pixels(pair.reference)[0], np.ones((2, 2), np.uint16))
    plain = [
        write_raster(tmp_path / f"{name}.tif", image)
        for name, image in (("fine", reference), ("coarse", pixels(pair.input)[0]))
    ]
    found = register_specified(replace(OPTICAL, scale=2.2), *plain)
    size = np.array(SIZE) * 2
    assert (np.ptp(found.tie_points.reference_xy, axis=0) > 0.75 * size).all()
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * (size - 1.0)
    off = found.transform(corners) - (corners - 0.5) / 2
    assert np.hypot(*off.T).max() < 1.0


@pytest.mark.slow
def test_an_image_that_is_turned_is_classified_all_over(tmp_path: Path) -> None:
    """It may show the reference where, as it claims, it lies far beyond it."""
    pair = write_textured_pair(tmp_path, SIZE, shift_on_map(0, 0), noise=0.1)
    values = np.kron(np.rot90(pixels(pair.input)[0]), np.ones((2, 2), np.uint16))
    plain = [
        write_raster(tmp_path / f"{name}.tif", image)
        for name, image in (("plain", pixels(pair.reference)[0]), ("turned", values))
    ]
    nothing = bright_is_left_out(tmp_path / "c.json", 60_000)
    found = match_optical(*plain, tmp_path / "out.tif", input_mask=nothing)
    used = found.tie_points.input_px[found.tie_points.used]
    assert (np.ptp(used, axis=0) > 0.7 * np.array(values.shape[::-1])).all()


def test_a_classifier_of_other_bands_is_refused(files: TexturedPair, tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    random = np.random.default_rng(0)
    labelled = Training(
        random.normal(size=(60, 6)), np.repeat([True, False], 30), random.uniform(0, 99, (60, 2)), 4
    )
    train_classifier(labelled, "band-ratios", "linear", 10.0, 0).write(path)
    with pytest.raises(ParameterError, match=r"of 4 bands; .*input.tif has 1"):
        match_optical(files.reference, files.input, tmp_path / "out.tif", input_mask=path)
    assert list(listing(tmp_path)) == ["c.json"]


@pytest.mark.slow
def test_features_that_a_classifier_leaves_out_take_no_part(
    files: TexturedPair, tmp_path: Path
) -> None:
    values = pixels(files.input)[0].astype(float)
    values[:, :130] += 1500
    bright = write_raster(tmp_path / "in.tif", values.astype(np.uint16), files.truth.input_grid)
    classifier = bright_is_left_out(tmp_path / "c.json", 2750)
    for chosen in (None, classifier):
        found = match_optical(
            files.reference,
            bright,
            tmp_path / "out.tif",
            input_mask=chosen,
        )
        nearest = found.tie_points.input_px[~found.tie_points.is_check, 0].min()
        assert (nearest > 110) == (chosen is not None)
        assert error_px(found.transform, files) < 0.6


def test_a_file_that_is_no_classifier_is_refused(files: TexturedPair, tmp_path: Path) -> None:
    (tmp_path / "c.json").write_text("{}")
    with pytest.raises(ParameterError, match="no feature classifier"):
        match_optical(
            files.reference, files.input, tmp_path / "o.tif", input_mask=tmp_path / "c.json"
        )
    assert list(listing(tmp_path)) == ["c.json"]


@pytest.mark.slow
def test_what_was_registered_to_the_grid_before_is_accepted_again(
    real_data: Path, tmp_path: Path
) -> None:
    """Ground may lie at the same columns and rows of both images: most products are gridded so."""
    reference, input = (real_data / f"oi-1/IO1{image}.png" for image in "ab")
    match_optical(reference, input, tmp_path / "once.tif")
    again = match_optical(reference, tmp_path / "once.tif")
    assert again.verdict.accepted and again.transform is not None
    # Without georeferencing, positions are pixels.
    px = np.array([[100.0, 100.0], [300.0, 200.0]])
    np.testing.assert_allclose(again.transform(px), px, atol=0.5)
