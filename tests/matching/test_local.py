from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import pytest
from raster_files import write_raster
from textured_pairs import TexturedPair, everywhere, rms, shift_on_map, write_textured_pair

from groundtie.errors import TooFewPointsError
from groundtie.geometry.models import KINDS, Model
from groundtie.matching.layout import lay_out_chips
from groundtie.matching.local import AUTO, LocalSearch
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

SETTINGS = SimilaritySettings("orientation")

# Off by three pixels along each axis, as a coarse model may be.
COARSE = shift_on_map(40.0, -15.0)


def search_of(pair: ImagePair, **more: float) -> LocalSearch:
    return LocalSearch(pair, lay_out_chips(pair), SETTINGS, **more)


def error_px(model: Model, files: TexturedPair) -> float:
    xy = everywhere(files.grid)
    return rms(model(xy) - files.truth.model(xy)) / 10


@pytest.mark.slow
@pytest.mark.parametrize("kind", [AUTO, *KINDS])
def test_every_model_is_fitted_from_a_coarse_one(
    textured: TexturedPair, pair: ImagePair, executor: Executor, kind: str
) -> None:
    estimate = search_of(pair).estimate(COARSE, kind, 0, executor)
    model = estimate.transform.model
    assert model.kind == ("translation" if kind == AUTO else kind)
    assert error_px(model, textured) < (0.5 if kind == "tps" else 0.2)
    assert not estimate.points.is_check.any()
    assert len(estimate.fold_models) >= 4
    # Folds speak of pixels of the matching grid: the input lies 7 columns and 4.5 rows further.
    at = np.array([[130.0, 120.0]])
    for fold in estimate.fold_models:
        assert np.abs(fold(at) - at - [7.0, 4.5]).max() < 0.7
    assert estimate.spread_px(at)[0] < 1


@pytest.mark.slow
def test_tie_points_are_places_in_both_images(
    textured: TexturedPair, pair: ImagePair, executor: Executor
) -> None:
    search = search_of(pair)
    points = search.estimate(COARSE, "translation", 0, executor).points
    right = points.take(points.used)
    assert len(right) > 0.8 * len(search.layout.fit_centres)
    px = textured.grid.map_to_pixel(right.reference_xy)
    assert {tuple(p) for p in np.rint(px).astype(int)} <= {
        tuple(c) for c in search.layout.fit_centres
    }
    errors = right.input_px - textured.truth(right.reference_xy)
    assert rms(errors) < 0.5
    # What the surfaces say of their peaks' scatter is neither far too bold nor far too modest.
    told = np.sqrt(np.trace(right.covariance_px2, axis1=1, axis2=2).mean())
    assert 0.3 < told / rms(errors) < 6
    assert (right.two_way_error_px <= search.two_way_px).all()
    assert (right.score > 3).all()


def test_check_points_search_around_the_model_alone(
    textured: TexturedPair, pair: ImagePair, executor: Executor
) -> None:
    search = search_of(pair)
    check = search.check_points(COARSE, executor)
    assert check.is_check.all()
    assert len(check) == len(search.layout.check_centres)
    assert rms((check.input_px - textured.truth(check.reference_xy))[check.used]) < 0.5
    # Their matches do not lean towards the model that they are to judge.
    elsewhere = search.check_points(shift_on_map(95.0, -65.0), executor)
    np.testing.assert_allclose(elsewhere.input_px, check.input_px, atol=0.5)


