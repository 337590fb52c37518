"""The promise of the verdict: held-out pixels do not influence the fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from raster_files import UTM, write_raster
from textured_pairs import TexturedPair, shift_on_map, write_textured_pair

from groundtie.context import threads
from groundtie.geometry.estimation import Estimate
from groundtie.geometry.limits import SearchLimits
from groundtie.geometry.tie_points import TiePoints
from groundtie.matching.check import check_model
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.held_out import HeldOut
from groundtie.matching.pyramid import find_coarse_model
from groundtie.matching.surface_fit import SurfaceFit
from groundtie.pose.rotation_windows import read_windows
from groundtie.rasters.grid import Grid, compose, mesh
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings


def registered(files: TexturedPair, kind: str, similarity: str) -> tuple[Estimate, TiePoints]:
    with files.opened() as opened, threads(2) as context:
        pair = replace(opened, limits=SearchLimits(200.0))
        held_out = HeldOut.of(pair)
        matcher = ChipMatcher(pair, SimilaritySettings(similarity), held_out)
        coarse = find_coarse_model(matcher, context)
        estimate = SurfaceFit(matcher, held_out.layout).estimate(coarse, kind, context)
        model = estimate.transform.model
        return estimate, check_model(matcher, held_out.layout, model, context).points


def spoiled(files: TexturedPair, folder: Path, emptied: bool) -> TexturedPair:
    """Return the pair with noise or zeros in the reference wherever it is held out."""
    with files.opened() as pair:
        layout = HeldOut.of(pair).layout
        grid = pair.reference.source.grid
        cols, rows = np.meshgrid(np.arange(float(grid.width)), np.arange(float(grid.height)))
        x, y = pair.grid.map_to_pixel(
            grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
        ).T
        held_out = layout.held_out(x, y).reshape(cols.shape)
    values = files.reference_values
    noise = np.random.default_rng(9).integers(1, 60_000, values.shape, dtype=np.uint16)
    values = np.where(held_out, 0 if emptied else noise, values).astype(np.uint16)
    assert 0.15 < held_out.mean() < 0.4
    path = write_raster(folder / "reference.tif", values, files.grid)
    return replace(files, reference=path, reference_values=values)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "ratio", "kind", "similarity", "emptied"),
    [
        ((300, 280), 1.0, "auto", "fused", False),
        ((300, 280), 1.0, "affine", "fused", True),
        ((640, 240), 1.0, "affine", "fused", False),  # the coarse search is at a coarser level
        # the matching grid is coarser than the reference
        ((400, 390), 1.6, "affine", "fused", False),
        ((503, 501), 2.0, "affine", "nmi", False),
        ((250, 240), 0.6, "tps", "orientation", False),
    ],
)
def test_pixels_held_out_of_the_fit_change_nothing_of_it(
    tmp_path: Path,
    size: tuple[int, int],
    ratio: float,
    kind: str,
    similarity: str,
    emptied: bool,
) -> None:
    model = shift_on_map(60.0, -45.0)
    files = write_textured_pair(tmp_path, size, model, input_pixel_ratio=ratio)
    (tmp_path / "spoiled").mkdir()
    estimate, check = registered(files, kind, similarity)
    blind, misled = registered(spoiled(files, tmp_path / "spoiled", emptied), kind, similarity)
    assert blind.transform.to_json() == estimate.transform.to_json()
    for name, values in vars(estimate.points).items():
        np.testing.assert_array_equal(getattr(blind.points, name), values, err_msg=name)
    assert [m.to_json() for m in blind.fold_models] == [m.to_json() for m in estimate.fold_models]
    # Check points see only these pixels.
    theirs = check.residual_px(estimate.transform)
    assert not np.array_equal(misled.residual_px(blind.transform), theirs)
    assert len(misled) == 0 or misled.score.mean() < 0.6 * check.score.mean()


def test_held_out_pixels_are_the_same_at_any_level(pair: ImagePair) -> None:
    """On the layout's own pixels exactly; on larger pixels, also all that see a part of a block."""
    held_out = HeldOut.of(pair)
    layout, grid = held_out.layout, pair.grid
    exact = layout.held_out(np.arange(float(grid.width)), np.arange(float(grid.height))[:, None])
    np.testing.assert_array_equal(held_out(grid), exact)
    window = grid.window(37, 51, 90, 70)
    np.testing.assert_array_equal(held_out(window), exact[51:121, 37:127])
    for factor in (2.0, 3.7):
        level = grid.scaled(factor)
        mask = held_out(level)
        centres = np.rint(np.array([(np.arange(n) + 0.5) * factor - 0.5 for n in (40, 40)])).astype(
            int
        )
        seen = exact[np.ix_(centres[1], centres[0])]
        assert mask[:40, :40][seen].all()
        # Blocks grow only by the reach of the kernel: five pixels of the level on each side.
        blocks = layout.columns.cells * layout.rows.cells
        side = layout.columns.block / factor + 7
        assert mask.sum() <= blocks * side**2


@pytest.mark.parametrize("rotation_deg", [5.0, 45.0, 90.0])
@pytest.mark.parametrize("pixel_m", [10.0, 23.0])
def test_poses_are_searched_for_without_what_is_held_out_of_a_rotated_reference(
    tmp_path: Path, rotation_deg: float, pixel_m: float
) -> None:
    """Windows of poses are north up; noise in held-out parts of the reference changes none."""
    side = 400
    centre = Affine.translation(500_000, 5_000_000)
    turned = compose(centre, Affine.rotation(rotation_deg), Affine.translation(-2000, 2000))
    grid = Grid(compose(turned, Affine.scale(10, -10)), UTM, side, side)
    count = round(10 * side / pixel_m)
    other = Grid(compose(turned, Affine.scale(pixel_m, -pixel_m)), UTM, count, count)
    random = np.random.default_rng(0)
    values = random.integers(1, 1000, (side, side), dtype=np.uint16)
    input = write_raster(tmp_path / "input.tif", values[:count, :count], other)
    original = write_raster(tmp_path / "original.tif", values, grid)
    with open_raster(original) as reference, open_raster(input) as source:
        images = Image(reference), Image(source)
        pair = make_pair(*images, rotation_deg=5.0)
        held_out = HeldOut.of(pair)
        cols, rows = (np.arange(float(side)) for _ in range(2))
        px = pair.grid.map_to_pixel(grid.pixel_to_map(mesh(cols, rows)))
        layout = held_out.layout
        hidden = layout.held_out(*px.T)
        whole = read_windows(*images, (1.0, 1.0)).reference.valid
        windows = read_windows(*images, (1.0, 1.0), held_out=held_out)
        seen = windows.reference
    hidden = hidden.reshape(side, side)
    assert 0.15 < hidden.mean() < 0.4
    noise = random.integers(1, 60_000, (side, side), dtype=np.uint16)
    spoiled = write_raster(tmp_path / "spoiled.tif", np.where(hidden, noise, values), grid)
    with open_raster(spoiled) as reference, open_raster(input) as source:
        misled = read_windows(Image(reference), Image(source), (1.0, 1.0), held_out=held_out)
    np.testing.assert_array_equal(misled.reference.valid, seen.valid)
    np.testing.assert_array_equal(misled.reference.values[seen.valid], seen.values[seen.valid])
    # More remains than the narrow lines between all pixels that may see a block.
    assert seen.valid.sum() > 0.3 * whole.sum()
