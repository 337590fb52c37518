"""Repetitive places match more than once; the search refuses instead of guessing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import texture

from groundtie.context import threads
from groundtie.errors import AmbiguousPlaceError
from groundtie.geometry.limits import SearchLimits
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.held_out import HeldOut
from groundtie.matching.pyramid import find_coarse_model
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

PERIOD_PX = 40
SIZE_PX = 360


def coarse_shift_px(folder: Path, values: np.ndarray, radius_m: float) -> np.ndarray:
    """Return the shift (x, y) found between values and their negative, cropped 9 px further on."""
    noise = np.random.default_rng(3).normal(scale=0.2, size=values.shape)
    reference = (1000 + 200 * (values + noise))[:SIZE_PX, :SIZE_PX]
    input = (1000 - 200 * values)[9 : SIZE_PX + 9, 9 : SIZE_PX + 9]
    grid = utm_grid(SIZE_PX, SIZE_PX)
    first = write_raster(folder / "reference.tif", reference.astype(np.uint16), grid)
    second = write_raster(folder / "input.tif", input.astype(np.uint16), grid)
    with (
        open_raster(first) as one,
        open_raster(second) as other,
        threads(2) as context,
    ):
        pair = replace(make_pair(Image(one), Image(other)), limits=SearchLimits(radius_m))
        held_out = HeldOut.of(pair)
        matcher = ChipMatcher(pair, SimilaritySettings("orientation"), held_out)
        model = find_coarse_model(matcher, context)
        centre = grid.pixel_to_map([grid.centre_px])
        return (grid.map_to_pixel(model(centre)) - [grid.centre_px])[0]


def tiled() -> np.ndarray:
    # The tile continues smoothly into itself: it is a texture on a torus.
    spectrum = np.fft.fft2(texture(PERIOD_PX, PERIOD_PX, 4))
    frequency = np.hypot(*np.meshgrid(*[np.fft.fftfreq(PERIOD_PX)] * 2))
    tile = np.fft.ifft2(spectrum * np.exp(-((frequency / 0.15) ** 2))).real
    return np.tile(tile / tile.std(), (11, 11))


@pytest.mark.slow
def test_a_place_that_repeats_itself_within_the_radius_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AmbiguousPlaceError, match="two places match about as well"):
        coarse_shift_px(tmp_path, tiled(), radius_m=500.0)


@pytest.mark.slow
def test_it_is_found_if_it_does_not_within_the_radius(tmp_path: Path) -> None:
    shift = coarse_shift_px(tmp_path, tiled(), radius_m=200.0)
    np.testing.assert_allclose(shift, [-9, -9], atol=1)


@pytest.mark.slow
def test_a_place_that_does_not_repeat_itself_is_found(tmp_path: Path) -> None:
    shift = coarse_shift_px(tmp_path, texture(400, 400, 5), radius_m=500.0)
    np.testing.assert_allclose(shift, [-9, -9], atol=1)
