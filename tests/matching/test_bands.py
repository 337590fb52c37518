"""Bands of one image that show another place than those that are matched."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import write_raster
from textured_pairs import shift_on_map, texture

from groundtie.context import Context
from groundtie.matching.bands import BandSurvey, survey_bands
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.parts import ELSEWHERE_PX
from groundtie.matching.survey import survey_places
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

SIDE, MARGIN = 340, 30
SHIFT = (12, -9)


def place(shift: tuple[int, int] = (0, 0), seed: int = 0, noise_seed: int = 1) -> np.ndarray:
    """Return a band of a place that is moved by a shift (x, y), with noise of its own."""
    canvas = texture(SIDE + 2 * MARGIN, SIDE + 2 * MARGIN, seed)
    top, left = MARGIN - shift[1], MARGIN - shift[0]
    noise = np.random.default_rng(noise_seed).normal(size=(SIDE, SIDE))
    return canvas[top : top + SIDE, left : left + SIDE] + 0.3 * noise


def asked(
    folder: Path,
    reference: list[np.ndarray],
    input: list[np.ndarray],
    context: Context,
    band: int | None = None,
) -> tuple[BandSurvey, ...]:
    """Ask the bands of two images, of which one band of the input may be chosen."""
    paths = [
        write_raster(folder / f"{name}.tif", (1000 + 200 * np.stack(bands)).astype(np.uint16))
        for name, bands in (("reference", reference), ("input", input))
    ]
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other, band), search_radius_m=50.0)
        matcher = ChipMatcher(pair, SimilaritySettings())
        places = survey_places(pair.grid)
        return survey_bands(matcher, shift_on_map(0.0, 0.0), places, ELSEWHERE_PX, context)


def test_bands_that_coincide_are_not_matched_apart(tmp_path: Path, context: Context) -> None:
    bands = [place(noise_seed=seed) for seed in (2, 3, 4)]
    assert asked(tmp_path, [place()], [place(noise_seed=2)], context) == ()
    assert asked(tmp_path, bands, [place(noise_seed=5), -bands[0]], context) == ()


@pytest.mark.slow
@pytest.mark.parametrize("image", ["reference", "input"])
def test_a_band_of_ground_elsewhere_is_found(image: str, tmp_path: Path, context: Context) -> None:
    """Where it is found, its mean surface is highest at the shift, and not before."""
    bands = [place(noise_seed=2), place(SHIFT, noise_seed=3), place(SHIFT, noise_seed=4)]
    images = ([place()], bands) if image == "input" else (bands, [place()])
    right, wrong = asked(tmp_path, *images, context)
    assert (right.image, right.band, right.survey.is_elsewhere) == (image, 1, False)
    assert (wrong.image, wrong.band, wrong.survey.is_elsewhere) == (image, 2, True)
    mean = wrong.survey.mean
    row, col = np.subtract(np.unravel_index(mean.argmax(), mean.shape), len(mean) // 2)
    found = (col, row) if image == "input" else (-col, -row)
    np.testing.assert_allclose(found, SHIFT, atol=1)


@pytest.mark.slow
def test_a_chosen_band_is_not_matched_again(tmp_path: Path, context: Context) -> None:
    bands = [place(SHIFT, noise_seed=3), place(noise_seed=2), place(noise_seed=4)]
    (elsewhere,) = asked(tmp_path, [place()], bands, context, band=3)
    assert (elsewhere.band, elsewhere.survey.is_elsewhere) == (1, True)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["mask", "noise", "other place"])
def test_bands_that_match_nowhere_are_no_evidence(
    kind: str, tmp_path: Path, context: Context
) -> None:
    other = {
        "mask": np.sign(place(seed=7) - np.random.default_rng(1).normal()),
        "noise": np.random.default_rng(8).normal(size=(SIDE, SIDE)),
        "other place": place(seed=9),
    }
    found = asked(tmp_path, [place()], [place(noise_seed=2), other[kind]], context)
    assert [one.band for one in found] == [1, 2]
    assert not any(one.survey.is_elsewhere for one in found)


@pytest.mark.slow
def test_of_many_bands_few_are_asked(tmp_path: Path, context: Context) -> None:
    bands = [place(seed=seed, noise_seed=seed) for seed in range(2, 9)]
    found = asked(tmp_path, [place()], bands, context)
    assert [one.band for one in found] == [1, 3, 5, 7]
