from __future__ import annotations

from pathlib import Path

import numpy as np
from raster_files import write_raster
from textured_pairs import TexturedPair, rms, shift_on_map, with_hole_around

from groundtie.context import Context
from groundtie.geometry.models import Model
from groundtie.matching.check import CHECK_RADIUS_PX, Check, check_model
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.held_out import HeldOut
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

SETTINGS = SimilaritySettings("orientation")

# Wrong by three pixels along each axis, more than a fitted model.
COARSE = shift_on_map(40.0, -15.0)


def checked(pair: ImagePair, model: Model, context: Context) -> Check:
    held_out = HeldOut.of(pair)
    return check_model(ChipMatcher(pair, SETTINGS, held_out), held_out.layout, model, context)


def test_check_points_search_around_the_model_alone(
    textured: TexturedPair, pair: ImagePair, context: Context
) -> None:
    check = checked(pair, COARSE, context).points
    assert check.is_check.all()
    assert len(check) == len(HeldOut.of(pair).layout.check_centres)
    assert rms((check.input_px - textured.truth(check.reference_xy))[check.used]) < 0.5
    # The matches of check points are not drawn towards the model under test.
    elsewhere = checked(pair, shift_on_map(95.0, -65.0), context).points
    np.testing.assert_allclose(elsewhere.input_px, check.input_px, atol=0.5)


def test_check_surfaces_are_those_of_the_check_points(pair: ImagePair, context: Context) -> None:
    check = checked(pair, shift_on_map(70.0, -45.0), context)
    surfaces = check.surfaces[:2]
    side = 2 * CHECK_RADIUS_PX + 1
    assert surfaces.shape == (2, side, side)
    peaks = surfaces.reshape(2, -1).argmax(axis=1)
    assert np.abs(np.array(np.unravel_index(peaks, (side, side))) - side // 2).max() <= 1
    np.testing.assert_allclose(surfaces.max(axis=(1, 2)), check.points.score[:2], rtol=1e-5)
    assert len(check.surfaces) == len(check.points)


def test_a_check_chip_without_a_place_in_the_input_is_none(
    pair: ImagePair, context: Context
) -> None:
    """As in an image with RPCs, where the ground's height is not known."""
    model = shift_on_map(70.0, -45.0)
    holed = with_hole_around(pair, HeldOut.of(pair).layout.check_centres[0])
    check = checked(holed, model, context)
    assert np.isfinite(check.points.input_px).all()
    assert len(check.surfaces) == len(check.points)
    assert len(check.points) == len(checked(pair, model, context).points) - 1


def test_few_check_chips_with_content(
    textured: TexturedPair, tmp_path: Path, context: Context
) -> None:
    values = np.zeros_like(textured.reference_values)
    values[100:150, 100:160] = textured.reference_values[100:150, 100:160]
    path = write_raster(tmp_path / "patch.tif", values, textured.grid, nodata=0)
    with open_raster(path) as reference, open_raster(textured.input) as input:
        pair = make_pair(Image(reference), Image(input))
        assert len(checked(pair, COARSE, context).points) <= 4


def test_nothing_to_check_lies_nowhere(pair: ImagePair, context: Context) -> None:
    assert len(checked(pair, shift_on_map(1e6, 0.0), context).points) == 0
