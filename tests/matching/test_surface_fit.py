from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from raster_files import write_raster
from textured_pairs import (
    TexturedPair,
    error_m,
    rms,
    shift_on_map,
    with_hole_around,
    write_textured_pair,
)

from groundtie.context import Context
from groundtie.errors import TooFewPointsError
from groundtie.geometry.estimation import jackknife_spread
from groundtie.geometry.models import KINDS
from groundtie.kinds import AUTO
from groundtie.matching import surface_fit
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.held_out import HeldOut
from groundtie.matching.surface_fit import SurfaceFit
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

SETTINGS = SimilaritySettings("orientation")

# Wrong by three pixels along each axis, as a coarse model may be.
COARSE = shift_on_map(40.0, -15.0)


def fit_of(pair: ImagePair) -> SurfaceFit:
    held_out = HeldOut.of(pair)
    return SurfaceFit(ChipMatcher(pair, SETTINGS, held_out), held_out.layout)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [AUTO, *KINDS])
def test_every_model_is_fitted_from_a_coarse_one(
    textured: TexturedPair, pair: ImagePair, context: Context, kind: str
) -> None:
    estimate = fit_of(pair).estimate(COARSE, kind, context)
    model = estimate.transform.model
    assert model.kind == ("translation" if kind == AUTO else kind)
    assert error_m(model, textured) < (5 if kind == "tps" else 2)
    assert not estimate.points.is_check.any()
    assert len(estimate.fold_models) >= 4
    # Folds are in pixels of the matching grid: the input lies 7 columns and 4.5 rows further on.
    at = np.array([[130.0, 120.0]])
    for fold in estimate.fold_models:
        assert np.abs(fold(at) - at - [7.0, 4.5]).max() < 0.7
    assert jackknife_spread(estimate.fold_models, at)[0] < 1


@pytest.mark.slow
def test_tie_points_are_places_in_both_images(
    textured: TexturedPair, pair: ImagePair, context: Context
) -> None:
    fit = fit_of(pair)
    points = fit.estimate(COARSE, "translation", context).points
    right = points.take(points.used)
    assert len(right) > 0.8 * len(fit.layout.fit_centres)
    px = textured.grid.map_to_pixel(right.reference_xy)
    assert {tuple(p) for p in np.rint(px).astype(int)} <= {tuple(c) for c in fit.layout.fit_centres}
    errors = right.input_px - textured.truth(right.reference_xy)
    assert rms(errors) < 0.5
    # The scatter estimated from the surfaces is neither far too small nor far too large.
    estimated = np.sqrt(np.trace(right.covariance_px2, axis1=1, axis2=2).mean())
    assert 0.3 < estimated / rms(errors) < 6
    assert (right.forward_backward_error_px <= 2.0).all()
    assert (right.score > 3).all()


@pytest.mark.slow
def test_a_strict_forward_backward_limit_rejects_points(
    monkeypatch: pytest.MonkeyPatch, pair: ImagePair, context: Context
) -> None:
    monkeypatch.setattr(surface_fit, "TOLERANCE_PX", 0.05)
    strict = fit_of(pair).estimate(COARSE, "translation", context)
    rejected = strict.points.take(~strict.points.used)
    assert 0 < strict.points.used.sum() < len(strict.points)
    assert np.char.find(rejected.state, "forward–backward error above 0.05 px").max() >= 0
    assert (strict.points.take(strict.points.used).forward_backward_error_px <= 0.05).all()


@pytest.mark.slow
def test_a_model_that_no_point_agrees_with_is_none(
    monkeypatch: pytest.MonkeyPatch, pair: ImagePair, context: Context
) -> None:
    """No match back meets its start to the last digit."""
    monkeypatch.setattr(surface_fit, "TOLERANCE_PX", 0.0)
    with pytest.raises(TooFewPointsError, match="points agree"):
        fit_of(pair).estimate(COARSE, "affine", context)


def test_too_few_chips_with_content(
    textured: TexturedPair, tmp_path: Path, context: Context
) -> None:
    values = np.zeros_like(textured.reference_values)
    values[100:150, 100:160] = textured.reference_values[100:150, 100:160]
    path = write_raster(tmp_path / "patch.tif", values, textured.grid, nodata=0)
    with open_raster(path) as reference, open_raster(textured.input) as input:
        pair = make_pair(Image(reference), Image(input))
        with pytest.raises(TooFewPointsError, match="only"):
            fit_of(pair).estimate(COARSE, "affine", context)


def test_the_model_reaches_the_input_through_its_own_georeferencing(
    tmp_path: Path, context: Context
) -> None:
    """An input with larger pixels: positions are in its own pixels, not in matching ones."""
    files = write_textured_pair(tmp_path, (420, 400), shift_on_map(50, 30), input_pixel_ratio=2.0)
    with files.opened() as pair:
        estimate = fit_of(pair).estimate(shift_on_map(20, 10), "translation", context)
    assert estimate.transform.input_grid == files.truth.input_grid
    right = estimate.points.take(estimate.points.used)
    assert rms(right.input_px - files.truth(right.reference_xy)) < 0.5
    assert rms(right.residual_px(estimate.transform)) < 0.5


def test_a_match_without_a_place_in_the_input_spoils_no_other(
    textured: TexturedPair, pair: ImagePair, context: Context
) -> None:
    """As in an image with RPCs, where the ground's height is not known."""
    holed = with_hole_around(pair, fit_of(pair).layout.fit_centres[0])
    estimate = fit_of(holed).estimate(COARSE, "translation", context)
    assert error_m(estimate.transform.model, textured) < 2
    assert np.isfinite(estimate.points.input_px).all()
    assert estimate.points.used.sum() > 0.8 * len(fit_of(pair).layout.fit_centres)


@pytest.mark.slow
def test_the_seed_decides(pair: ImagePair, context: Context) -> None:
    seeded = replace(context, seed=5)
    found = [fit_of(pair).estimate(COARSE, "affine", seeded) for _ in range(2)]
    assert found[0].transform.to_json() == found[1].transform.to_json()
