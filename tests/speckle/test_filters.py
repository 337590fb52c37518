from __future__ import annotations

import math

import numpy as np
import pytest

from groundtie.speckle.filters import FILTERS, SpeckleFilter

ADAPTIVE = [name for name in FILTERS if name != "isef"]
LOOKS = 3.0


def speckled(power: np.ndarray, looks: float, seed: int = 0) -> np.ndarray:
    speckle = np.random.default_rng(seed).gamma(looks, 1 / looks, power.shape)
    return (power * speckle).astype(np.float32)


def everywhere(image: np.ndarray) -> np.ndarray:
    return np.ones(image.shape, bool)


def by_the_formula(
    name: str, image: np.ndarray, valid: np.ndarray, at: tuple[int, int], half: int
) -> float:
    """Return one filtered pixel, by the papers' formulas and nothing else."""
    rows = range(max(at[0] - half, 0), min(at[0] + half + 1, image.shape[0]))
    cols = range(max(at[1] - half, 0), min(at[1] + half + 1, image.shape[1]))
    near = [(r, c) for r in rows for c in cols if valid[r, c]]
    values = np.array([image[place] for place in near], float)
    mean, pixel = values.mean(), float(image[at])
    variation2, speckle2 = values.var() / mean**2, 1 / LOOKS
    if name in ("lee", "kuan"):
        weight = max(1 - speckle2 / variation2, 0) / (1 + speckle2 if name == "kuan" else 1)
        return mean + weight * (pixel - mean)
    if name == "gamma-map":
        if variation2 <= speckle2:
            return mean
        if variation2 >= 2 * speckle2:
            return pixel
        alpha = (1 + speckle2) / (variation2 - speckle2)
        b = (alpha - LOOKS - 1) * mean
        return (b + math.sqrt(b**2 + 4 * alpha * LOOKS * mean * pixel)) / (2 * alpha)
    most = math.sqrt(1 + 2 / LOOKS)
    if math.sqrt(variation2) <= math.sqrt(speckle2):
        return mean
    if math.sqrt(variation2) >= most:
        return pixel
    share = (math.sqrt(variation2) - math.sqrt(speckle2)) / (most - math.sqrt(variation2))
    weights = [math.exp(-share * (abs(r - at[0]) + abs(c - at[1]))) for r, c in near]
    return float(np.average(values, weights=weights))


@pytest.mark.parametrize("window", [3, 7])
@pytest.mark.parametrize("name", ADAPTIVE)
@pytest.mark.slow
def test_every_pixel_is_what_the_formula_says(name: str, window: int) -> None:
    power = np.ones((40, 44))
    power[:, 20:] = 9.0
    power[25, 30] = 400.0
    image = speckled(power, LOOKS)
    valid = np.random.default_rng(2).random(image.shape) < 0.85
    for known in (everywhere(image), valid):
        found = SpeckleFilter(name, window, LOOKS)(image, known)
        places = [(r, c) for r in range(40) for c in range(44) if known[r, c]]
        expected = [by_the_formula(name, image, known, at, window // 2) for at in places]
        np.testing.assert_allclose([found[at] for at in places], expected, rtol=2e-3)


@pytest.mark.parametrize("name", FILTERS)
def test_invalid_pixels_are_0_and_weigh_nothing(name: str) -> None:
    image = speckled(np.full((60, 60), 5.0), LOOKS)
    valid = everywhere(image)
    valid[20:30, 25:50] = False
    spoilt = np.where(valid, image, np.float32(1e9))
    plain, other = (SpeckleFilter(name, 7, LOOKS)(part, valid) for part in (image, spoilt))
    np.testing.assert_array_equal(plain, other)
    assert not plain[~valid].any()


@pytest.mark.parametrize("name", FILTERS)
def test_nothing_beside_strong_scatterers_has_less_power_than_none(name: str) -> None:
    image = np.zeros((200, 200), np.float32)
    image[:150, :150] = speckled(np.ones((150, 150)), 1.0)
    image[:100] *= 1e9
    assert SpeckleFilter(name, 7, 1.0)(image, everywhere(image)).min() >= 0


@pytest.mark.parametrize("name", ADAPTIVE)
def test_tiles_leave_no_seams(name: str) -> None:
    image = speckled(np.ones((300, 530)), LOOKS)
    smooth = SpeckleFilter(name, 7, LOOKS)
    whole = smooth(image, everywhere(image))
    # Cut elsewhere, the result is the same as far as the filter reaches.
    part = smooth(image[100:290, 60:400].copy(), everywhere(image)[100:290, 60:400])
    np.testing.assert_allclose(whole[103:287, 63:397], part[3:-3, 3:-3], rtol=1e-5)


# Equivalent looks after a 7 × 7 mean are 49 times as many; adaptive filters take local
# fluctuations for scene and lose some, Lee the most.
LEAST_GAIN = {"enhanced-frost": 25, "lee": 12, "kuan": 20, "gamma-map": 12, "isef": 40}


@pytest.mark.parametrize("looks", [1.0, 4.0])
@pytest.mark.parametrize("name", FILTERS)
def test_speckle_is_smoothed_and_the_mean_stays(name: str, looks: float) -> None:
    image = speckled(np.full((300, 300), 8.0), looks)
    smooth = SpeckleFilter(name, 7, looks)(image, everywhere(image))
    after = float(smooth.mean() ** 2 / smooth.var())
    assert LEAST_GAIN[name] * looks < after < 55 * looks
    # The likeliest value of a skew distribution lies below its mean.
    assert smooth.mean() == pytest.approx(8.0, rel=0.05 if name == "gamma-map" else 0.01)


@pytest.mark.parametrize("name", ADAPTIVE)
def test_edges_stay_sharper_than_under_a_mean(name: str) -> None:
    power = np.ones((200, 200))
    power[:, 100:] = 30.0
    image = speckled(power, 4.0)
    smooth = SpeckleFilter(name, 9, 4.0)(image, everywhere(image))
    profile = smooth.mean(axis=0)
    # Beside the edge a mean over 9 px is off by 4 / 9 of the step.
    assert profile[100:103].mean() > 1 + 0.8 * 29
    assert profile[97:100].mean() < 1 + 0.2 * 29


@pytest.mark.parametrize("name", ["enhanced-frost", "gamma-map"])
def test_strong_targets_stay_as_they_are(name: str) -> None:
    power = np.ones((50, 50))
    power[25, 25] = 1e4
    image = speckled(power, LOOKS)
    assert SpeckleFilter(name, 7, LOOKS)(image, everywhere(image))[25, 25] == image[25, 25]
