"""The coarse shift: candidates from one search over a reduced image."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import TexturedPair

from groundtie.context import Context
from groundtie.errors import RasterContentError
from groundtie.geometry.limits import SearchLimits
from groundtie.geometry.models import shift_model
from groundtie.matching import coarse_shift
from groundtie.matching.coarse_shift import Candidate, LevelSearch, level_factor
from groundtie.matching.far_places import FarSearch
from groundtie.pose.pose import Pose, PoseFound
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

SETTINGS = SimilaritySettings("orientation")


def candidates(
    pair: ImagePair, level: Grid, limits: SearchLimits, context: Context
) -> list[Candidate]:
    search = LevelSearch(replace(pair, limits=limits), level, SETTINGS, None, context)
    return search.candidates()


def shift_m(candidate: Candidate) -> tuple[float, ...]:
    return tuple(candidate.model([[0.0, 0.0]])[0])


def test_levels_are_no_larger_than_512_pixels() -> None:
    assert level_factor(utm_grid(300, 500)) == 1
    assert level_factor(utm_grid(1024, 100)) == 2
    assert level_factor(utm_grid(100, 5120)) == 10


def test_the_best_candidate_is_the_shift(pair: ImagePair, context: Context) -> None:
    found = candidates(pair, pair.grid, SearchLimits(140.0), context)
    assert shift_m(found[0]) == pytest.approx((70, -45), abs=2)
    assert [c.height for c in found] == sorted((c.height for c in found), reverse=True)
    places = np.array([shift_m(c) for c in found])
    gaps = np.abs(places[:, None] - places[None]).max(axis=2)[np.triu_indices(len(found), 1)]
    # Candidates are at least four pixels apart, except for their sub-pixel parts.
    assert (gaps > 30).all()


def test_candidates_on_a_coarser_level_are_in_map_units(pair: ImagePair, context: Context) -> None:
    level = pair.grid.scaled(2)
    found = candidates(pair, level, SearchLimits(140.0), context)
    assert shift_m(found[0]) == pytest.approx((70, -45), abs=6)


@pytest.mark.parametrize(("side", "period"), [(400, 40), (800, 64)])
def test_what_repeats_matches_as_well_some_periods_off(
    side: int, period: int, tmp_path: Path, context: Context
) -> None:
    """Also if something else was sown in each field, and beyond what is reduced for the search."""
    rng = np.random.default_rng(1)
    fields = side // period + 1
    paths = []
    for name in ("one", "other"):
        sown = np.kron(rng.uniform(200, 900, (fields, fields)), np.ones((period, period)))
        grown = sown[:side, :side] + rng.normal(0, 20, (side, side))
        paths.append(write_raster(tmp_path / f"{name}.tif", grown.astype(np.uint16)))
    with open_raster(paths[0]) as reference, open_raster(paths[1]) as input:
        pair = make_pair(Image(reference), Image(input))
        found = FarSearch.of(pair, pair.grid, shift_model(0.0, 0.0), context).whole()
    assert found.is_rival
    # Along columns and rows whole periods, so that squares of distances are sums of two squares.
    periods2 = (found.distance_px / period) ** 2
    sums = np.add.outer(np.arange(10) ** 2, np.arange(10) ** 2)
    assert np.abs(np.sqrt(sums) - np.sqrt(periods2)).min() * period < 2.5


def test_what_does_not_repeat_matches_at_the_truth_alone(
    textured: TexturedPair, pair: ImagePair, context: Context
) -> None:
    assert not FarSearch.of(pair, pair.grid, textured.truth.model, context).whole().is_rival
    # At a wrong model, the truth is the far place.
    wrong = shift_model(*(np.array([70.0, -45.0]) + [400.0, 0.0]))
    found = FarSearch.of(pair, pair.grid, wrong, context).whole()
    assert found.is_rival
    assert found.distance_px == pytest.approx(40.0, abs=2.0)


def test_low_candidates_of_any_search_are_left_out(
    pair: ImagePair, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    def poses(*given: object) -> list[PoseFound]:
        places = ((0.0, 10.0), (20.0, 4.1), (-20.0, 3.9))
        return [PoseFound(Pose(shift_px=(right, 0.0)), height) for right, height in places]

    monkeypatch.setattr(coarse_shift, "find_poses", poses)
    limits = SearchLimits(140.0, 10.0)
    found = candidates(pair, pair.grid, limits, context)
    assert [candidate.height for candidate in found] == [10.0, 4.1]


def test_what_repeats_matches_a_period_off_at_the_same_rotation(
    textured: TexturedPair, tmp_path: Path, context: Context
) -> None:
    tile = np.random.default_rng(1).integers(100, 1000, (40, 40)).astype(np.uint16)
    tiles = np.tile(tile, (6, 7))[:240, :260]
    one, other = (write_raster(tmp_path / f"{k}.tif", tiles, textured.grid) for k in range(2))
    period_m = 40 * textured.grid.pixel_size_m
    limits = SearchLimits(1.2 * period_m, 5.0)
    with open_raster(one) as reference, open_raster(other) as input:
        pair = make_pair(Image(reference), Image(input), None, limits.radius, 5.0)
        found = candidates(pair, pair.grid, limits, context)
    high = [one for one in found if one.height > 0.8 * found[0].height]
    centre = pair.grid.pixel_to_map([pair.grid.centre_px])
    moved_m = [np.hypot(*(one.model(centre) - centre)[0]) for one in high]
    # The true place, and at least one of its neighbours.
    assert min(moved_m) == pytest.approx(0, abs=0.05 * period_m)
    assert max(moved_m) == pytest.approx(period_m, rel=0.05)


@pytest.mark.parametrize("which", ["reference", "input"])
@pytest.mark.parametrize(("value", "text"), [(5, "constant"), (0, "no valid pixel")])
def test_images_without_content_are_named(
    textured: TexturedPair, tmp_path: Path, context: Context, which: str, value: int, text: str
) -> None:
    empty = np.full((240, 260), value, np.uint16)
    path = write_raster(tmp_path / "empty.tif", empty, textured.grid, nodata=0)
    paths = {"reference": textured.reference, "input": textured.input} | {which: path}
    with open_raster(paths["reference"]) as reference, open_raster(paths["input"]) as input:
        pair = make_pair(Image(reference), Image(input))
        with pytest.raises(RasterContentError, match=rf"empty\.tif.*{text}"):
            candidates(pair, pair.grid, SearchLimits(40.0), context)


@pytest.mark.parametrize("which", ["reference", "input"])
@pytest.mark.parametrize(
    ("content", "shown", "east_m", "text"),
    [
        ("texture", 0, 0.0, "the mask of {} leaves nothing of it where the images overlap"),
        ("texture", 1, 1e5, "the mask of {} leaves nothing of it where the images overlap"),
        ("nodata", 0, 0.0, "{} has no valid pixel where"),
        ("half", 1, 0.0, "what its mask leaves of {} is constant where"),
        ("constant", 1, 0.0, "{} is constant where"),
    ],
)
def test_a_mask_is_named_for_what_it_hides_and_nothing_else(
    textured: TexturedPair,
    tmp_path: Path,
    context: Context,
    which: str,
    content: str,
    shown: int,
    east_m: float,
    text: str,
) -> None:
    grid = textured.grid
    values = np.random.default_rng(0).integers(1, 1000, (240, 260)).astype(np.uint16)
    if content != "texture":
        # The pixels visible through the mask below, extended by the reach of interpolation.
        values[:200] = 0 if content == "nodata" else 5
    if content in ("nodata", "constant"):
        values[200:] = values[0, 0]
    kept = np.full((240, 260), shown, np.uint8)
    kept[150:] = 0
    image = write_raster(tmp_path / "a.tif", values, grid, nodata=0)
    mask = write_raster(tmp_path / "mask.tif", kept, grid.shifted(east_m, 0.0))
    paths = {"reference": textured.reference, "input": textured.input} | {which: image}
    with ExitStack() as stack:
        images = {
            name: Image(stack.enter_context(open_raster(path))) for name, path in paths.items()
        }
        images[which] = replace(images[which], mask=stack.enter_context(open_raster(mask)))
        pair = make_pair(images["reference"], images["input"])
        with pytest.raises(RasterContentError) as error:
            candidates(pair, pair.grid, SearchLimits(40.0), context)
    assert str(error.value).startswith(text.format(image))


def test_the_model_of_a_candidate_is_its_shift() -> None:
    model = shift_model(30.0, -20.0)
    np.testing.assert_allclose(model([[500_000.0, 4e6]]), [[500_030, 4e6 - 20]])