def test_check_surfaces_are_those_of_the_check_points(pair: ImagePair, executor: Executor) -> None:
    search = search_of(pair)
    model = shift_on_map(70.0, -45.0)
    centres = search.layout.check_centres[:2]
    surfaces = search.check_surfaces(model, centres)
    side = 2 * search.check_radius_px + 1
    assert surfaces.shape == (2, side, side)
    peaks = surfaces.reshape(2, -1).argmax(axis=1)
    assert np.abs(np.array(np.unravel_index(peaks, (side, side))) - side // 2).max() <= 1
    check = search.check_points(model, executor)
    np.testing.assert_allclose(surfaces.max(axis=(1, 2)), check.score[:2], rtol=1e-5)


@pytest.mark.slow
def test_a_strict_two_way_limit_rejects_points(pair: ImagePair, executor: Executor) -> None:
    strict = search_of(pair, two_way_px=0.05).estimate(COARSE, "translation", 0, executor)
    rejected = strict.points.take(~strict.points.used)
    assert 0 < strict.points.used.sum() < len(strict.points)
    assert np.char.find(rejected.state, "two-way error above 0.05 px").max() >= 0
    assert (strict.points.take(strict.points.used).two_way_error_px <= 0.05).all()


@pytest.mark.slow
def test_a_model_that_no_point_agrees_with_is_none(pair: ImagePair, executor: Executor) -> None:
    """No match back meets its start to the last digit."""
    with pytest.raises(TooFewPointsError, match="points agree"):
        search_of(pair, two_way_px=0.0).estimate(COARSE, "affine", 0, executor)


def test_too_few_chips_with_content(
    textured: TexturedPair, tmp_path: Path, executor: Executor
) -> None:
    values = np.zeros_like(textured.reference_values)
    values[100:150, 100:160] = textured.reference_values[100:150, 100:160]
    path = write_raster(tmp_path / "patch.tif", values, textured.grid, nodata=0)
    with open_raster(path) as reference, open_raster(textured.input) as input:
        pair = make_pair(Image(reference), Image(input))
        with pytest.raises(TooFewPointsError, match="only"):
            search_of(pair).estimate(COARSE, "affine", 0, executor)
        assert len(search_of(pair).check_points(COARSE, executor)) <= 4


@pytest.mark.slow
def test_the_model_reaches_the_input_through_its_own_georeferencing(
    tmp_path: Path, executor: Executor
) -> None:
    """An input of larger pixels: positions count in its own pixels, not in matching ones."""
    files = write_textured_pair(tmp_path, (420, 400), shift_on_map(50, 30), input_pixel_ratio=2.0)
    with files.opened() as pair:
        estimate = search_of(pair).estimate(shift_on_map(20, 10), "translation", 0, executor)
    assert estimate.transform.input_grid == files.truth.input_grid
    right = estimate.points.take(estimate.points.used)
    assert rms(right.input_px - files.truth(right.reference_xy)) < 0.5
    assert rms(right.residual_px(estimate.transform)) < 0.5


@pytest.mark.slow
def test_the_seed_decides(pair: ImagePair, executor: Executor) -> None:
    found = [search_of(pair).estimate(COARSE, "affine", 5, executor) for _ in range(2)]
    assert found[0].transform.to_json() == found[1].transform.to_json()


def test_held_out_pixels_are_the_same_at_any_level(pair: ImagePair) -> None:
    """On its own pixels as the layout says; on larger ones also what they see of a block."""
    search = search_of(pair)
    grid = pair.grid
    cols, rows = np.meshgrid(np.arange(float(grid.width)), np.arange(float(grid.height)))
    px = np.column_stack([cols.ravel(), rows.ravel()])
    exact = search.layout.held_out(px).reshape(cols.shape)
    np.testing.assert_array_equal(search.held_out(grid), exact)
    window = grid.window(37, 51, 90, 70)
    np.testing.assert_array_equal(search.held_out(window), exact[51:121, 37:127])
    for factor in (2.0, 3.7):
        level = grid.scaled(factor)
        mask = search.held_out(level)
        centres = np.rint(np.array([(np.arange(n) + 0.5) * factor - 0.5 for n in (40, 40)])).astype(
            int
        )
        seen = exact[np.ix_(centres[1], centres[0])]
        assert mask[:40, :40][seen].all()
        # By the reach of the kernel and no more: five pixels of the level a side of a block.
        blocks = search.layout.columns.cells * search.layout.rows.cells
        side = search.layout.columns.block / factor + 7
        assert mask.sum() <= blocks * side**2
