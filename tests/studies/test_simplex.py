"""Powell and Nelder–Mead: on functions whose maximum is known, and on windows whose pose is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import affine_transform, gaussian_filter
from speckled_pairs import whole

from groundtie.context import Context
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose
from groundtie.rasters.patch import Patch
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.climbing import Effort, PoseSpace
from groundtie.studies.simplex import NELDER_MEAD, POWELL, climb, nelder_mead, powell

Place = tuple[float, ...]
NMI = SimilaritySettings("nmi")
LITTLE = Effort(restarts=15)
METHODS = [POWELL, NELDER_MEAD]
SEARCHES = [powell, nelder_mead]
RNG = np.random.default_rng(0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0, 0.0), (-20.0, 20.0, 5.0, -5.0)])
def test_the_top_of_a_paraboloid_is_reached(method: str, start: Place) -> None:
    """Four dimensions, rotation and scale among them, that depend on each other."""
    space = PoseSpace(SearchLimits(20, 30, (0.5, 2.0)), 40.0)
    top = np.array([6.3, -9.1, 4.0, -8.0])
    mixed = np.eye(4) + 0.3

    def paraboloid(place: Place) -> float:
        off = np.array(place) - top
        return float(1.05 - 1e-4 * off @ mixed @ off)

    similarity = cache(paraboloid)
    found = climb(similarity, space, start, RNG, method)
    np.testing.assert_allclose(found, top, atol=0.2)
    assert similarity.cache_info().misses <= 400


@pytest.mark.parametrize("method", METHODS)
def test_places_stay_within_limits(method: str) -> None:
    asked: list[Place] = []

    def outward(place: Place) -> float:
        asked.append(place)
        return place[0] - place[1]

    space = PoseSpace(SearchLimits(7), 30.0)
    found = climb(cache(outward), space, (0.0, 0.0), RNG, method)
    np.testing.assert_allclose(found, (7.0, -7.0), atol=0.1)
    assert np.abs(asked).max() <= 7


@pytest.mark.parametrize("method", METHODS)
def test_evaluations_are_places_that_were_asked_for(method: str) -> None:
    asked: list[Place] = []

    def hill(place: Place) -> float:
        asked.append(place)
        return -float(np.hypot(place[0] - 2, place[1] + 3))

    similarity = cache(hill)
    climb(similarity, PoseSpace(SearchLimits(7), 30.0), (0.0, 0.0), RNG, method)
    assert similarity.cache_info().misses == len(asked) == len(set(asked))


@pytest.mark.parametrize("method", METHODS)
def test_a_start_that_nothing_beats_is_kept(method: str) -> None:
    start = (7.0, -7.0)
    space = PoseSpace(SearchLimits(7), 30.0)
    found = climb(cache(lambda p: float(p == start)), space, start, RNG, method)
    assert found == start


def texture(side: int) -> np.ndarray:
    values = gaussian_filter(np.random.default_rng(0).normal(size=(side, side)), 3)
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


@pytest.mark.slow
@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("shift", [(-6.4, 3.3), (5.0, 10.0)])
def test_a_known_shift_is_found(
    search: Callable[..., list], shift: tuple[float, float], context: Context
) -> None:
    windows = posed(Pose(shift_px=shift))
    found = replace(search, effort=Effort(agreeing=5))(*windows, SearchLimits(12), NMI, context)
    np.testing.assert_allclose(found[0].pose.shift_px, shift, atol=0.2)
    assert (found[0].pose.rotation_deg, found[0].pose.scale) == (0.0, 1.0)
    assert found[0].height > 5


@pytest.mark.slow
@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize(
    ("truth", "limits"),
    [
        (Pose(4.0, 1.0, (3.0, -2.0)), SearchLimits(6, 8)),
        (Pose(-3.0, 1.06, (-2.0, 1.5)), SearchLimits(6, 8, (0.9, 1.1))),
    ],
    ids=["rigid", "similarity"],
)
def test_rotation_and_scale_are_found_with_the_shift(
    search: Callable[..., list], truth: Pose, limits: SearchLimits, context: Context
) -> None:
    found = replace(search, effort=LITTLE)(*posed(truth), limits, NMI, context)[0].pose
    assert found.rotation_deg == pytest.approx(truth.rotation_deg, abs=0.3)
    assert found.scale == pytest.approx(truth.scale, abs=0.005)
    np.testing.assert_allclose(found.shift_px, truth.shift_px, atol=0.3)


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.slow
def test_a_known_scale_is_kept(search: Callable[..., list], context: Context) -> None:
    truth = Pose(0.0, 1.1, (2.0, -1.0))
    found = replace(search, effort=LITTLE)(
        *posed(truth), SearchLimits(5, scale=(1.1, 1.1)), NMI, context
    )[0].pose
    assert found.scale == 1.1
    np.testing.assert_allclose(found.shift_px, truth.shift_px, atol=0.3)


@pytest.mark.parametrize("search", SEARCHES)
def test_the_same_seed_finds_the_same(search: Callable[..., list], context: Context) -> None:
    windows = posed(Pose(shift_px=(2.0, 1.0)), side=40)
    effort, context = Effort(restarts=3, agreeing=2), replace(context, seed=2)
    one, other = (
        replace(search, effort=effort)(*windows, SearchLimits(6), NMI, context) for _ in range(2)
    )
    assert one == other


@pytest.mark.parametrize("search", SEARCHES)
def test_flat_windows_have_no_pose(search: Callable[..., list], context: Context) -> None:
    flat, textured = whole(np.ones((40, 40))), whole(texture(40))
    for one, other in ((flat, textured), (textured, flat)):
        assert search(one, other, SearchLimits(5), NMI, context) == []


@pytest.mark.parametrize("search", SEARCHES)
def test_without_room_the_nominal_pose_is_found(
    search: Callable[..., list], context: Context
) -> None:
    window = whole(texture(40))
    (found,) = search(window, window, SearchLimits(0), NMI, context)
    assert found.pose == Pose()
    assert found.height == 0.0
