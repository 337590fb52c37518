"""The promise of the verdict: what is held out of the fit changes nothing of the fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from raster_files import write_raster
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
from groundtie.rasters.pair import ImagePair
from groundtie.similarity.surface import SimilaritySettings


def registered(files: TexturedPair, kind: str, similarity: str) -> tuple[Estimate, TiePoints]:
    with files.opened() as pair, threads(2) as context:
        held_out = HeldOut.of(pair)
        matcher = ChipMatcher(pair, SimilaritySettings(similarity), held_out)
        coarse = find_coarse_model(matcher, held_out, SearchLimits(200.0), context)
        estimate = SurfaceFit(matcher, held_out.layout).estimate(coarse, kind, context)
        model = estimate.transform.model
        return estimate, check_model(matcher, held_out.layout, model, context).points


def spoiled(files: TexturedPair, folder: Path, emptied: bool) -> TexturedPair:
    """Return the pair with a reference that shows noise or zeros wherever it is held out."""
    with files.opened() as pair:
        layout = HeldOut.of(pair).layout
        grid = pair.reference.source.grid
        cols, rows = np.meshgrid(np.arange(float(grid.width)), np.arange(float(grid.height)))
        x, y = pair.grid.map_to_pixel(
            grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
        ).T
        held_out = (layout.columns.held_out(x) & layout.rows.held_out(y)).reshape(cols.shape)
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
    # These pixels are all that the check points see.
    theirs = check.residual_px(estimate.transform)
    assert not np.array_equal(misled.residual_px(blind.transform), theirs)
    assert len(misled) == 0 or misled.score.mean() < 0.6 * check.score.mean()


def test_held_out_pixels_are_the_same_at_any_level(pair: ImagePair) -> None:
    """On its own pixels as the layout says; on larger ones also what they see of a block."""
    held_out = HeldOut.of(pair)
    layout, grid = held_out.layout, pair.grid
    exact = layout.held_out_mask(np.arange(float(grid.width)), np.arange(float(grid.height)))
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
        # By the reach of the kernel and no more: five pixels of the level a side of a block.
        blocks = layout.columns.cells * layout.rows.cells
        side = layout.columns.block / factor + 7
        assert mask.sum() <= blocks * side**2
