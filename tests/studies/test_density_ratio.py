from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from groundtie.context import threads
from groundtie.progress import Progress
from groundtie.rasters.patch import Patch
from groundtie.studies.density_ratio import (
    WIDTHS,
    choose_width,
    fit_density_ratio,
    information_surface,
    maximum_likelihood_mutual_information,
    normal_scores,
)
from groundtie.studies.measures import mutual_information


def gaussian_pair(rho: float, size: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x, noise = rng.normal(size=(2, size))
    return x, rho * x + np.sqrt(1 - rho**2) * noise


def information_density(x: np.ndarray, y: np.ndarray, rho: float) -> np.ndarray:
    """Logarithm of the true ratio of densities: its mean over a sample is what MLMI estimates."""
    form = (x * x - 2 * rho * x * y + y * y) / (1 - rho**2) - x * x - y * y
    return -np.log(1 - rho**2) / 2 - form / 2


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.4, -0.8, 0.9])
def test_gaussian_pairs(rho: float) -> None:
    """Also under monotone functions of each; the estimate is for the sample, not for all pairs.

    The kernels' tails bring the ratio down at the rim of the pairs, by a tenth of the information
    or less.
    """
    x, y = gaussian_pair(rho, 1000)
    expected = float(information_density(x, y, rho).mean())
    assert expected == pytest.approx(-np.log(1 - rho**2) / 2, abs=3 * abs(rho) / np.sqrt(1000))
    found = maximum_likelihood_mutual_information(np.exp(x), y**3)
    assert found == pytest.approx(expected, rel=0.1, abs=0.01)
    assert found == maximum_likelihood_mutual_information(x, y)


@pytest.mark.slow
def test_independent_images_share_nothing() -> None:
    """Twice the information is at most χ² with as many degrees as kernels matter, over n."""
    for seed in range(2):
        a, b = np.random.default_rng(seed).gamma(1.0, size=(2, 800))
        assert maximum_likelihood_mutual_information(a, b) == pytest.approx(0, abs=0.01)


@pytest.mark.slow
def test_a_dependence_without_correlation() -> None:
    rng = np.random.default_rng(4)
    x = rng.normal(size=1000)
    y = x**2 + 0.1 * rng.normal(size=1000)
    assert maximum_likelihood_mutual_information(x, y) > 0.8


@pytest.mark.slow
def test_few_grey_values() -> None:
    """Kernels are all on four places: the estimate is that of the table of counts."""
    rng = np.random.default_rng(5)
    x = rng.integers(0, 2, 1000)
    y = x ^ (rng.random(1000) < 0.1)
    table = np.zeros((2, 2))
    np.add.at(table, (x, y), 1)
    found = maximum_likelihood_mutual_information(x, y)
    assert found == pytest.approx(float(mutual_information(table)), abs=1e-3)


@pytest.mark.parametrize(
    ("a", "b"),
    [([], []), ([3.0], [4.0]), (np.full(50, 7.0), np.arange(50.0)), (np.ones(50), np.ones(50))],
)
def test_images_without_content_share_nothing(a: np.ndarray, b: np.ndarray) -> None:
    assert maximum_likelihood_mutual_information(a, b) == pytest.approx(0, abs=1e-4)


@pytest.mark.slow
def test_only_a_sample_counts() -> None:
    x, y = gaussian_pair(0.8, 20_000)
    found = [
        maximum_likelihood_mutual_information(x, y, width=0.5, sample=300, seed=seed)
        for seed in (0, 0, 1)
    ]
    assert found[0] == found[1] != found[2]
    # The information density has a standard deviation of ρ.
    assert found == pytest.approx([-np.log(1 - 0.64) / 2] * 3, abs=4 * 0.8 / np.sqrt(300))


