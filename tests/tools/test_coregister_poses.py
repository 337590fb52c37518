"""Registrations whose input is rotated or scaled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid
from specified_runs import register_specified
from textured_pairs import TexturedPair, error_px, write_textured_pair

from groundtie.errors import NotRegisteredError
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.registration.registration import Registration
from groundtie.registration.specification import COREGISTER
from groundtie.tools.coregister import coregister

SIZE = (300, 280)


def rotated(degrees: float, growth: float = 1.0) -> Model:
    """Return a misregistration by rotation and scale about the centre, and a shift in metres."""
    corners = [[0, 0], [SIZE[0] - 1, SIZE[1] - 1]]
    frame = Frame.around(utm_grid(*SIZE).pixel_to_map(corners))
    cosine, sine = growth * np.cos(np.radians(degrees)), growth * np.sin(np.radians(degrees))
    linear = [[cosine - 1, sine], [-sine, cosine - 1]]
    shift = np.array([70.0, -45.0]) / frame.to_map.a
    return PolynomialModel("similarity", frame, np.array([shift, *linear]))


def registered(folder: Path, model: Model, **options: object) -> tuple[float, Registration]:
    """Return the error in pixels, and the result, of a pair that is misregistered by a model."""
    pair: TexturedPair = write_textured_pair(folder, SIZE, model)
    found = coregister(pair.reference, pair.input, folder / "out.tif", workers=2, **options)
    return error_px(found.transform, pair), found


@pytest.mark.slow
@pytest.mark.parametrize(("degrees", "growth"), [(25.0, 1.0), (-40.0, 1.1), (150.0, 0.8)])
def test_a_rotation_and_a_scale_are_searched_for(
    tmp_path: Path, degrees: float, growth: float
) -> None:
    pair = write_textured_pair(tmp_path, SIZE, rotated(degrees, growth))
    spec = replace(COREGISTER, rotation_deg=180.0, scale=1.4)
    found = register_specified(spec, pair.reference, pair.input)
    assert error_px(found.transform, pair) < 0.15
    assert found.transform.model.kind == "similarity"


@pytest.mark.slow
def test_a_rotation_that_is_not_searched_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NotRegisteredError):
        registered(tmp_path, rotated(25.0))


@pytest.mark.slow
def test_a_shift_and_a_small_rotation_are_searched_for(tmp_path: Path) -> None:
    error, _ = registered(tmp_path, rotated(4.0), search_rotation=10.0)
    assert error < 0.15
