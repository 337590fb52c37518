from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from textured_pairs import TexturedPair, shift_on_map

from groundtie.context import Context
from groundtie.errors import CancelledError
from groundtie.geometry.models import Model
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.matcher import ChipSurfaces, Places
from groundtie.memo import Memo
from groundtie.progress import Progress
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import ImagePair
from groundtie.rasters.patch import Patch
from groundtie.similarity import description
from groundtie.similarity.orientation import orientation_fields
from groundtie.similarity.surface import SimilaritySettings

CHIP, RADIUS = 40, 10
CENTRES = np.array([[60, 60], [130, 120], [200, 170]])
SETTINGS = SimilaritySettings("orientation")

# The input's nominal displacement is 70 m east and 45 m south: 7 columns and 4.5 rows.
SHIFT_PX = (7.0, 4.5)
NOMINAL = shift_on_map(0.0, 0.0)


def matcher(pair: ImagePair, **more: object) -> ChipMatcher:
    return ChipMatcher(pair, SETTINGS, **more)  # type: ignore[arg-type]


def matched(
    by: ChipMatcher, context: Context, centres: np.ndarray = CENTRES, model: Model = NOMINAL
) -> ChipSurfaces:
    return by.match(model, Places(by.pair.grid, centres, CHIP), RADIUS, context)


def peaks(surfaces: np.ndarray) -> np.ndarray:
    flat = surfaces.reshape(len(surfaces), -1).argmax(axis=1)
    rows, cols = np.unravel_index(flat, surfaces.shape[1:])
    return np.column_stack([cols, rows]) - surfaces.shape[1] // 2


@pytest.mark.parametrize("similarity", ["orientation", "nmi", "fused"])
def test_surfaces_of_both_ways_peak_at_the_shift(
    pair: ImagePair, context: Context, similarity: str
) -> None:
    settings = SimilaritySettings(similarity)
    found = matched(replace(matcher(pair), settings=settings), context)
    assert found.radius_px == RADIUS
    np.testing.assert_array_equal(found.centres, CENTRES)
    for surfaces in (found.forward, found.backward, found.combined):
        assert surfaces.shape == (3, 2 * RADIUS + 1, 2 * RADIUS + 1)
        assert np.abs(peaks(surfaces) - SHIFT_PX).max() <= 1


def test_what_the_reference_shows_is_described_once_for_several_inputs(
    pair: ImagePair, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    described = []

    def fields(window: Patch) -> np.ndarray:
        described.append(len(window.values))
        return orientation_fields(window)

    monkeypatch.setattr(description, "orientation_fields", fields)
    alone, other = (matched(matcher(pair), context, model=shift_on_map(m, 0.0)) for m in (0, 10))
    assert sum(described) == 2 * 2 * len(CENTRES)
    with_memo = replace(context, memo=Memo(10**8))
    for model, expected in ((0, alone), (10, other)):
        found = matched(matcher(pair), with_memo, model=shift_on_map(model, 0.0))
        np.testing.assert_array_equal(found.forward, expected.forward)
        np.testing.assert_array_equal(found.backward, expected.backward)
    assert sum(described) == (4 + 3) * len(CENTRES)


def test_one_way_is_the_same_as_the_first_of_both(pair: ImagePair, context: Context) -> None:
    both = matched(matcher(pair), context)
    places = Places(pair.grid, CENTRES, CHIP)
    images = matcher(pair).resampled(NOMINAL, pair.grid, RADIUS, context)
    centres, forward = matcher(pair).match_forward(images, places, RADIUS, context)
    np.testing.assert_array_equal(centres, both.centres)
    np.testing.assert_array_equal(forward, both.forward)


def test_what_is_known_already_is_taken_out(
    textured: TexturedPair, pair: ImagePair, context: Context
) -> None:
    found = matched(matcher(pair), context, model=textured.truth.model)
    assert np.abs(peaks(found.combined)).max() == 0


def test_chips_without_enough_valid_pixels_are_left_out(pair: ImagePair, context: Context) -> None:
    beyond = np.array([[-60, 60], [130, 120], [259, 239], [1000, 1000]])
    found = matched(matcher(pair), context, beyond)
    assert found.centres.tolist() == [[130, 120]]
    none = matched(matcher(pair), context, beyond[-1:])
    assert none.centres.shape == (0, 2)
    assert none.combined.shape == (0, 21, 21)
    assert none.radius_px == RADIUS


def test_the_log_has_why_chips_are_left_out_and_where(
    pair: ImagePair, context: Context, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.DEBUG, "groundtie"):
        matched(matcher(pair), context, np.array([[130, 120], [1000, 900]]))
    assert "a chip is not matched: 0 % of it are valid" in caplog.text
    assert "chips that are not matched lie at [[1000, 900]]" in caplog.text


def test_chips_that_are_held_out_are_left_out(pair: ImagePair, context: Context) -> None:
    def left_half(piece: Grid) -> np.ndarray:
        cols, rows = np.meshgrid(np.arange(piece.width), np.arange(piece.height))
        xy = piece.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
        return (pair.grid.map_to_pixel(xy)[:, 0] < 100).reshape(piece.height, piece.width)

    found = matched(matcher(pair, held_out=left_half), context)
    assert found.centres.tolist() == CENTRES[1:].tolist()


def test_progress_counts_chips_and_may_cancel(pair: ImagePair, context: Context) -> None:
    told: list[float] = []
    progress = Progress(lambda fraction, _: told.append(fraction))
    several = np.tile(CENTRES, (60, 1))
    matched(matcher(pair), replace(context, progress=progress), several)
    assert len(told) > 5
    assert np.diff(told).min() > 0
    assert told[-1] == 1
    with pytest.raises(CancelledError):
        cancelled = Progress(is_cancelled=lambda: True)
        matched(matcher(pair), replace(context, progress=cancelled))
