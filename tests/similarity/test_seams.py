"""Seams: steps between neighbouring columns or rows that both arrays have."""

from __future__ import annotations

import numpy as np
import pytest
from speckled_pairs import whole
from textured_pairs import texture

from groundtie.similarity.seams import DRAWN_WIDTH, seams, step_products, step_width

SIDE = 240
COLUMNS, ROWS = (31, 61, 104, 140, 190, 215), (50, 97, 171, 220)


def view(place: int, seed: int) -> np.ndarray:
    """Return a view of a place with independent speckle (3 looks)."""
    ground = np.exp(0.5 * texture(SIDE, SIDE, place))
    return 100 * ground * np.random.default_rng(seed).gamma(3.0, 1 / 3.0, ground.shape)


def tiled(values: np.ndarray, offset: int = 0) -> np.ndarray:
    """Return an image with alternately darker and brighter tiles, aligned with columns and rows."""
    row, col = (
        np.searchsorted(at, np.arange(SIDE) - offset, side="right") for at in (ROWS, COLUMNS)
    )
    return values * np.where(row[:, None] % 2, 0.5, 1.5) * np.where(col % 2, 0.5, 1.5)


def width(one: np.ndarray, other: np.ndarray) -> float:
    return step_width(step_products(whole(one), whole(other)))


@pytest.mark.parametrize("offset", [0, 1, -1])
def test_tiles_over_different_ground_have_their_seams_in_common(offset: int) -> None:
    """At the largest offset that a transform to whole pixels may have."""
    assert width(tiled(view(1, 1)), tiled(view(9, 2), offset)) < DRAWN_WIDTH


def test_ground_has_none_in_common() -> None:
    assert width(view(1, 1), view(1, 2)) > 1.5 * DRAWN_WIDTH
    assert width(view(1, 1), view(9, 2)) > 1.5 * DRAWN_WIDTH
    # Tiles in only one image, or at different places.
    assert width(tiled(view(1, 1)), view(9, 2)) > 1.5 * DRAWN_WIDTH
    assert width(tiled(view(1, 1)), tiled(view(9, 2), 6)) > 1.5 * DRAWN_WIDTH


def test_edges_of_the_ground_along_columns_are_blurred() -> None:
    """By a point spread function of one pixel, without noise that would hide them."""
    at = np.arange(SIDE)
    fields = 1 + sum(1 / (1 + np.exp(-(at - edge) / 0.6)) for edge in (40, 90, 155, 201))
    one, other = (fields[None] * np.exp(0.05 * view(place, place) / 100) for place in (1, 9))
    assert 1.5 * DRAWN_WIDTH < width(one, other) < 1


def test_where_nothing_varies_there_are_none() -> None:
    assert width(np.ones((SIDE, SIDE)), np.ones((SIDE, SIDE))) == np.inf


def test_pixels_on_both_sides_of_seams_are_masked_and_few_others() -> None:
    mask = seams(whole(tiled(view(1, 1))), whole(tiled(view(9, 2))))
    beside = np.zeros_like(mask)
    for at in COLUMNS:
        beside[:, at - 1 : at + 1] = True
    for at in ROWS:
        beside[at - 1 : at + 1] = True
    assert mask[beside].mean() > 0.8
    assert mask[~beside].mean() < 0.02
