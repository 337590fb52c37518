from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from groundtie.errors import TooFewPointsError
from groundtie.geometry import robust
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import KINDS, Model
from groundtie.geometry.robust import (
    distances,
    find_consensus,
    fit_mixture,
    fit_robustly,
)

RADIUS = 10
AREA = (2 * RADIUS + 1.0) ** 2
CENTRE = np.array([400.0, 300.0])
DEGREE_1 = ("translation", "rigid", "similarity", "affine")


def places(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 1, (count, 2)) * 2 * CENTRE


def claimed(kind: str, px: np.ndarray) -> np.ndarray:
    """A misregistration of a kind, a few pixels large."""
    turn, scale = np.deg2rad(0.4), 1.004
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    off = px - CENTRE
    u, v = (off / CENTRE.max()).T
    bent = {
        "translation": off,
        "rigid": off @ rotation,
        "similarity": scale * off @ rotation,
        "affine": off @ (rotation + [[0.004, -0.003], [0.002, 0.001]]),
        "polynomial2": off + 2 * np.column_stack([u * v, v**2 - u**2]),
        "polynomial3": off + 2 * np.column_stack([u * v, u**3 - v**2]),
        "tps": off + 2 * np.column_stack([np.sin(2 * u), np.cos(2 * v)]),
    }
    return CENTRE + bent[kind] + [3.3, -2.1]


