from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import everywhere, rms, shift_on_map, write_textured_pair

from groundtie.context import Context
from groundtie.errors import NothingFoundError, TooFewPointsError
from groundtie.geometry.estimation import Estimate
from groundtie.geometry.limits import SearchLimits
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.matching.check import Check, check_model
from groundtie.matching.held_out import HeldOut
from groundtie.matching.matcher import ChipSurfaces, Places
from groundtie.matching.pooled import PooledHistogramMatcher
from groundtie.matching.pyramid import find_coarse_model
from groundtie.matching.surface_fit import SurfaceFit
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import ImagePair
from groundtie.rasters.reading import open_raster

SIZE = (420, 400)
LIMITS = SearchLimits(200.0)


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
    """Open a pair with a mask on one of its images."""
    files = write_textured_pair(folder, SIZE, model, **more)
    path = write_raster(folder / "mask.tif", masks, files.grid)
    with files.opened() as pair, open_raster(path) as mask:
        name = "input" if input else "reference"
        yield replace(pair, **{name: replace(getattr(pair, name), mask=mask)}), files.truth.model


def matcher_of(pair: ImagePair) -> PooledHistogramMatcher:
    held_out = HeldOut.of(pair)
    return PooledHistogramMatcher(pair, held_out.layout.chip_px, held_out)


def coarse_model(pair: ImagePair, context: Context) -> Model:
    return find_coarse_model(matcher_of(replace(pair, limits=LIMITS)), context)


def estimate_of(pair: ImagePair, coarse: Model, context: Context) -> Estimate:
    fit = SurfaceFit(matcher_of(pair), HeldOut.of(pair).layout)
    return fit.estimate(coarse, "auto", context)


def checked(pair: ImagePair, model: Model, context: Context) -> Check:
    return check_model(matcher_of(pair), HeldOut.of(pair).layout, model, context)


def with_colour(pair: ImagePair, folder: Path) -> ImagePair:
    """Return a pair whose input shows its texture only in colour: the mean band is constant."""
    values = pair.input.source.read(pair.input.source.window)[0]
    bands = np.stack([values, np.full_like(values, 2000), 4000 - values])
    path = write_raster(folder / "colour.tif", bands, pair.input.source.grid)
    return replace(pair, input=replace(pair.input, source=open_raster(path)))


@pytest.mark.parametrize("band", [None, 2], ids=["all bands", "a band that shows nothing"])
@pytest.mark.slow
def test_colour_is_matched_where_brightness_shows_nothing(
    tmp_path: Path, context: Context, band: int | None
) -> None:
    with masked(tmp_path, shift_on_map(30.0, -20.0), lines(SIZE)) as (plain, truth):
        pair = with_colour(plain, tmp_path)
        pair = replace(pair, input=replace(pair.input, band=band))
        matcher = PooledHistogramMatcher.of(pair, 64, HeldOut.of(pair))
        found = matcher.match(truth, Places.tiles(pair.grid, 64), 8, context)
        off_px = np.hypot(*found.common_shift_px)
        if band is None:
            assert off_px < 0.3
        else:
            assert matcher.colours is None, "whoever asks for a band has it matched"


def test_colours_are_those_of_the_part_where_the_images_overlap(tmp_path: Path) -> None:
    """A file that holds no data in its middle, and the pair in a corner."""
    with masked(tmp_path, shift_on_map(30.0, -20.0), lines(SIZE)) as (plain, _):
        pair = with_colour(plain, tmp_path)
        source = pair.input.source
        bands = np.zeros((3, SIZE[1], 3000), np.uint16)
        bands[:, :, : SIZE[0]] = source.read_bands(source.window, [1, 2, 3])[0]
        wide = source.grid.window(0, 0, 3000, SIZE[1])
        path = write_raster(tmp_path / "wide.tif", bands, wide, nodata=0)
        large = replace(pair, input=replace(pair.input, source=open_raster(path)))
        of_part, of_whole = (PooledHistogramMatcher.of(p, 64, HeldOut.of(p)) for p in (pair, large))
    assert of_part.colours is not None and of_whole.colours is not None
    assert np.array_equal(of_part.colours.hue_edges, of_whole.colours.hue_edges)


def test_images_of_fewer_bands_are_matched_by_grey_levels(tmp_path: Path) -> None:
    with masked(tmp_path, shift_on_map(30.0, -20.0), lines(SIZE)) as (pair, _):
        assert PooledHistogramMatcher.of(pair, 64, HeldOut.of(pair)).colours is None


@pytest.mark.slow
@pytest.mark.parametrize("input", [False, True], ids=["reference", "input"])
def test_lines_alone_are_registered(tmp_path: Path, context: Context, input: bool) -> None:
    with masked(tmp_path, stretched(), lines(SIZE), input) as (pair, truth):
        estimate = estimate_of(pair, coarse_model(pair, context), context)
        assert estimate.transform.model.kind == "affine"
        xy = everywhere(pair.reference.source.grid)
        assert rms(estimate.transform.model(xy) - truth(xy)) / 10 < 0.3
        found = checked(pair, estimate.transform.model, context)
        check = found.points
        assert check.is_check.all() and len(check) >= 4
        errors = check.take(check.used).residual_on(pair.grid, estimate.transform)
        assert rms(errors) < 1
        heights = found.surfaces.max(axis=(1, 2))
        np.testing.assert_allclose(heights, check.score, rtol=1e-4)


