"""The rough shift, models of degree 1 on a level, and the way down the pyramid."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import (
    TexturedPair,
    everywhere,
    rms,
    shift_on_map,
    write_textured_pair,
)

from groundtie.errors import CancelledError, RasterContentError
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.matching.coarse import refine_on_level
from groundtie.matching.layout import lay_out_chips
from groundtie.matching.local import LocalSearch
from groundtie.matching.pyramid import find_coarse_model
from groundtie.matching.rough import (
    Candidate,
    RoughSearch,
    level_factor,
    rough_candidates,
    shift_model,
)
from groundtie.pose.pose import Pose, PoseFound
from groundtie.progress import SILENT, Progress
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

SETTINGS = SimilaritySettings("orientation")


def nothing_held_out(piece: Grid) -> np.ndarray:
    return np.zeros((piece.height, piece.width), bool)


def search_of(pair: ImagePair) -> LocalSearch:
    return LocalSearch(pair, lay_out_chips(pair), SETTINGS)


def shift_m(candidate: Candidate) -> tuple[float, ...]:
    return tuple(candidate.model([[0.0, 0.0]])[0])


def error_m(model: Model, files: TexturedPair) -> float:
    xy = everywhere(files.grid)
    return rms(model(xy) - files.truth.model(xy))


def turned(shift: tuple[float, float], degrees: float, growth: float = 1.0) -> Model:
    """Return a misregistration by rotation, scale and shift (in metres) about the centre."""
    frame = Frame.around(utm_grid(260, 240).pixel_to_map([[0, 0], [259, 239]]))
    cos, sin = growth * np.cos(np.deg2rad(degrees)), growth * np.sin(np.deg2rad(degrees))
    offset = np.array(shift) / frame.to_map.a
    return PolynomialModel("similarity", frame, np.array([offset, [cos - 1, sin], [-sin, cos - 1]]))


def test_levels_are_no_larger_than_512_pixels() -> None:
    assert level_factor(utm_grid(300, 500)) == 1
    assert level_factor(utm_grid(1024, 100)) == 2
    assert level_factor(utm_grid(100, 5120)) == 10


def test_the_best_candidate_is_the_shift(pair: ImagePair, executor: Executor) -> None:
    found = rough_candidates(
        pair, pair.grid, RoughSearch(140.0), SETTINGS, nothing_held_out, executor
    )
    assert shift_m(found[0]) == pytest.approx((70, -45), abs=2)
    assert [c.height for c in found] == sorted((c.height for c in found), reverse=True)
    places = np.array([shift_m(c) for c in found])
    gaps = np.abs(places[:, None] - places[None]).max(axis=2)[np.triu_indices(len(found), 1)]
    # Candidates are at least four pixels apart, but for their sub-pixel parts.
    assert (gaps > 30).all()


def test_candidates_on_a_coarser_level_are_in_map_units(
    pair: ImagePair, executor: Executor
) -> None:
    level = pair.grid.scaled(2)
    found = rough_candidates(pair, level, RoughSearch(140.0), SETTINGS, nothing_held_out, executor)
    assert shift_m(found[0]) == pytest.approx((70, -45), abs=6)


def test_low_candidates_of_any_search_are_left_out(pair: ImagePair, executor: Executor) -> None:
    def poses(*given: object) -> list[PoseFound]:
        places = ((0.0, 10.0), (20.0, 4.1), (-20.0, 3.9))
        return [PoseFound(Pose(shift_px=(right, 0.0)), height) for right, height in places]

    rough = RoughSearch(140.0, 10.0, (1.0, 1.0), poses)
    found = rough_candidates(pair, pair.grid, rough, SETTINGS, nothing_held_out, executor)
    assert [candidate.height for candidate in found] == [10.0, 4.1]


@pytest.mark.parametrize("which", ["reference", "input"])
@pytest.mark.parametrize(("value", "text"), [(5, "constant"), (0, "no valid pixel")])
def test_images_without_content_are_named(
    textured: TexturedPair, tmp_path: Path, executor: Executor, which: str, value: int, text: str
) -> None:
    empty = np.full((240, 260), value, np.uint16)
    path = write_raster(tmp_path / "empty.tif", empty, textured.grid, nodata=0)
    paths = {"reference": textured.reference, "input": textured.input} | {which: path}
    with open_raster(paths["reference"]) as reference, open_raster(paths["input"]) as input:
        pair = make_pair(Image(reference), Image(input))
        with pytest.raises(RasterContentError, match=rf"empty\.tif.*{text}"):
            rough_candidates(
                pair, pair.grid, RoughSearch(40.0), SETTINGS, nothing_held_out, executor
            )


def test_the_model_of_a_candidate_is_its_shift() -> None:
    model = shift_model(30.0, -20.0)
    np.testing.assert_allclose(model([[500_000.0, 4e6]]), [[500_030, 4e6 - 20]])


@pytest.mark.slow
@pytest.mark.parametrize(("degrees", "growth"), [(0.0, 1.0), (2.0, 1.0), (-1.5, 1.02)])
def test_a_level_corrects_a_model_that_is_off(
    tmp_path: Path, executor: Executor, degrees: float, growth: float
) -> None:
    files = write_textured_pair(tmp_path, (260, 240), turned((70, -45), degrees, growth))
    with files.opened() as pair:
        start = shift_on_map(40.0, -20.0)
        found = refine_on_level(pair, pair.grid, start, 12, SETTINGS, nothing_held_out, executor)
    assert found.log10_false_alarms < -6
    assert error_m(found.model, files) < 10  # a pixel


@pytest.mark.slow
def test_a_correction_comes_before_the_model_that_is_known(
    tmp_path: Path, executor: Executor
) -> None:
    """From a model that turns already: what is left is seen on the grid, not on the claimed map."""
    files = write_textured_pair(tmp_path, (260, 240), turned((70, -45), 4.0))
    with files.opened() as pair:
        start = turned((20, 10), 3.0)
        found = refine_on_level(pair, pair.grid, start, 12, SETTINGS, nothing_held_out, executor)
    assert error_m(found.model, files) < 10


@pytest.mark.slow
def test_two_places_have_nothing_in_common(other_place: TexturedPair, executor: Executor) -> None:
    with other_place.opened() as pair:
        start = shift_on_map(0, 0)
        found = refine_on_level(pair, pair.grid, start, 12, SETTINGS, nothing_held_out, executor)
        assert found.log10_false_alarms > -2


def test_too_few_chips_tell_nothing(pair: ImagePair, executor: Executor) -> None:
    start = shift_on_map(5000.0, 0.0)
    found = refine_on_level(pair, pair.grid, start, 12, SETTINGS, nothing_held_out, executor)
    assert found.log10_false_alarms == np.inf
    assert found.model is start


@pytest.mark.slow
@pytest.mark.parametrize("size", [(260, 240), (700, 200)])
def test_from_the_rough_shift_to_a_model(
    tmp_path: Path, executor: Executor, size: tuple[int, int]
) -> None:
    files = write_textured_pair(tmp_path, size, shift_on_map(-90.0, 110.0))
    with files.opened() as pair:
        model = find_coarse_model(pair, search_of(pair), RoughSearch(200.0), executor, SILENT)
    assert model is not None
    assert error_m(model, files) < 10


@pytest.mark.slow
def test_a_radius_larger_than_the_scene_is_no_more_work_than_the_scene(
    textured: TexturedPair, pair: ImagePair, executor: Executor
) -> None:
    """A thousand kilometres: beyond the scene's size nothing is left to compare."""
    model = find_coarse_model(pair, search_of(pair), RoughSearch(1e6), executor, SILENT)
    assert model is not None
    assert error_m(model, textured) < 10


def test_cancelling(pair: ImagePair, executor: Executor) -> None:
    progress = Progress(is_cancelled=lambda: True)
    with pytest.raises(CancelledError):
        find_coarse_model(pair, search_of(pair), RoughSearch(200.0), executor, progress)
