"""Models of degree 1 on one level of the pyramid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid
from textured_pairs import (
    TexturedPair,
    everywhere,
    rms,
    shift_on_map,
    write_textured_pair,
)

from groundtie.context import Context
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.level_fit import CoarseModel, fit_level
from groundtie.rasters.pair import ImagePair
from groundtie.similarity.surface import SimilaritySettings

SETTINGS = SimilaritySettings("orientation")


def fitted(pair: ImagePair, start: Model, context: Context) -> CoarseModel:
    return fit_level(ChipMatcher(pair, SETTINGS), pair.grid, start, 12, context)


def error_m(model: Model, files: TexturedPair) -> float:
    xy = everywhere(files.grid)
    return rms(model(xy) - files.truth.model(xy))


def similarity(shift: tuple[float, float], degrees: float, growth: float = 1.0) -> Model:
    """Return a misregistration by rotation, scale and shift (in metres) about the centre."""
    frame = Frame.around(utm_grid(260, 240).pixel_to_map([[0, 0], [259, 239]]))
    cos, sin = growth * np.cos(np.deg2rad(degrees)), growth * np.sin(np.deg2rad(degrees))
    offset = np.array(shift) / frame.to_map.a
    return PolynomialModel("similarity", frame, np.array([offset, [cos - 1, sin], [-sin, cos - 1]]))


@pytest.mark.parametrize(("degrees", "growth"), [(0.0, 1.0), (2.0, 1.0), (-1.5, 1.02)])
@pytest.mark.slow
def test_a_level_corrects_a_model_that_is_off(
    tmp_path: Path, context: Context, degrees: float, growth: float
) -> None:
    files = write_textured_pair(tmp_path, (260, 240), similarity((70, -45), degrees, growth))
    with files.opened() as pair:
        start = shift_on_map(40.0, -20.0)
        found = fitted(pair, start, context)
    assert found.log10_false_alarms < -6
    assert error_m(found.model, files) < 10  # a pixel


def test_a_correction_comes_before_the_model_that_is_known(
    tmp_path: Path, context: Context
) -> None:
    """With a rotating start model, the remaining error refers to the grid, not the nominal map."""
    files = write_textured_pair(tmp_path, (260, 240), similarity((70, -45), 4.0))
    with files.opened() as pair:
        start = similarity((20, 10), 3.0)
        found = fitted(pair, start, context)
    assert error_m(found.model, files) < 10


def test_two_places_have_nothing_in_common(other_place: TexturedPair, context: Context) -> None:
    with other_place.opened() as pair:
        start = shift_on_map(0, 0)
        found = fitted(pair, start, context)
        assert found.log10_false_alarms > -2


def test_too_few_chips_show_nothing(pair: ImagePair, context: Context) -> None:
    start = shift_on_map(5000.0, 0.0)
    found = fitted(pair, start, context)
    assert found.log10_false_alarms == np.inf
    assert found.model is start