def matches(
    kind: str, count: int, outliers: float, seed: int, sigma: float = 0.4
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places, where matches claim them to be, and which of these are right."""
    rng = np.random.default_rng(seed)
    px = places(count, seed)
    found = claimed(kind, px) + sigma * rng.normal(size=px.shape)
    wrong = rng.random(count) < outliers
    found[wrong] = claimed(kind, px[wrong]) + rng.uniform(-RADIUS, RADIUS, (wrong.sum(), 2))
    return px, found, ~wrong


def error_px(model: Model, kind: str) -> float:
    grid = np.stack(np.meshgrid(np.linspace(80, 720, 9), np.linspace(60, 540, 9)), -1)
    px = grid.reshape(-1, 2)
    return float(np.sqrt((distances(model, px, claimed(kind, px)) ** 2).mean()))


@pytest.mark.parametrize("sigma", [0.3, 0.8, 1.6])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_the_mixture_finds_scatter_and_share_of_right_matches(sigma: float, share: float) -> None:
    found = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        right = rng.random(400) < share
        fell = rng.uniform(-RADIUS - 0.5, RADIUS + 0.5, (400, 2))
        residuals = np.where(right[:, None], sigma * rng.normal(size=(400, 2)), fell)
        mixture = fit_mixture(residuals, AREA, (0.1, 3.0))
        found.append((mixture.sigma, mixture.probability.mean(), mixture.inliers[right].mean()))
        # A wrong match that falls among the right ones cannot be told from them.
        far = np.hypot(*residuals.T) > 4.5 * sigma
        assert not mixture.inliers[far & ~right].any()
    sigmas, shares, kept = np.array(found).T
    assert sigmas.mean() == pytest.approx(sigma, rel=0.1)
    assert shares.mean() == pytest.approx(share, abs=0.04)
    # Both densities are equal where this share of the normal distribution lies beyond.
    beyond = 2 * np.pi * sigma**2 * (1 - share) / (share * AREA)
    assert kept.mean() == pytest.approx(1 - beyond, abs=0.03)


def test_the_mixture_keeps_to_its_range() -> None:
    rng = np.random.default_rng(0)
    exact = fit_mixture(np.zeros((30, 2)), AREA, (0.2, 2.5))
    assert exact.sigma == pytest.approx(0.2)
    assert exact.inliers.all()
    wide = fit_mixture(rng.normal(size=(300, 2)) * 5, 1e6, (0.2, 2.5))
    assert wide.sigma == pytest.approx(2.5)
    # More wide than right: nothing but chance.
    fallen = fit_mixture(
        rng.uniform(-8, 8, (300, 2)) + 8 * rng.choice([-1, 1], (300, 2)), 900, (0.2, 1.0)
    )
    assert fallen.inliers.mean() < 0.1


def test_a_second_cluster_does_not_draw_the_first() -> None:
    """A third of the matches hang on a roof edge 4 px off, as layover makes them."""
    rng = np.random.default_rng(1)
    residuals = 0.5 * rng.normal(size=(90, 2))
    residuals[60:] += [4.0, 0]
    mixture = fit_mixture(residuals, AREA, (0.2, 2.5))
    assert mixture.inliers[:60].mean() > 0.95
    assert not mixture.inliers[60:].any()
    assert mixture.sigma == pytest.approx(np.sqrt((residuals[:60] ** 2).mean()), rel=0.1)


@pytest.mark.parametrize("kind", DEGREE_1)
@pytest.mark.parametrize("seed", range(3))
def test_consensus_among_sixty_percent_wrong_matches(kind: str, seed: int) -> None:
    px, found, right = matches(kind, 120, 0.6, seed)
    model = find_consensus(px, found, 2.0, kind, seed)
    assert model.kind == kind
    assert error_px(model, kind) < 0.5
    agree = distances(model, px, found) < 2.0
    assert agree[right].mean() > 0.95


@pytest.mark.parametrize("kind", DEGREE_1)
def test_consensus_is_the_same_for_the_same_seed(kind: str) -> None:
    px, found, _ = matches(kind, 60, 0.5, 4)
    models = [find_consensus(px, found, 2.0, kind, 7).to_json() for _ in range(2)]
    assert models[0] == models[1]


@pytest.mark.parametrize("kind", DEGREE_1)
@pytest.mark.parametrize("together", [1, 60 * 7, 10**9])
def test_consensus_is_the_same_however_many_samples_are_looked_at_together(
    kind: str, together: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    px, found, _ = matches(kind, 60, 0.5, 4)
    usual = find_consensus(px, found, 2.0, kind, 7)
    monkeypatch.setattr(robust, "_TOGETHER", together)
    assert find_consensus(px, found, 2.0, kind, 7).to_json() == usual.to_json()


@pytest.mark.slow
def test_memory_of_the_consensus_is_bounded() -> None:
    """All residuals of 600 samples of 50 000 pairs would take 480 MB."""
    px, found, _ = matches("affine", 50_000, 0.5, 4)
    tracemalloc.start()
    find_consensus(px, found, 2.0, "affine", 7)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak_bytes < 120e6


@pytest.mark.parametrize("kind", DEGREE_1)
def test_exact_matches_give_the_exact_model(kind: str) -> None:
    px = places(12, 0)
    assert error_px(find_consensus(px, claimed(kind, px), 1.0, kind), kind) < 1e-6


def test_consensus_of_points_on_a_line_is_finite() -> None:
    px = np.column_stack([np.linspace(0, 500, 20), np.full(20, 70.0)])
    model = find_consensus(px, px + [2, 1], 2.0, "affine")
    np.testing.assert_allclose(model(px), px + [2, 1], atol=1e-6)


def test_implausible_distortions_are_no_consensus() -> None:
    """Mirrored matches agree with each other, but not with any georeferenced image."""
    px = places(40, 0)
    mirrored = np.column_stack([800 - px[:, 0], px[:, 1]])
    agree = distances(find_consensus(px, mirrored, 2.0, "affine"), px, mirrored) < 2.0
    assert agree.mean() < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(2))
def test_a_robust_fit_among_forty_percent_wrong_matches(kind: str, seed: int) -> None:
    px, found, right = matches(kind, 200, 0.4, seed)
    start = find_consensus(px, found, 3.0, "affine", seed)
    variances = np.full(len(px), 0.05)
    model, mixture = fit_robustly(kind, px, found, variances, start, AREA)
    assert model.kind == kind
    # A spline sways with its knots' noise, less than each of them; polynomials average over it.
    assert error_px(model, kind) < (0.4 * np.sqrt(2) if kind == "tps" else 0.2)
    assert mixture.inliers[right].mean() > 0.9
    # A spline bends towards its knots, so its residuals say too little of their scatter.
    assert kind == "tps" or mixture.sigma == pytest.approx(0.4, rel=0.15)


def test_uncertain_matches_weigh_less() -> None:
    rng = np.random.default_rng(3)
    px = places(200, 3)
    sigmas = np.where(np.arange(200) < 100, 0.2, 2.0)
    errors = []
    for variances in (sigmas**2, np.full(200, 0.05)):
        gaps = []
        for _ in range(20):
            found = px + [1, 1] + rng.normal(size=px.shape) * sigmas[:, None]
            start = fit_model("translation", px, found)
            fitted = fit_robustly("translation", px, found, variances, start, AREA)
            gaps.append(fitted[0](px[:1])[0] - px[0] - [1, 1])
        errors.append(np.sqrt(np.mean(np.square(gaps))))
    assert errors[0] < 0.75 * errors[1]


def test_too_few_right_matches_for_the_model() -> None:
    px, found, _ = matches("translation", 8, 0.0, 0)
    start = find_consensus(px, found, 3.0, "translation")
    with pytest.raises(TooFewPointsError, match="polynomial3"):
        fit_robustly("polynomial3", px, found, np.zeros(8), start, AREA)
