"""Registrations whose input is turned or scaled, and every way to search for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid
from textured_pairs import TexturedPair, error_px, write_textured_pair

from groundtie.errors import NotRegisteredError, ParameterError
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.registration.registration import RegistrationResult
from groundtie.studies.pose_searches import SEARCHES
from groundtie.tools.coregister import coregister

SIZE = (400, 380)


def turned(degrees: float, growth: float = 1.0) -> Model:
    """Return a misregistration by rotation and scale about the centre, and a shift in metres."""
    corners = [[0, 0], [SIZE[0] - 1, SIZE[1] - 1]]
    frame = Frame.around(utm_grid(*SIZE).pixel_to_map(corners))
    cosine, sine = growth * np.cos(np.radians(degrees)), growth * np.sin(np.radians(degrees))
    linear = [[cosine - 1, sine], [-sine, cosine - 1]]
    shift = np.array([70.0, -45.0]) / frame.to_map.a
    return PolynomialModel("similarity", frame, np.array([shift, *linear]))


def registered(folder: Path, model: Model, **options: object) -> tuple[float, RegistrationResult]:
    """Return the error in pixels, and the result, of a pair that is misregistered by a model."""
    pair: TexturedPair = write_textured_pair(folder, SIZE, model)
    found = coregister(pair.reference, pair.input, folder / "out.tif", workers=2, **options)
    return error_px(found.transform, pair), found


@pytest.mark.slow
@pytest.mark.parametrize(("degrees", "growth"), [(25.0, 1.0), (-40.0, 1.1), (150.0, 0.8)])
def test_a_rotation_and_a_scale_are_searched_for(
    tmp_path: Path, degrees: float, growth: float
) -> None:
    error, found = registered(
        tmp_path, turned(degrees, growth), search_rotation=180.0, search_scale=1.4
    )
    assert error < 0.2
    assert found.transform.model.kind == "similarity"


@pytest.mark.slow
def test_a_rotation_that_is_not_searched_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NotRegisteredError):
        registered(tmp_path, turned(25.0))


@pytest.mark.slow
@pytest.mark.parametrize("search", SEARCHES)
def test_every_search_finds_a_shift(tmp_path: Path, search: str) -> None:
    error, _ = registered(tmp_path, turned(0.0), search=search)
    assert error < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("search", ["rotation-steps", "fourier-mellin", "radon", "powell"])
def test_searches_that_know_rotations_find_one(tmp_path: Path, search: str) -> None:
    error, _ = registered(tmp_path, turned(4.0), search=search, search_rotation=10.0)
    assert error < 0.2


def test_a_search_that_climbs_histograms_needs_one(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="orientation"):
        registered(tmp_path, turned(0.0), search="spsa", similarity="orientation")
