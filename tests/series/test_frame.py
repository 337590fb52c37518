"""Displacements as vectors, matrices and models."""

from __future__ import annotations

import json

import numpy as np
import pytest
from affine import Affine
from raster_files import utm_grid
from rasterio.crs import CRS
from series_dates import FRAME, GRID

from groundtie.rasters.grid import Grid, compose, reproject
from groundtie.series.frame import SeriesFrame, rms_px, sigma_px

DISPLACEMENT = np.array([3.0, -2.0, 0.4, 0.1, -0.2, 0.6])


def test_a_displacement_survives_all_its_forms() -> None:
    matrix = FRAME.matrix(DISPLACEMENT)
    np.testing.assert_allclose(FRAME.of_matrix(matrix), DISPLACEMENT, atol=1e-12)
    model = FRAME.model(DISPLACEMENT)
    np.testing.assert_allclose(FRAME.displacement_of(model), DISPLACEMENT, atol=1e-9)


def test_its_numbers_are_pixels_at_the_centre_and_at_the_border() -> None:
    model = FRAME.model(DISPLACEMENT)
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    moved = (FRAME.square.enter(model(FRAME.square.leave(uv))) - uv) * FRAME.half_px
    expected = [[3.0, -2.0], [3.4, -1.9], [2.8, -1.4]]
    np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_a_shift_is_a_translation() -> None:
    assert FRAME.model(np.array([3.0, -2.0, 0, 0, 0, 0])).kind == "translation"
    assert FRAME.model(DISPLACEMENT).kind == "affine"


def test_the_root_mean_square_is_that_of_a_lattice() -> None:
    side = np.linspace(-1, 1, 201)
    uv = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    moved = DISPLACEMENT[:2] + uv @ DISPLACEMENT[2:].reshape(2, 2)
    assert rms_px(DISPLACEMENT) == pytest.approx(np.sqrt((moved**2).sum(axis=1).mean()), rel=0.01)
    assert sigma_px(np.outer(DISPLACEMENT, DISPLACEMENT)) == pytest.approx(rms_px(DISPLACEMENT))


@pytest.mark.parametrize("turn_deg", [0.0, 30.0])
@pytest.mark.parametrize("latitude", [0.0, 69.5])
def test_metres_are_those_at_the_centre_of_the_dates(latitude: float, turn_deg: float) -> None:
    """By an azimuthal map around it; the hub reaches 18 degrees farther to the south."""
    turned = Affine.translation(5, latitude + 0.5), Affine.rotation(turn_deg)
    hub = Grid(compose(*turned, Affine.scale(1e-4, -1e-4)), CRS.from_epsg(4326), 100_000, 180_000)
    date = hub.window(40_000, 3000, 5000, 5000)
    frame = SeriesFrame.around(hub, [hub, *[date] * 6])
    centre = frame.square.leave(np.zeros((1, 2)))
    lon, lat = centre[0]
    local = CRS.from_proj4(f"+proj=aeqd +lat_0={lat} +lon_0={lon} +datum=WGS84")
    across = frame.centre_px + np.array([[0, 0], [1, 0], [0, 1]])
    middle, right, below = reproject(frame.grid.pixel_to_map(across), hub.crs, local)
    unit = reproject(centre + np.diag([1e-4, 1e-4]), hub.crs, local) / 1e-4
    np.testing.assert_allclose(frame.metres_per_unit, np.diag(unit), rtol=1e-5)
    displacement = np.random.default_rng(0).normal(0, 0.1, (1000, 6))
    displacement[:, 1] += displacement[:, 0]
    parts = displacement.reshape(-1, 3, 2) @ np.array([right - middle, below - middle])
    expected = np.sqrt(((parts**2).sum(axis=2) @ [1, 1 / 3, 1 / 3]).mean())
    covariance = displacement.T @ displacement / len(displacement)
    assert frame.sigma_m(covariance) == pytest.approx(expected, rel=1e-5)


def test_pixels_are_no_finer_than_the_dates() -> None:
    fine = utm_grid(4000, 3000, 1.0)
    frame = SeriesFrame.around(fine, [fine, GRID, GRID])
    assert frame.grid.pixel_size_m == pytest.approx(10.0)
    assert SeriesFrame.around(GRID, [GRID, fine, fine]).grid == GRID


def test_a_date_elsewhere_does_not_move_the_frame() -> None:
    away = GRID.shifted(1e6, 0.0)
    assert SeriesFrame.around(GRID, [GRID, GRID, away]).centre_px == FRAME.centre_px


def test_a_date_is_moved_to_its_ground() -> None:
    shift = np.array([3.0, -2.0, 0, 0, 0, 0])
    moved = FRAME.moved_grid(GRID, shift)
    # What nominally lies 3 px to the right, 2 px up, belongs 30 m to the west and 20 m south.
    assert moved.transform.c - GRID.transform.c == pytest.approx(-30.0)
    assert moved.transform.f - GRID.transform.f == pytest.approx(-20.0)


def test_a_frame_is_of_the_hub_that_it_was_made_around() -> None:
    dates = [utm_grid(120, 90, 25.0), utm_grid(120, 90, 25.0)]
    other = Grid(GRID.transform, CRS.from_epsg(32633), GRID.width, GRID.height)
    for frame in (FRAME, SeriesFrame.around(GRID, dates)):
        stored = SeriesFrame.from_json(json.loads(json.dumps(frame.to_json())))
        assert stored.is_of(GRID)
        for grid in (GRID.shifted(10, 0), GRID.window(0, 0, 200, 300), other, GRID.scaled(4)):
            assert not stored.is_of(grid)
    degrees = Grid(Affine(1e-4, 0, 9.0, 0, -1e-4, 45.1), CRS.from_epsg(4326), 100, 70)
    assert SeriesFrame.around(degrees, dates).is_of(degrees)
    assert not FRAME.is_of(degrees)
