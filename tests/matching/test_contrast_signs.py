from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from scipy.ndimage import gaussian_filter

from groundtie.context import Context
from groundtie.matching.chip_windows import Resampled
from groundtie.matching.contrast_signs import ContrastSigns, survey_signs
from groundtie.matching.survey import survey_places
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster

SIDE = 480


def signs_of(
    folder: Path, reference: np.ndarray, input: np.ndarray, context: Context
) -> ContrastSigns:
    paths = [
        write_raster(folder / f"{name}.tif", image.astype(np.float32), utm_grid(SIDE, SIDE))
        for name, image in (("reference", reference), ("input", input))
    ]
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=100.0)
        images = Resampled.of(pair, pair.input.source.grid.map_to_pixel, pair.grid, 33, context)
        return survey_signs(images, survey_places(pair.grid), context)


def speckle(seed: int) -> np.ndarray:
    return np.sqrt(np.random.default_rng(seed).gamma(1, 1, (SIDE, SIDE)))


def grey(seed: int) -> np.ndarray:
    """Return structure some 10 px in size, about 100 grey levels from dark to bright."""
    smooth = gaussian_filter(np.random.default_rng(seed).normal(size=(SIDE, SIDE)), 5)
    return 100 + 25 * smooth / smooth.std()


@pytest.mark.parametrize("opposite", [0.0, 0.3, 1.0])
def test_shares_are_those_of_fields_with_the_same_and_with_opposite_contrast(
    opposite: float, tmp_path: Path, context: Context
) -> None:
    sign = np.ones((SIDE, SIDE))
    sign[: round(opposite * SIDE)] = -1
    ground = grey(1)
    radar = ground * speckle(2)
    signs = signs_of(tmp_path, radar, 100 + sign * (ground - 100), context)
    assert signs.negative == pytest.approx(opposite, abs=0.15)
    assert signs.positive == pytest.approx(1 - opposite, abs=0.15)


def test_a_layer_over_different_grounds_has_one_sign(tmp_path: Path, context: Context) -> None:
    layer = grey(3)
    blended = [0.5 * layer + 0.5 * ground for ground in (grey(4) * speckle(5), grey(6))]
    signs = signs_of(tmp_path, blended[0], blended[1], context)
    assert signs.positive > 0.8
    assert signs.negative == 0


def test_noise_has_either_sign_as_often(tmp_path: Path, context: Context) -> None:
    noise = np.random.default_rng(8).normal(100, 5, (SIDE, SIDE))
    signs = signs_of(tmp_path, 100 * speckle(9), noise, context)
    assert max(signs.positive, signs.negative) < 0.15


def test_constant_windows_have_no_sign(tmp_path: Path, context: Context) -> None:
    signs = signs_of(tmp_path, grey(7), np.full((SIDE, SIDE), 40.0), context)
    assert signs == ContrastSigns(0, 0)
