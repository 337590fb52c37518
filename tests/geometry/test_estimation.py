from __future__ import annotations

import numpy as np
import pytest
from raster_files import UTM, utm_grid

from groundtie.errors import TooFewPointsError
from groundtie.geometry.estimation import (
    Estimate,
    fit_thin_plate,
    fit_without_blocks,
    jackknife_spread,
)
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.model_choice import left_out_blocks
from groundtie.geometry.models import Frame, Model, PolynomialModel, shift_model
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform

GRID = utm_grid(800, 600)
NOMINAL = Transform.nominal(UTM, GRID)
IDENTITY = shift_model(0.0, 0.0)


def lattice(columns: int = 13, rows: int = 11) -> np.ndarray:
    cols, lines = np.meshgrid(np.linspace(30, 770, columns), np.linspace(30, 570, rows))
    return np.column_stack([cols.ravel(), lines.ravel()])


def bent(px: np.ndarray) -> np.ndarray:
    u, v = ((px - [400, 300]) / 400).T
    return px + 2 * np.column_stack([np.sin(2 * u), np.cos(2 * v) * u])


def tie_points(px: np.ndarray, nominal_px: np.ndarray, variance: float = 0.05) -> TiePoints:
    count = len(px)
    return TiePoints(
        reference_xy=GRID.pixel_to_map(px),
        input_px=nominal_px,
        score=np.full(count, 8.0),
        covariance_px2=np.tile(variance * np.eye(2), (count, 1, 1)),
        forward_backward_error_px=np.zeros(count),
        is_check=np.zeros(count, bool),
        state=np.full(count, "used"),
    )


@pytest.mark.parametrize("kind", ["translation", "affine", "polynomial2"])
def test_the_spread_is_how_much_estimates_vary(kind: str) -> None:
    """The jackknife's mean over many drawn data sets is the scatter of their predictions."""
    px, rng, sigma = lattice(), np.random.default_rng(0), 0.5
    blocks = left_out_blocks(px)
    at = lattice(5, 4)
    told, predictions = [], []
    for _ in range(60):
        claimed = px + sigma * rng.normal(size=px.shape)
        predictions.append(fit_model(kind, px, claimed)(at))
        left_out = [fit_model(kind, px[~out], claimed[~out]) for out in blocks]
        told.append(jackknife_spread(left_out, at) ** 2)
    actual = np.var(predictions, axis=0).sum(axis=1)
    assert np.sqrt(np.mean(told)) == pytest.approx(np.sqrt(actual.mean()), rel=0.25)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_the_spread_on_a_grid_is_in_its_pixels(scale: float) -> None:
    """Matching errors are as large on the reference, whatever scale the input is brought to."""
    px, rng = lattice(), np.random.default_rng(0)
    matched = px + 0.5 * rng.normal(size=px.shape)

    def spread(scale: float) -> np.ndarray:
        folds = fit_without_blocks("affine", px, scale * matched, np.ones(len(px)))
        model = fit_model("affine", px, scale * px).on_map(GRID.transform)
        points = tie_points(px, scale * matched)
        estimate = Estimate(Transform(model, UTM, GRID), points, folds)
        return jackknife_spread(estimate.folds_on(GRID), lattice(5, 4))

    np.testing.assert_allclose(spread(scale), spread(1.0), rtol=1e-6)


def test_the_spread_of_a_mean_by_hand() -> None:
    """Five shifts by 0 … 4 px along x: the jackknife variance is (n - 1)/n Σ (θ - mean)²."""
    shifts = [np.array([[float(k), 0.0]]) for k in range(5)]
    models: list[Model] = [
        PolynomialModel("translation", Frame.around(np.zeros((1, 2))), s) for s in shifts
    ]
    np.testing.assert_allclose(jackknife_spread(models, np.zeros((3, 2))), np.sqrt(4 / 5 * 10))


def test_the_spread_grows_away_from_the_points() -> None:
    px = lattice() * 0.2
    rng = np.random.default_rng(1)
    claimed = px + 0.3 * rng.normal(size=px.shape)
    blocks = left_out_blocks(px)
    models = [fit_model("affine", px[~out], claimed[~out]) for out in blocks]
    near, far = jackknife_spread(models, np.array([[80.0, 60.0], [780.0, 580.0]]))
    assert far > 5 * near


def test_a_single_model_tells_nothing_of_its_spread() -> None:
    assert np.isinf(jackknife_spread([IDENTITY], np.zeros((2, 2)))).all()


@pytest.mark.slow
def test_the_spline_follows_local_distortion_past_wrong_matches() -> None:
    rng = np.random.default_rng(0)
    px = lattice(17, 13)
    claimed = bent(px) + 0.2 * rng.normal(size=px.shape)
    wrong = rng.random(len(px)) < 0.15
    claimed[wrong] += rng.choice([-3, 3], (wrong.sum(), 2))
    points = tie_points(px, claimed)
    start = fit_model("polynomial3", px, bent(px))
    found = fit_thin_plate(points, NOMINAL, GRID, start, 3)
    model, folds = found.model, found.fold_models
    at = lattice(9, 7)
    error = np.hypot(*(model(at) - bent(at)).T)
    assert model.kind == "tps"
    assert np.sqrt((error**2).mean()) < 0.3
    assert len(folds) == 5
    for other in folds:
        assert 0 < np.abs(other(at) - model(at)).max() < 3


@pytest.mark.slow
def test_rejected_points_take_no_part_in_the_spline() -> None:
    px = lattice()
    claimed = bent(px)
    which = np.arange(len(px)) % 5 == 0
    spoiled = claimed + np.where(which[:, None], 2.0, 0.0)
    rejected = tie_points(px, spoiled).reject(which, "forward–backward error")
    model, clean = (
        fit_thin_plate(points, NOMINAL, GRID, IDENTITY, 3).model
        for points in (rejected, tie_points(px[~which], claimed[~which]))
    )
    np.testing.assert_allclose(model(px), clean(px), atol=1e-6)


@pytest.mark.parametrize("count", [0, 3])
def test_too_few_points_for_a_spline(count: int) -> None:
    px = lattice()[:count]
    with pytest.raises(TooFewPointsError, match=rf"only {count} points"):
        fit_thin_plate(tie_points(px, px), NOMINAL, GRID, IDENTITY, 3)