def problem(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, y = gaussian_pair(0.7, 300, seed)
    return x, y, np.column_stack([x, y])[:40]


@pytest.mark.slow
def test_the_constraints_hold() -> None:
    x, y, centres = problem()
    for width in WIDTHS:
        ratio = fit_density_ratio(x, y, centres, width)
        assert ratio.weights.min() >= 0
        freely = ratio(np.repeat(x, y.size), np.tile(y, x.size))
        assert freely.mean() == pytest.approx(1.0)


def test_against_a_general_optimiser() -> None:
    x, y, centres = problem(seed=2)
    centres, width = centres[:8], 0.8
    kernels = np.exp(
        -((x[:, None] - centres[:, 0]) ** 2 + (y[:, None] - centres[:, 1]) ** 2) / 1.28
    )
    means = np.array(
        [
            np.exp(-((x - u) ** 2) / 1.28).mean() * np.exp(-((y - v) ** 2) / 1.28).mean()
            for u, v in centres
        ]
    )
    found = minimize(
        lambda w: -np.log(kernels @ w).mean(),
        np.full(8, 1 / means.sum()),
        bounds=[(0, None)] * 8,
        constraints={"type": "eq", "fun": lambda w: w @ means - 1},
        options={"ftol": 1e-12, "maxiter": 500},
    )
    ours = np.log(fit_density_ratio(x, y, centres, width)(x, y)).mean()
    assert ours == pytest.approx(-found.fun, abs=2e-5)


@pytest.mark.slow
def test_cross_validation_prefers_what_generalises() -> None:
    """Independent pairs take wide kernels, closely related ones narrow kernels."""
    chosen = []
    for rho in (0.0, 0.8, 0.98):
        x, y = gaussian_pair(rho, 400)
        centres = np.column_stack([x, y])[:80]
        chosen.append(choose_width(x, y, centres))
    assert chosen[0] == WIDTHS[-1]
    assert chosen[0] > chosen[1] > chosen[2]


def shifted_pair(radius: int = 4) -> tuple[Patch, Patch]:
    """A template, and an image in which it lies 2 px up and 3 px to the right, of falling grey."""
    rng = np.random.default_rng(11)
    size = 30 + 2 * radius
    scene = rng.normal(size=(size, size))
    inner = slice(radius, -radius)
    image = np.exp(-np.roll(scene, (-2, 3), (0, 1)) + 0.3 * rng.normal(size=(size, size)))
    valid = np.ones((2, size, size), bool)
    valid[1, 20:, :5] = False
    return (
        Patch(scene[inner, inner].astype(np.float32), valid[0][inner, inner]),
        Patch(image.astype(np.float32), valid[1]),
    )


@pytest.mark.slow
def test_a_surface() -> None:
    template, search = shifted_pair()
    told: list[float] = []
    progress = Progress(lambda done, message: told.append(done))
    with threads(2, progress) as context:
        found = information_surface(template, search, 300, context)
        again = information_surface(template, search, 300, context.quiet())
    np.testing.assert_array_equal(found, again)
    assert found.shape == (9, 9)
    assert np.unravel_index(found.argmax(), found.shape) == (4 - 2, 4 + 3)
    # The correlation is that of a signal of 1 and noise of 0.3.
    rho_squared = 1 / 1.09
    expected = -np.log(1 - rho_squared) / 2
    assert found.max() == pytest.approx(expected, rel=0.2)
    # All other pixels are independent.
    assert np.sort(found.ravel())[-2] < 0.2
    assert told == sorted(told) and told[-1] == 1


def test_a_surface_of_a_template_without_pixels() -> None:
    template, search = shifted_pair()
    with threads(1) as context:
        nothing = Patch(template.values, np.zeros_like(template.valid))
        found = information_surface(nothing, search, 300, context)
    assert not found.any()


def test_normal_scores() -> None:
    rng = np.random.default_rng(0)
    values = rng.gamma(1.0, size=999)
    scores = normal_scores(values)
    np.testing.assert_array_equal(scores.argsort(), values.argsort())
    assert scores.mean() == pytest.approx(0, abs=1e-9)
    assert scores.std() == pytest.approx(1, abs=0.01)
    assert normal_scores([4, 4, 4]) == pytest.approx(0, abs=1e-12)
    assert normal_scores([]).shape == (0,)