@pytest.mark.slow
def test_check_points_that_lie_elsewhere_show_it(tmp_path: Path, context: Context) -> None:
    with masked(tmp_path, shift_on_map(60.0, -40.0), lines(SIZE)) as (pair, truth):
        off = shift_on_map(60.0 + 30.0, -40.0 + 40.0)
        for model, expected_px in ((truth, 0.0), (off, 5.0)):
            surfaces = checked(pair, model, context).surfaces
            peaks = np.unravel_index(
                surfaces.reshape(len(surfaces), -1).argmax(1), surfaces[0].shape
            )
            off_px = np.median(np.array(peaks), axis=1) - surfaces.shape[1] // 2
            assert np.hypot(*off_px) == pytest.approx(expected_px, abs=0.5)


@pytest.mark.slow
def test_a_pyramid_leads_down_to_the_ground(tmp_path: Path, context: Context) -> None:
    """The coarse search uses pixels three times as large, and roads three times as wide."""
    size = (1600, 500)
    model = shift_on_map(110.0, -70.0)
    files = write_textured_pair(tmp_path, size, model)
    path = write_raster(tmp_path / "mask.tif", lines(size, 60), files.grid)
    with files.opened() as plain, open_raster(path) as mask:
        pair = replace(plain, reference=replace(plain.reference, mask=mask))
        found = coarse_model(pair, context)
        xy = everywhere(files.grid)
        assert rms(found(xy) - model(xy)) / 10 < 4


@pytest.mark.slow
def test_another_place_is_refused_or_judged_badly(tmp_path: Path, context: Context) -> None:
    with masked(tmp_path, shift_on_map(0, 0), lines(SIZE), input_seed=5) as (pair, _):
        try:
            coarse = coarse_model(pair, context)
        except NothingFoundError:
            return
        model = estimate_of(pair, coarse, context).transform
        check = checked(pair, model.model, context).points
        residuals = check.residual_on(pair.grid, model)
        assert (np.hypot(*residuals.T) <= 2).mean() < 0.25


def test_hardly_any_ground_is_an_error(tmp_path: Path, context: Context) -> None:
    little = np.zeros(SIZE[::-1], np.uint8)
    little[:60, :60] = 1
    with (
        masked(tmp_path, shift_on_map(0, 0), little) as (pair, truth),
        pytest.raises(TooFewPointsError, match="the mask leaves only about 3"),
    ):
        estimate_of(pair, truth, context)


def test_tiles_cover_the_grid_side_by_side() -> None:
    grid = Grid(utm_grid(200, 130).transform, None, 200, 130)
    seen = np.zeros((130, 200), int)
    for col, row in Places.tiles(grid, 25).centres:
        seen[row - 12 : row + 13, col - 12 : col + 13] += 1
    assert seen.min() >= 0 and seen.max() == 1
    assert seen[:125].min() == 1


def test_neighbours_are_added_by_their_weights() -> None:
    """A chip in the corner of the lattice sums four chips, one in its middle nine."""
    random = np.random.default_rng(4)
    centres = np.stack(np.meshgrid(*[np.arange(5) * 61 + 30] * 2), -1).reshape(-1, 2)
    forward, backward = random.normal(size=(2, 25, 9, 9)).astype(np.float32)
    weight = random.uniform(0.5, 2.0, 25)
    chips = ChipSurfaces(centres, forward, backward, weight)
    found = chips.with_neighbours(61)
    np.testing.assert_array_equal(found.centres, centres)
    for chip, members in ((0, [0, 1, 5, 6]), (12, [6, 7, 8, 11, 12, 13, 16, 17, 18])):
        assert found.weight[chip] == pytest.approx(weight[members].sum())
        for own, added in ((forward, found.forward), (backward, found.backward)):
            total = sum(weight[i] * own[i] for i in members)
            # Normalising surfaces to robust standard deviations is a gain and an offset.
            assert np.corrcoef(total.ravel(), added[chip].ravel())[0, 1] > 0.99999


def test_neighbours_show_what_single_chips_do_not() -> None:
    """Peaks of two standard deviations are lost in noise; with nine chips, they reach six."""
    random = np.random.default_rng(5)
    centres = np.stack(np.meshgrid(*[np.arange(9) * 61 + 30] * 2), -1).reshape(-1, 2)
    surfaces = random.normal(size=(81, 21, 21)).astype(np.float32)
    surfaces[:, 10 - 2, 10 + 3] += 2.0
    chips = ChipSurfaces(centres, surfaces, surfaces, np.ones(81))

    def right(found: ChipSurfaces) -> int:
        errors = found.correspondences().partner_px - found.correspondences().px - [3.0, -2.0]
        return int((np.hypot(*errors.T) < 1).sum())

    assert right(chips) < 27 and right(chips.with_neighbours(61)) > 65


@pytest.mark.parametrize("size", [(512, 29), (40, 300), (128, 64)])
def test_narrow_grids_are_covered_by_smaller_tiles(size: tuple[int, int]) -> None:
    grid = utm_grid(*size)
    places = Places.tiles(grid, 64)
    covered = len(places.centres) * places.chip_px**2
    assert covered >= 0.75 * grid.width * grid.height
    assert (places.corners >= 0).all()
    assert (places.corners + places.chip_px <= grid.size).all()
