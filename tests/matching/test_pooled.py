from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import everywhere, rms, shift_on_map, write_textured_pair

from groundtie.errors import NothingFoundError, TooFewPointsError
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.matching.layout import lay_out_chips
from groundtie.matching.local import LocalSearch
from groundtie.matching.pooled import tile_centres
from groundtie.matching.pyramid import find_coarse_model
from groundtie.matching.rough import RoughSearch
from groundtie.progress import SILENT
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import ImagePair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

SIZE = (420, 400)
RADIUS_M = 200.0


def lines(size: tuple[int, int], every: int = 30) -> np.ndarray:
    """Return a mask of roads three pixels wide, a fifth of the image."""
    cols, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    return ((cols % every < 3) | (rows % every < 3)).astype(np.uint8)


def stretched() -> Model:
    """A shift by 6 and 4 pixels, and 0.4 % of stretch and shear: 0.8 px at the border."""
    frame = Frame.around(utm_grid(*SIZE).pixel_to_map([[0, 0], [SIZE[0] - 1, SIZE[1] - 1]]))
    scale = frame.to_map.a
    return PolynomialModel(
        "affine", frame, np.array([[60.0, -40.0], [8.0, 0.0], [6.0, -8.0]]) / scale
    )


@contextmanager
def masked(
    folder: Path, model: Model, masks: np.ndarray, input: bool = False, **more: int
) -> Iterator[tuple[ImagePair, Model]]:
    """Open a pair of which a mask on one image takes part."""
    files = write_textured_pair(folder, SIZE, model, **more)
    path = write_raster(folder / "mask.tif", masks, files.grid)
    with files.opened() as pair, open_raster(path) as mask:
        name = "input" if input else "reference"
        yield replace(pair, **{name: replace(getattr(pair, name), mask=mask)}), files.truth.model


def search_of(pair: ImagePair) -> LocalSearch:
    return LocalSearch(pair, lay_out_chips(pair), SimilaritySettings()).of_ground(pair)


@pytest.mark.slow
@pytest.mark.parametrize("input", [False, True], ids=["reference", "input"])
def test_lines_alone_are_registered(tmp_path: Path, executor: Executor, input: bool) -> None:
    with masked(tmp_path, stretched(), lines(SIZE), input) as (pair, truth):
        search = search_of(pair)
        coarse = find_coarse_model(pair, search, RoughSearch(RADIUS_M), executor, SILENT)
        estimate = search.estimate(coarse, "auto", 0, executor)
        assert estimate.transform.model.kind == "affine"
        xy = everywhere(pair.reference.source.grid)
        assert rms(estimate.transform.model(xy) - truth(xy)) / 10 < 0.3
        check = search.check_points(estimate.transform.model, executor)
        assert check.is_check.all() and len(check) >= 4
        errors = check.take(check.used).residual_on(pair.grid, estimate.transform)
        assert rms(errors) < 1
        centres = np.rint(pair.grid.map_to_pixel(check.reference_xy)).astype(int)
        surfaces = search.check_surfaces(estimate.transform.model, centres[::-1])
        heights = surfaces.max(axis=(1, 2))[::-1]
        np.testing.assert_allclose(heights, check.score, rtol=1e-4)


@pytest.mark.slow
def test_check_points_that_lie_elsewhere_say_so(tmp_path: Path, executor: Executor) -> None:
    with masked(tmp_path, shift_on_map(60.0, -40.0), lines(SIZE)) as (pair, truth):
        search = search_of(pair)
        assert search.common_shift_px(truth, executor) < 0.3
        off = shift_on_map(60.0 + 30.0, -40.0 + 40.0)
        assert search.common_shift_px(off, executor) == pytest.approx(5.0, abs=0.5)


@pytest.mark.slow
def test_a_pyramid_leads_down_to_the_ground(tmp_path: Path, executor: Executor) -> None:
    """The rough search is at pixels three times as large, of roads three times as wide."""
    size = (1600, 500)
    model = shift_on_map(110.0, -70.0)
    files = write_textured_pair(tmp_path, size, model)
    path = write_raster(tmp_path / "mask.tif", lines(size, 60), files.grid)
    with files.opened() as plain, open_raster(path) as mask:
        pair = replace(plain, reference=replace(plain.reference, mask=mask))
        search = search_of(pair)
        found = find_coarse_model(pair, search, RoughSearch(RADIUS_M), executor, SILENT)
        xy = everywhere(files.grid)
        assert rms(found(xy) - model(xy)) / 10 < 4


@pytest.mark.slow
def test_another_place_is_refused_or_judged_badly(tmp_path: Path, executor: Executor) -> None:
    with masked(tmp_path, shift_on_map(0, 0), lines(SIZE), input_seed=5) as (pair, _):
        search = search_of(pair)
        try:
            coarse = find_coarse_model(pair, search, RoughSearch(RADIUS_M), executor, SILENT)
        except NothingFoundError:
            return
        model = search.estimate(coarse, "auto", 0, executor).transform
        check = search.check_points(model.model, executor)
        residuals = check.residual_on(pair.grid, model)
        assert (np.hypot(*residuals.T) <= 2).mean() < 0.25


def test_hardly_any_ground_is_said(tmp_path: Path, executor: Executor) -> None:
    little = np.zeros(SIZE[::-1], np.uint8)
    little[:60, :60] = 1
    with (
        masked(tmp_path, shift_on_map(0, 0), little) as (pair, truth),
        pytest.raises(TooFewPointsError, match="the mask leaves only about 3"),
    ):
        search_of(pair).estimate(truth, "auto", 0, executor)


def test_tiles_cover_the_grid_side_by_side() -> None:
    grid = Grid(utm_grid(200, 130).transform, None, 200, 130)
    seen = np.zeros((130, 200), int)
    for col, row in tile_centres((grid.width, grid.height), 25):
        seen[row - 12 : row + 13, col - 12 : col + 13] += 1
    assert seen.min() >= 0 and seen.max() == 1
    assert seen[:125].min() == 1
