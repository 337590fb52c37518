"""SPSA: on functions whose maximum is known, and on windows whose shift is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import affine_transform, gaussian_filter
from speckled_pairs import whole

from groundtie.context import Context
from groundtie.errors import ParameterError
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose
from groundtie.rasters.patch import Patch
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.climbing import Effort, PoseSpace
from groundtie.studies.spsa import (
    ALPHA,
    GAMMA,
    PATIENCE,
    Gains,
    climb_first_order,
    climb_second_order,
    discrete_spsa,
    spsa,
    spsa_second_order,
)

Place = tuple[float, ...]
NMI = SimilaritySettings("nmi")
LITTLE = Effort(restarts=15)
ORDERS = [climb_first_order, climb_second_order]
TOP = (6.0, -9.0)


def hill(place: Place) -> float:
    """Return a smooth function with one maximum, far wider one way than the other."""
    x, y = np.subtract(place[:2], TOP)
    return float(np.exp(-(x**2 + 0.6 * x * y + 0.4 * y**2) / 400))


def ascend(
    climb: Callable[..., Place], function: Callable[[Place], float], seed: int, **space: object
) -> tuple[Place, Any]:
    similarity = cache(function)
    where = PoseSpace(SearchLimits(20), 30.0, **space)  # type: ignore[arg-type]
    rng = np.random.default_rng(seed)
    return climb(similarity, where, (-15.0, 12.0), rng, Gains(look_px=1.0)), similarity


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("climb", ORDERS)
def test_the_top_of_a_smooth_hill_is_reached(climb: Callable[..., Place], seed: int) -> None:
    found, similarity = ascend(climb, hill, seed)
    np.testing.assert_allclose(found, TOP, atol=1.5)
    assert PATIENCE < similarity.cache_info().misses < 400


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_steepness_does_not_matter(seed: int, factor: float) -> None:
    """Slopes are measured by their own usual size."""
    for climb in ORDERS:
        found, _ = ascend(climb, hill, seed)
        scaled, _ = ascend(climb, lambda place: factor * hill(place), seed)
        np.testing.assert_allclose(scaled, found, atol=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_the_discrete_climb_stays_on_the_grid(seed: int) -> None:
    asked: list[Place] = []

    def function(place: Place) -> float:
        asked.append(place)
        return hill(place)

    found, similarity = ascend(climb_first_order, function, seed, origin=(0.0, 0.0))
    assert np.abs(np.subtract(found, TOP)).max() <= 1
    assert all(x == round(x) and y == round(y) for x, y in asked)
    # What was evaluated is remembered.
    assert len(asked) == len(set(asked)) == similarity.cache_info().misses


@pytest.mark.parametrize("climb", ORDERS)
def test_looks_stay_within_limits(climb: Callable[..., Place]) -> None:
    asked: list[Place] = []

    def outward(place: Place) -> float:
        asked.append(place)
        return place[0] + place[1]

    found, _ = ascend(climb, outward, 0)
    assert found == (20.0, 20.0)
    assert np.abs(asked).max() == 20


def test_a_climb_on_a_plain_gives_up() -> None:
    """Three looks a step, one of them where it stands, and 40 of them without a change."""
    start, space = (3.0, 4.0), PoseSpace(SearchLimits(20), 30.0)
    plain = cache(lambda _: 1.0)
    found = climb_first_order(plain, space, start, np.random.default_rng(0), Gains())
    assert found == start
    steps = -(-PATIENCE // 3)
    assert plain.cache_info().misses == 2 * steps + 1


def test_a_climb_of_second_order_on_a_plain_gives_up() -> None:
    """Five looks a step; some of them may meet."""
    start, space = (3.0, 4.0), PoseSpace(SearchLimits(20), 30.0)
    plain = cache(lambda _: 1.0)
    assert climb_second_order(plain, space, start, np.random.default_rng(0), Gains()) == start
    steps = -(-PATIENCE // 5)
    assert 2 * steps < plain.cache_info().misses <= 4 * steps + 1


def test_a_step_of_first_order_is_spalls() -> None:
    """Along a slope that never changes: a_k times the direction of the perturbation."""
    gains = Gains(step_px=1.0, look_px=0.5, steady=4.0)
    asked: list[Place] = []

    def slope(place: Place) -> float:
        asked.append(place)
        return place[0]

    space = PoseSpace(SearchLimits(1e6), 30.0)
    climb_first_order(
        cache(lambda p: slope(p) if len(asked) < 60 else 0.0),
        space,
        (0.0, 0.0),
        np.random.default_rng(0),
        gains,
    )
    start, *others = np.array(asked[:31])
    for k, (ahead, behind, new) in enumerate(np.array(others).reshape(10, 3, 2)):
        c = 0.5 / (k + 1) ** GAMMA
        np.testing.assert_allclose(np.abs(ahead - start), c)
        np.testing.assert_allclose(ahead + behind, 2 * start, atol=1e-9)
        # The slope is 1 along x; signs of the estimate follow the perturbation.
        signs = np.sign(ahead - start)
        a = (5 / (k + 5)) ** ALPHA
        np.testing.assert_allclose(new - start, a * signs * signs[0], rtol=1e-9)
        start = new


def texture(side: int, seed: int = 0) -> np.ndarray:
    values = gaussian_filter(np.random.default_rng(seed).normal(size=(side, side)), 3)
    return np.asarray(values / values.std())


def posed(pose: Pose, side: int = 64, margin: int = 20) -> tuple[Patch, Patch]:
    """Return a window and its inverted, noisy image, which lies at a pose."""
    ground = texture(side + 80)
    inner = slice(40, 40 + side)
    size = side + 2 * margin
    t = ~pose.between((side, side), (size, size))
    matrix = np.array([[t.e, t.d], [t.b, t.a]])
    moved = affine_transform(ground, matrix, (t.f + 40, t.c + 40), (size, size), order=3)
    noise = np.random.default_rng(9).normal(0, 0.1, moved.shape)
    return whole(ground[inner, inner]), whole(noise - moved)


@pytest.mark.parametrize("seed", range(3))
def test_the_discrete_search_finds_a_known_shift(seed: int, context: Context) -> None:
    windows = posed(Pose(shift_px=(11.0, -5.0)))
    found = replace(discrete_spsa, effort=Effort(agreeing=3))(
        *windows, SearchLimits(20), NMI, replace(context, seed=seed)
    )
    assert found[0].pose == Pose(shift_px=(11.0, -5.0))
    assert found[0].height > 5
    assert found[0].evaluations < 41**2 / 3
    assert len({candidate.evaluations for candidate in found}) == 1


@pytest.mark.slow
@pytest.mark.parametrize("search", [spsa, spsa_second_order])
def test_continuous_searches_find_a_known_shift(
    search: Callable[..., list], context: Context
) -> None:
    windows = posed(Pose(shift_px=(-6.4, 3.3)))
    found = replace(search, effort=LITTLE)(*windows, SearchLimits(12), NMI, context)
    np.testing.assert_allclose(found[0].pose.shift_px, (-6.4, 3.3), atol=0.7)
    assert (found[0].pose.rotation_deg, found[0].pose.scale) == (0.0, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("search", [spsa, spsa_second_order])
def test_rotation_and_scale_are_found_with_the_shift(
    search: Callable[..., list], context: Context
) -> None:
    truth = Pose(4.0, 1.05, (3.0, -2.0))
    found = replace(search, effort=LITTLE)(
        *posed(truth), SearchLimits(6, 8, (0.9, 1.1)), NMI, context
    )[0].pose
    assert found.rotation_deg == pytest.approx(4.0, abs=1.0)
    assert found.scale == pytest.approx(1.05, abs=0.02)
    np.testing.assert_allclose(found.shift_px, truth.shift_px, atol=0.8)


def test_windows_of_unlike_parity(context: Context) -> None:
    """Their pixels meet where the centres are half a pixel apart."""
    ground = texture(100)
    reference, input = whole(ground[20:80, 20:80]), whole(-ground[9:92, 11:94])
    found = replace(discrete_spsa, effort=Effort(agreeing=4))(
        reference, input, SearchLimits(8), NMI, context
    )
    # Reference pixel (0, 0) is input pixel (9, 11); the centres are at 29.5 and 41.
    assert found[0].pose.shift_px == (9 + 29.5 - 41, 11 + 29.5 - 41)


@pytest.mark.slow
def test_the_seed_decides(context: Context) -> None:
    windows = posed(Pose(shift_px=(4.0, 3.0)), side=40)
    effort = Effort(restarts=3, agreeing=2)
    for search in (spsa, spsa_second_order, discrete_spsa):
        run = partial(replace(search, effort=effort), *windows, SearchLimits(8), NMI)
        one, same, other = (run(replace(context, seed=seed)) for seed in (3, 3, 4))
        assert one == same
        assert one != other


@pytest.mark.parametrize("search", [spsa, spsa_second_order, discrete_spsa])
def test_flat_windows_have_no_pose(search: Callable[..., list], context: Context) -> None:
    flat, textured = whole(np.ones((40, 40))), whole(texture(40))
    for one, other in ((flat, textured), (textured, flat)):
        assert search(one, other, SearchLimits(5), NMI, context) == []


@pytest.mark.parametrize("limits", [SearchLimits(5, 1.0), SearchLimits(5, scale=(0.9, 1.1))])
def test_discrete_spsa_neither_rotates_nor_scales(limits: SearchLimits, context: Context) -> None:
    window = whole(texture(40))
    with pytest.raises(ParameterError, match="shifts alone"):
        discrete_spsa(window, window, limits, NMI, context)


@pytest.mark.parametrize("search", [spsa, spsa_second_order, discrete_spsa])
def test_without_room_the_nominal_pose_is_found(
    search: Callable[..., list], context: Context
) -> None:
    window = whole(texture(40))
    (found,) = search(window, window, SearchLimits(0), NMI, context)
    assert found.pose == Pose()
    assert (found.height, found.evaluations) == (0.0, 1)
