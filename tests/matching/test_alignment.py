from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from affine import Affine
from rasterio.crs import CRS
from scipy.ndimage import gaussian_filter
from scipy.optimize import check_grad

from groundtie.arrays import Raster
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import DEGREE, TERRAIN, Frame, Model, shift_model
from groundtie.geometry.terrain import Terrain
from groundtie.geometry.terrain_model import TerrainModel
from groundtie.matching import alignment
from groundtie.matching.alignment import (
    IDENTITY,
    LINEAR_CANDIDATES,
    MODEL_CANDIDATES,
    TERRAIN_CANDIDATES,
    Prior,
    _fields,
    align,
)
from groundtie.matching.families import Family
from groundtie.rasters.grid import Grid, apply_affine

RADIUS = 8
SPAN = 2 * RADIUS + 1
SIZE = np.array([600.0, 500.0])
PEAK_SIGMA = 1.4
PEAK_HEIGHT = 12.0


def centres() -> np.ndarray:
    cols, rows = np.meshgrid(np.linspace(30, 570, 15), np.linspace(30, 470, 13))
    return np.round(np.column_stack([cols.ravel(), rows.ravel()])).astype(int)


def distortion(kind: str, px: np.ndarray) -> np.ndarray:
    """Stated positions of grid pixels in the input: a misregistration of a kind, up to 6 px."""
    middle = SIZE / 2
    off = np.asarray(px, float) - middle
    u, v = (off / middle.max()).T
    turn = np.deg2rad(0.5)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    bent = {
        "translation": off,
        "rigid": off @ rotation,
        "similarity": 1.006 * off @ rotation,
        "affine": off @ (np.eye(2) + [[0.008, -0.006], [-0.007, -0.009]]),
        "polynomial2": off + 2.0 * np.column_stack([u * v + u**2, v**2 - u * v]),
        "polynomial3": off + 2.5 * np.column_stack([u**3 - v**2 * u, v**3 + u**2 * v - u]),
    }
    return middle + bent[kind] + [1.7, -1.2]


def surfaces_of(
    kind: str, px: np.ndarray, prior: Affine, seed: int, wrong: float = 0.4
) -> np.ndarray:
    """Surfaces that peak where chips lie, over a correlated background; a share peaks elsewhere."""
    return surfaces_at(apply_affine(~prior, distortion(kind, px)) - px, seed, wrong)


def surfaces_at(shifts: np.ndarray, seed: int, wrong: float = 0.4) -> np.ndarray:
    """Surfaces that peak at shifts, (n, 2), except for a share of wrong ones."""
    px, shifts = shifts, shifts.copy()
    rng = np.random.default_rng(seed)
    assert np.abs(shifts).max() < RADIUS - 1
    lost = rng.random(len(px)) < wrong
    shifts[lost] = rng.uniform(-RADIUS, RADIUS, (lost.sum(), 2))
    y, x = np.mgrid[-RADIUS : RADIUS + 1, -RADIUS : RADIUS + 1]
    surfaces = []
    for dx, dy in shifts:
        noise = gaussian_filter(rng.normal(size=(SPAN, SPAN)), 1.0, mode="wrap")
        peak = np.exp(-((x - dx) ** 2 + (y - dy) ** 2) / (2 * PEAK_SIGMA**2))
        surfaces.append(PEAK_HEIGHT * peak + noise / noise.std())
    return np.array(surfaces, np.float32)


def identity() -> Model:
    return shift_model(0.0, 0.0)


def error_px(model: Model, kind: str) -> float:
    cols, rows = np.meshgrid(np.linspace(30, 570, 12), np.linspace(30, 470, 12))
    px = np.column_stack([cols.ravel(), rows.ravel()])
    return float(np.sqrt(((model(px) - distortion(kind, px)) ** 2).sum(axis=1).mean()))


