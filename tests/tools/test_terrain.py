"""Terrain models beside the images, or as the reference."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import groundtie
from groundtie.errors import NoOverlapError, NotRegisteredError, ParameterError
from groundtie.rasters.reading import open_raster
from groundtie.registration.asked import asked_lights, asked_surface_view

SIZE = 400


@pytest.fixture(scope="module")
def hills(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A camera's image 25° off nadir, orthorectified with heights that are wrong by 60 m."""
    folder = tmp_path_factory.mktemp("hills")
    groundtie.simulate(
        folder,
        size=SIZE,
        density="rural",
        pixel_size=10.0,
        looks=16.0,
        shift=3.0,
        warp=1.0,
        relief=300.0,
        slope=25.0,
        terrain_error=60.0,
        off_nadir=25.0,
        seed=3,
    )
    return folder


def error_px(transform: groundtie.Transform, folder: Path) -> np.ndarray:
    """By how much a transform misses the true positions at check points, shape (n,)."""
    points = np.genfromtxt(folder / "check_points.csv", delimiter=",", names=True)
    xy = np.column_stack([points["reference_x"], points["reference_y"]])
    px = np.column_stack([points["input_col"], points["input_row"]])
    return np.asarray(np.hypot(*(transform(xy) - px).T))


@pytest.mark.slow
def test_the_stored_truth_holds_at_the_check_points(hills: Path) -> None:
    truth = groundtie.load_transform(hills / "truth.json")
    assert error_px(truth, hills).max() < 1e-3
    displaced = truth.model(points_of(truth)) - truth.model.affine(points_of(truth))
    # tan 25° of errors of some 60 m.
    assert 15 < np.hypot(*displaced.T).std() < 45


def points_of(truth: groundtie.Transform) -> np.ndarray:
    side = np.linspace(0, SIZE - 1, 9)
    px = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    return truth.input_grid.pixel_to_map(px)


@pytest.mark.slow
def test_what_wrong_heights_displace_is_taken_out_and_warped(hills: Path, tmp_path: Path) -> None:
    files, stored = (hills / "reference.tif", hills / "input.tif"), tmp_path / "transform.json"
    dems = {"dem": hills / "dem.tif", "input_dem": hills / "input_dem.tif"}
    found = groundtie.coregister(*files, transform=stored, **dems)
    assert found.transform is not None
    assert found.transform.model.kind == "terrain"
    assert np.sqrt((error_px(found.transform, hills) ** 2).mean()) < 1.0
    assert json.loads(stored.read_text())["model"]["dem"] == str(dems["dem"].resolve())
    warped = groundtie.warp(files[1], tmp_path / "warped.tif", transform=stored)
    xy = points_of(found.transform)
    np.testing.assert_allclose(warped.transform(xy), found.transform(xy), atol=1e-6)
    with open_raster(tmp_path / "warped.tif") as source:
        assert source.read(source.window)[1].mean() > 0.9


def seen_by_radar(folder: Path, **country: float) -> None:
    """Make a radar image of 6 km and its terrain model."""
    orbit = "descending" if country["seed"] == 10 else "ascending"
    fixed = {"size": 600, "density": "rural", "pixel_size": 10.0, "looks": 4.0}
    groundtie.simulate(folder, shift=4.0, warp=2.0, input="sar", orbit=orbit, **fixed, **country)


@pytest.mark.slow
def test_a_radar_image_that_wrong_heights_displace_is_not_registered_to_the_terrain(
    tmp_path: Path,
) -> None:
    """Errors are judged in pixels of the image, however large those are that it is matched at."""
    seen_by_radar(tmp_path, relief=1500.0, slope=45.0, terrain_error=30.0, seed=10)
    with pytest.raises(NotRegisteredError, match=r"error at check points is .* above 1\.5 px"):
        groundtie.coregister(tmp_path / "dem.tif", tmp_path / "input.tif", views="terrain radar")


