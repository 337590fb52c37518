"""Models of degree 1 on one level of the pyramid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid
from textured_pairs import TexturedPair, error_m, shift_on_map, write_textured_pair

from groundtie.context import Context
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.matching import level_fit
from groundtie.matching.belief_propagation import Surfaces
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.level_fit import CoarseModel, fit_level
from groundtie.rasters.grid import FloatArray
from groundtie.rasters.pair import ImagePair
from groundtie.similarity.surface import SimilaritySettings

SETTINGS = SimilaritySettings("orientation")


def fitted(pair: ImagePair, start: Model, context: Context) -> CoarseModel:
    return fit_level(ChipMatcher(pair, SETTINGS), pair.grid, start, 12, context)


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


@pytest.mark.parametrize("size", [(100, 100), (150, 191), (400, 150), (512, 512)])
def test_chips_support_their_neighbours_however_small_the_level(
    tmp_path: Path, size: tuple[int, int], context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A chip amid others has eight neighbours at least, one in a corner three."""
    seen: list[tuple[FloatArray, float]] = []

    def remember(surfaces: Surfaces, centres: FloatArray, reach_px: float) -> Surfaces:
        seen.append((centres, reach_px))
        return surfaces

    monkeypatch.setattr(level_fit, "propagate", remember)
    with write_textured_pair(tmp_path, size, similarity((0, 0), 0.0)).opened() as pair:
        fitted(pair, shift_on_map(0, 0), context)
    (centres, reach_px), *_ = seen
    apart = np.hypot(*(centres[:, None] - centres).transpose(2, 0, 1))
    neighbours = (apart <= reach_px).sum(axis=1) - 1
    columns, rows = (np.unique(along) for along in centres.T)
    amid = np.isin(centres[:, 0], columns[1:-1]) & np.isin(centres[:, 1], rows[1:-1])
    assert amid.any() and neighbours[amid].min() >= 8
    assert neighbours.min() >= 3


@pytest.mark.parametrize("size", [(500, 30), (30, 500), (400, 60)])
def test_narrow_strips_have_chips_of_their_width_once(
    size: tuple[int, int], tmp_path: Path, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[FloatArray] = []
    propagated = level_fit.propagate

    def remember(surfaces: Surfaces, centres: FloatArray, reach_px: float) -> Surfaces:
        seen.append(centres)
        return propagated(surfaces, centres, reach_px)

    monkeypatch.setattr(level_fit, "propagate", remember)
    files = write_textured_pair(tmp_path, size, similarity((70, -45), 0.0))
    with files.opened() as pair:
        found = fitted(pair, shift_on_map(40.0, -20.0), context)
    (centres,) = seen
    # Chips beside one another that share most pixels would count twice.
    assert min(len(np.unique(along)) for along in centres.T) == 1
    assert found.log10_false_alarms < -4
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
