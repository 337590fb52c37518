from __future__ import annotations

import numpy as np
import pytest

from groundtie.matching.ghost import ghost_height

RADIUS = 24


def peaked(*places: tuple[int, int, float], seed: int = 0) -> np.ndarray:
    """Return a surface of noise with peaks (right, down, height), 2 px wide."""
    shift = np.arange(-RADIUS, RADIUS + 1)
    x, y = np.meshgrid(shift, shift)
    made = 0.1 * np.random.default_rng(seed).normal(size=x.shape)
    for right, down, height in places:
        made += height * np.exp(-((x - right) ** 2 + (y - down) ** 2) / 8)
    return made.astype(np.float32)


OWN = peaked((0, 0, 40.0), (16, 0, 8.0), (-16, 0, 8.0))


def test_what_the_reference_repeats_is_no_ghost() -> None:
    mean = 0.5 * OWN + peaked(seed=1)
    assert ghost_height(mean, OWN) < 5
    assert ghost_height(mean, peaked((0, 0, 40.0))) > 20


@pytest.mark.parametrize(("place", "is_ghost"), [((-10, 12), True), ((4, -7), False)])
def test_a_place_far_from_the_peak_is_a_ghost(place: tuple[int, int], is_ghost: bool) -> None:
    mean = 0.5 * OWN + peaked((*place, 2.0), seed=1)
    assert (ghost_height(mean, OWN) > 10) == is_ghost


def test_the_slope_of_a_peak_is_none() -> None:
    """The input's peak is wider than the reference's own."""
    shift = np.arange(-RADIUS, RADIUS + 1)
    wide = 20 * np.exp(-np.hypot(*np.meshgrid(shift, shift)) / 4)
    assert ghost_height(wide.astype(np.float32) + peaked(seed=1), OWN) < 6