PRIORS = [Affine.identity(), Affine(1.003, 0.002, 1.0, -0.001, 0.998, -0.5)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", DEGREE)
@pytest.mark.parametrize("prior", PRIORS, ids=["plain", "resampled"])
def test_the_model_behind_the_surfaces_is_found(kind: str, prior: Affine) -> None:
    px = centres()
    found = align(
        [kind], px, surfaces_of(kind, px, prior, seed=0), Prior.of_affine(prior), identity()
    )
    assert found.model.kind == kind
    assert error_px(found.model, kind) < 0.1
    assert len(found.fold_models) == 5
    for model in found.fold_models:
        assert 0 < error_px(model, kind) < 0.3


@pytest.fixture
def fitted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The kinds of models that have been fitted."""
    kinds: list[str] = []
    fit = alignment._align

    def noted(kind: str, *others: Any) -> Any:
        found = fit(kind, *others)
        kinds.append(kind)
        return found

    monkeypatch.setattr(alignment, "_align", noted)
    return kinds


@pytest.mark.slow
@pytest.mark.parametrize("kind", MODEL_CANDIDATES)
@pytest.mark.parametrize("seed", range(2))
def test_the_simplest_model_that_fits_is_chosen(kind: str, seed: int, fitted: list[str]) -> None:
    px = centres()
    chosen = align(
        MODEL_CANDIDATES,
        px,
        surfaces_of(kind, px, PRIORS[1], seed),
        Prior.of_affine(PRIORS[1]),
        identity(),
    )
    assert chosen.model.kind == kind
    assert error_px(chosen.model, kind) < 0.1
    assert fitted == list(MODEL_CANDIDATES)


def test_nothing_is_chosen_but_candidates(fitted: list[str]) -> None:
    px, prior = centres(), PRIORS[0]
    bent = surfaces_of("polynomial2", px, prior, 0)
    chosen = align(LINEAR_CANDIDATES, px, bent, Prior.of_affine(prior), identity())
    assert fitted == ["translation", "similarity", "affine"]
    assert chosen.model.kind in fitted


def test_left_out_similarity_is_that_of_the_right_chips() -> None:
    """A wrong chip's surface at the model's place is background, which is 0 on average."""
    px = centres()
    scores = []
    for wrong in (0.0, 0.5):
        surfaces = surfaces_of("translation", px, PRIORS[0], 1, wrong)
        fields = _fields(px, surfaces, Prior.of_affine(PRIORS[0]))
        scores.append(alignment._align("translation", fields, identity(), None)[1].mean())
    assert scores[1] / scores[0] == pytest.approx(0.5, abs=0.1)


def test_few_chips_take_no_model_of_many_parameters(fitted: list[str]) -> None:
    px = centres()[::25]
    assert len(px) == 8
    prior = Affine.identity()
    align(MODEL_CANDIDATES, px, surfaces_of("translation", px, prior, 0, 0), IDENTITY, identity())
    assert fitted == ["translation", "similarity"]


def test_surfaces_without_peaks_leave_a_finite_model() -> None:
    px = centres()
    flat = np.zeros((len(px), SPAN, SPAN), np.float32)
    found = align(MODEL_CANDIDATES, px, flat, IDENTITY, identity())
    assert found.model.kind == "translation"
    np.testing.assert_allclose(found.model(px), px, atol=1e-9)


@pytest.mark.parametrize("kind", ["rigid", "similarity", "affine", "polynomial3"])
def test_the_slope_that_the_search_follows_is_that_of_the_similarity(kind: str) -> None:
    px = centres()[::3]
    prior = PRIORS[1]
    field = _fields(px, surfaces_of(kind, px, prior, 2), Prior.of_affine(prior))[-1]
    rng = np.random.default_rng(0)

    def similarity(claimed: np.ndarray) -> float:
        return float(field.scores(claimed.reshape(-1, 2))[0].sum())

    def slope(claimed: np.ndarray) -> np.ndarray:
        return field.scores(claimed.reshape(-1, 2))[1].ravel()

    start = apply_affine(prior, field.px + rng.uniform(-4, 4, field.px.shape)).ravel()
    size = np.linalg.norm(slope(start))
    assert check_grad(similarity, slope, start, epsilon=1e-6) < 1e-3 * size
    family = Family.of(kind, field.px, identity(), None)
    found = family.model(family.starting(identity()))
    np.testing.assert_allclose(found(px), px, atol=1e-6)


@pytest.mark.parametrize("kind", ["rigid", "similarity", "affine", "polynomial2"])
def test_parameters_of_a_model_are_found_again(kind: str) -> None:
    px = centres().astype(float)
    model = fit_model(kind, px, distortion(kind, px))
    family = Family.of(kind, px, model, None)
    again = family.model(family.starting(model))
    np.testing.assert_allclose(again(px), distortion(kind, px), atol=0.01)


def test_the_spline_looks_up_the_surface_itself() -> None:
    """At whole shifts it returns the surface's values times the chip's weight; beyond, 0."""
    px = centres()[:4]
    surfaces = surfaces_of("translation", px, Affine.identity(), 0)
    field = _fields(px, surfaces, IDENTITY)[-1]
    weights = field.scores(field.px)[0] / surfaces[:, RADIUS, RADIUS]
    assert (weights > 0).all()
    for dx, dy in ((3, -5), (-6, 6), (1, 1)):
        values = field.scores(field.px + [dx, dy])[0]
        expected = weights * surfaces[:, RADIUS + dy, RADIUS + dx]
        np.testing.assert_allclose(values, expected, atol=1e-4)
    values, slopes = field.scores(field.px + [RADIUS + 3, 0])
    assert not values.any()
    assert not slopes.any()


class TestHeights:
    """Chips on hills; the input was orthorectified with other heights."""

    GRID = Grid(Affine(10, 0, 4e5, 0, -10, 5e6), CRS.from_epsg(32633), 600, 500)
    SIGHT_PX = np.array([-0.045, 0.01])  # for a metre

    def terrain(self, seed: int = 0) -> Terrain:
        """Hills of 100 m; the input's heights have errors of about 30 m."""
        rng = np.random.default_rng(seed)
        rough = rng.normal(size=(2, 500, 600))
        hills, errors = (
            gaussian_filter(one, sigma) * sigma for one, sigma in zip(rough, (40, 30), strict=True)
        )
        low, high = self.GRID.pixel_to_map([[0, 499], [599, 0]])
        rasters = [
            Raster(values.astype(np.float32), self.GRID.transform, self.GRID.crs)
            for values in (350 * hills, 350 * hills - 110 * errors)
        ]
        found = Terrain.open(rasters[0], rasters[1], self.GRID.crs, (*low, *high))
        return found.seen_from(self.GRID.centre_transform)

    def truth(self, terrain: Terrain) -> TerrainModel:
        frame = Frame.around(np.array([[0.0, 0.0], SIZE]))
        scale = frame.to_map.a
        affine = np.array([[1.7, -1.2], [0.8, 0.4], [-0.5, 0.7]]) / scale
        return TerrainModel(
            TERRAIN, frame, np.vstack([affine, self.SIGHT_PX / scale]), terrain, 0.0
        )

    def chips(self, truth: Model, seed: int) -> tuple[np.ndarray, np.ndarray]:
        px = centres()
        return px, surfaces_at(truth(px.astype(float)) - px, seed)

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(2))
    def test_what_heights_displace_is_found_and_chosen(self, seed: int) -> None:
        terrain = self.terrain(seed)
        truth = self.truth(terrain)
        px, surfaces = self.chips(truth, seed)
        chosen = align(TERRAIN_CANDIDATES, px, surfaces, IDENTITY, identity(), terrain).model
        assert isinstance(chosen, TerrainModel)
        at = np.random.default_rng(1).uniform(40, 450, (200, 2))
        assert np.hypot(*(truth(at) - truth.affine(at)).T).max() > 2
        np.testing.assert_allclose(chosen(at), truth(at), atol=0.4)
        scale = chosen.frame.to_map.a
        np.testing.assert_allclose(chosen.coefficients[3] * scale, self.SIGHT_PX, atol=0.006)

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", ["affine", "polynomial2"])
    @pytest.mark.parametrize("seed", range(2))
    def test_heights_of_another_place_are_not_chosen(
        self, kind: str, seed: int, fitted: list[str]
    ) -> None:
        px = centres()
        surfaces = surfaces_of(kind, px, Affine.identity(), seed)
        chosen = align(
            TERRAIN_CANDIDATES, px, surfaces, IDENTITY, identity(), self.terrain(seed + 7)
        )
        assert TERRAIN in fitted
        assert chosen.model.kind == kind

    @pytest.mark.slow
    def test_flat_land_says_nothing_on_heights(self, fitted: list[str]) -> None:
        flat = Raster(np.full((500, 600), 30, np.float32), self.GRID.transform, self.GRID.crs)
        low, high = self.GRID.pixel_to_map([[0, 499], [599, 0]])
        terrain = Terrain.open(flat, None, self.GRID.crs, (*low, *high))
        px, surfaces = self.chips(identity(), 0)
        seen = terrain.seen_from(self.GRID.centre_transform)
        align(TERRAIN_CANDIDATES, px, surfaces, IDENTITY, identity(), seen)
        assert fitted and TERRAIN not in fitted
