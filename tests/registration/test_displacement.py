"""The displacement field as a raster, for a pair with a known shift."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from contexts import context
from rasterio.crs import CRS
from textured_pairs import listing

from groundtie.context import Context
from groundtie.geometry.models import Frame, PolynomialModel, shift_model
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import LON_LAT, PIXEL_COORDINATES, Grid, reproject
from groundtie.registration.delivery import RegistrationFiles
from groundtie.registration.displacement import displacement_field, write_displacement
from groundtie.registration.evidence import RegistrationEvidence
from groundtie.registration.registration import Registration

__all__ = ["context"]


@pytest.fixture
def evidence(registration: Registration) -> RegistrationEvidence:
    assert registration.evidence is not None
    return registration.evidence


@pytest.mark.slow
def test_the_file_holds_the_known_shift_and_how_well_it_is_known(
    registration: Registration, tmp_path: Path, context: Context
) -> None:
    files = RegistrationFiles(displacement=tmp_path / "d.tif")
    files.write(registration, context)
    assert files.named() == {"displacement": tmp_path / "d.tif"}
    with rasterio.open(tmp_path / "d.tif") as raster:
        dx, dy, sigma = raster.read()
        assert raster.units == ("m", "m", "m")
        assert [text.partition(":")[0] for text in raster.descriptions] == ["dx", "dy", "sigma"]
        assert raster.crs == registration.pair.grid.crs
        left, bottom, right, top = raster.bounds
    # The input's georeferencing is wrong by 70 m east and 45 m south; pixels are 10 m.
    known = np.isfinite(dx)
    assert known.mean() > 0.5
    error = np.array([dx[known] + 70, dy[known] - 45])
    assert np.abs(error).max() < 1.0
    assert sigma[known].min() > 0 and sigma[known].max() < 2.0
    # The error follows sigma: one in 16 000 exceeds four sigma.
    assert (np.abs(error) < 4 * sigma[known]).all()
    # The field covers the matching grid.
    corners = registration.pair.grid.pixel_to_map(registration.pair.grid.outline(1))
    assert left <= corners[:, 0].min() and right >= corners[:, 0].max()
    assert bottom <= corners[:, 1].min() and top >= corners[:, 1].max()


def test_nothing_is_known_where_the_input_shows_nothing(evidence: RegistrationEvidence) -> None:
    field, grid = displacement_field(evidence)
    rows, cols = np.nonzero(np.isfinite(field[0]))
    px = evidence.estimate.transform(grid.pixel_to_map(np.column_stack([cols, rows])))
    assert evidence.estimate.transform.input_grid.contains(px).all()


def test_a_curved_model_gets_smaller_pixels(evidence: RegistrationEvidence) -> None:
    frame = Frame.around(evidence.grid.pixel_to_map(evidence.grid.outline()))
    terms = np.zeros((6, 2))
    terms[3] = 0.02
    curved = PolynomialModel("polynomial2", frame, terms)
    moved = replace(
        evidence,
        estimate=replace(
            evidence.estimate,
            transform=Transform(curved, evidence.grid.crs, evidence.estimate.transform.input_grid),
        ),
    )
    field, grid = displacement_field(moved)
    assert grid.pixel_size[0] < displacement_field(evidence)[1].pixel_size[0]
    xy = grid.pixel_to_map([[3, 5], [4, 5]])
    expected = xy - curved(xy)
    np.testing.assert_allclose(field[:2, 5, 3:5].T, expected, atol=0.05)


@pytest.mark.parametrize(
    ("crs", "transform"),
    [
        ("EPSG:4326", Affine(0.025, 0, 10, 0, -0.025, 70)),
        ("EPSG:3857", Affine(2500, 0, 1e6, 0, -2500, 9.9e6)),
    ],
)
def test_metres_are_those_at_each_place(
    evidence: RegistrationEvidence, crs: str, transform: Affine
) -> None:
    """By maps around places between 60° N and 70° N, where units change by up to a third."""
    grid = Grid(transform, CRS.from_string(crs), 200, 400)
    shift = np.array([-2.0, -1.0]) * grid.pixel_size
    model = Transform(shift_model(*shift), grid.crs, grid)
    moved = replace(evidence, grid=grid, estimate=replace(evidence.estimate, transform=model))
    field, nodes = displacement_field(moved)
    for row in (1, field.shape[1] // 2, field.shape[1] - 2):
        place = nodes.pixel_to_map([[1, row]])
        (lon, lat) = reproject(place, grid.crs, LON_LAT)[0]
        around = CRS.from_string(f"+proj=aeqd +lon_0={lon} +lat_0={lat} +datum=WGS84")
        sides = np.diag(grid.pixel_size) / 2
        ends = (reproject(place + way, grid.crs, around) for way in (sides, -sides))
        width, height = np.diag(np.subtract(*ends))
        sigma_px = moved.error.standard_deviation_px(grid.map_to_pixel(place))[0]
        expected = (2 * width, height, sigma_px * max(width, height))
        np.testing.assert_allclose(field[:, row, 1], expected, rtol=1e-3)


def test_without_georeferencing_it_is_in_pixels(
    registration: Registration, evidence: RegistrationEvidence, tmp_path: Path
) -> None:
    own = Grid(PIXEL_COORDINATES, None, evidence.grid.width, evidence.grid.height)
    shift = PolynomialModel("translation", Frame(Affine.identity()), np.array([[3.0, -2.0]]))
    estimate = replace(evidence.estimate, transform=Transform(shift, None, own))
    like, path = registration.pair.reference.source, tmp_path / "d.tif"
    # The file's coordinates are in the image's own pixels, whatever size was matched.
    for lattice in (own, own.window(5, 4, 90, 80), own.scaled(2.0)):
        write_displacement(replace(evidence, grid=lattice, estimate=estimate), like, path)
        with rasterio.open(path) as raster:
            dx, dy, _ = raster.read()
            assert raster.units == ("px",) * 3 and "down" in raster.descriptions[1]
        known = np.isfinite(dx)
        np.testing.assert_allclose(dx[known], -3.0, rtol=1e-6)
        np.testing.assert_allclose(dy[known], 2.0, rtol=1e-6)


def test_a_refused_registration_leaves_none(
    registration: Registration, tmp_path: Path, context: Context
) -> None:
    refused = replace(registration, verdict=replace(registration.verdict, accepted=False))
    RegistrationFiles(displacement=tmp_path / "d.tif").write(refused, context)
    assert not listing(tmp_path)