@pytest.mark.slow
def test_a_radar_image_of_hills_is_matched_with_their_terrain_model_at_twice_its_pixels(
    tmp_path: Path,
) -> None:
    seen_by_radar(tmp_path, relief=300.0, slope=25.0, seed=11)
    files = (tmp_path / "dem.tif", tmp_path / "input.tif")
    found = groundtie.coregister(*files, views="terrain radar")
    assert found.transform is not None
    assert np.sqrt((error_px(found.transform, tmp_path) ** 2).mean()) < 1.0
    assert found.pair.grid.pixel_size_m == pytest.approx(20.0)
    asked = groundtie.coregister(*files, views="terrain radar", matching_pixel_size=30.0)
    assert asked.pair.grid.pixel_size_m == pytest.approx(30.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"input_dem": "d.tif"}, "input_dem.* goes with another one"),
        ({"dem": "d.tif", "model": "affine"}, "goes with model auto, not affine"),
        ({"views": "terrain moon"}, "states no light: give 'terrain sun' or"),
        ({"views": "terrain sun azimuth=400"}, "states no light"),
        ({"views": "terrain sun"}, "needs its azimuth"),
        ({"views": "terrain radar; camera azimuth=1 incidence=2"}, "go with a surface model"),
        ({"views": "terain sun azimuth=155"}, "or state that the reference holds heights"),
    ],
)
def test_what_does_not_go_together_is_refused(
    hills: Path, given: dict[str, object], message: str
) -> None:
    with pytest.raises(ParameterError, match=message):
        groundtie.coregister(hills / "reference.tif", hills / "input.tif", **given)


@pytest.mark.slow
def test_a_vertical_datum_goes_with_heights(hills: Path) -> None:
    with pytest.raises(ParameterError, match=r"dem_datum.* goes with a terrain model"):
        groundtie.register(hills / "reference.tif", hills / "input.tif", dem_datum="EGM96")


@pytest.mark.slow
def test_register_takes_the_view_of_a_terrain_model_only(hills: Path) -> None:
    with pytest.raises(ParameterError, match="view of a terrain or surface model only"):
        groundtie.register(
            hills / "reference.tif", hills / "input.tif", views="radar azimuth=280 incidence=35"
        )


@pytest.mark.parametrize(
    ("words", "azimuths"),
    [
        (None, []),
        ("terrain radar", [270.0, 90.0]),
        ("terrain radar azimuth=98", [98.0]),
        ("Terrain sun, azimuth=155.5°", [155.5]),
    ],
)
def test_light_is_stated_as_views_are(words: str | None, azimuths: list[float]) -> None:
    lights = asked_lights({"views": words})
    assert [light.azimuth_deg for light in lights] == azimuths
    assert {light.kind for light in lights} <= set(str(words).lower().replace(",", " ").split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("surface radar", "states no radar's view"),
        ("surface camera azimuth=1 incidence=2", "states no radar's view"),
        ("surface radar azimuth=100", "does not state incidence"),
        ("surface sun", "states no view"),
    ],
)
def test_a_surface_model_needs_the_view_of_a_radar(words: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        asked_surface_view({"views": words, "input": "alone.tif"})


@pytest.mark.slow
def test_the_view_of_a_surface_model_is_stated_or_the_inputs_own(town: Path) -> None:
    input = town / "input.tif"
    for words in ("Surface radar azimuth=270, incidence=40", "surface radar"):
        found = asked_surface_view({"views": words, "input": input})
        assert found is not None and found.sensor == "radar"
        assert (found.azimuth_deg, found.incidence_deg) == pytest.approx((270, 40), abs=0.1)
    assert asked_surface_view({"views": "terrain radar", "input": input}) is None


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A radar image of a dense city, 6 px off, and its surface model."""
    folder = tmp_path_factory.mktemp("town")
    groundtie.simulate(
        folder,
        size=600,
        density="city",
        looks=4.0,
        incidence=40.0,
        shift=6.0,
        warp=1.0,
        input="sar",
        seed=5,
    )
    return folder


@pytest.mark.slow
def test_a_radar_image_is_registered_to_a_surface_model(town: Path) -> None:
    found = groundtie.coregister(town / "dsm.tif", town / "input.tif", views="surface radar")
    assert found.transform is not None
    assert np.sqrt((error_px(found.transform, town) ** 2).mean()) < 0.5
    assert found.mask.kind == "none" and "layover" in found.mask.reason


@pytest.mark.slow
@pytest.mark.parametrize("azimuth", [90.0, 0.0])
def test_a_surface_model_seen_from_elsewhere_is_refused(town: Path, azimuth: float) -> None:
    views = f"surface radar azimuth={azimuth} incidence=40"
    with pytest.raises(NotRegisteredError):
        groundtie.register(town / "dsm.tif", town / "input.tif", views=views)


@pytest.mark.slow
def test_a_terrain_model_of_elsewhere_is_refused(hills: Path, tmp_path: Path) -> None:
    groundtie.simulate(tmp_path, size=64, pixel_size=10.0, warp=1.0)
    with pytest.raises(NoOverlapError, match="covers only"):
        groundtie.coregister(hills / "reference.tif", hills / "input.tif", dem=tmp_path / "dem.tif")
