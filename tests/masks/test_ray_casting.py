"""What hides and is laid over the ground, against geometry by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from groundtie.masks.ray_casting import (
    Heights,
    LineOfSight,
    double_bounce,
    hidden_ground,
    radar_echoes,
)

HEIGHT_M, PIXEL_M = 24.0, 0.5
ROWS, COLS = slice(110, 170), slice(120, 160)
SHAPE = (280, 281)

# Columns and rows for a metre towards each side.
SIDES = {"left": (-1, 0), "right": (1, 0), "up": (0, -1), "down": (0, 1)}


def towards(side: str) -> tuple[float, float]:
    col, row = SIDES[side]
    return col / PIXEL_M, row / PIXEL_M


def box(slope: float = 0.0) -> Heights:
    """Return a house on a plain that rises to the right."""
    ground = np.tile(np.arange(SHAPE[1], dtype=np.float32) * slope * PIXEL_M, (SHAPE[0], 1))
    surface = ground.copy()
    surface[ROWS, COLS] += HEIGHT_M
    return Heights(surface, ground)


def length_m(mask: np.ndarray, side: str) -> float:
    """Return how long what is beside the box, in the line of its middle, is along a side's axis."""
    beside = mask.copy()
    beside[ROWS, COLS] = False
    line = beside[140] if SIDES[side][0] else beside[:, 140]
    return float(line.sum() * PIXEL_M)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("angle_deg", [20.0, 35.0, 50.0])
def test_a_box_hides_its_height_times_the_tangent_away_from_the_sensor(
    side: str, angle_deg: float
) -> None:
    hidden = hidden_ground(box(), LineOfSight(towards(side), angle_deg))
    expected_m = HEIGHT_M * math.tan(math.radians(angle_deg))
    assert length_m(hidden, side) == pytest.approx(expected_m, abs=PIXEL_M)
    col, row = SIDES[side]
    assert hidden[140 - row * 40, 140 - col * 30] and not hidden[140 + row * 40, 140 + col * 30]


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("incidence_deg", [25.0, 35.0, 50.0])
def test_a_box_is_laid_over_its_height_by_the_tangent_towards_the_radar(
    side: str, incidence_deg: float
) -> None:
    echoes = radar_echoes(box(), LineOfSight(towards(side), incidence_deg))
    expected_m = HEIGHT_M / math.tan(math.radians(incidence_deg))
    assert length_m(echoes > 0, side) == pytest.approx(expected_m, abs=PIXEL_M)
    col, row = SIDES[side]
    assert echoes[140 + row * 32, 140 + col * 22] > 0
    assert echoes[140 - row * 32, 140 - col * 22] == 0


def test_the_sun_casts_shadows_of_height_by_the_tangent_of_its_elevation() -> None:
    sunlight = LineOfSight(towards("up"), 90 - 40.0)
    shaded = hidden_ground(box(), sunlight)
    assert length_m(shaded, "up") == pytest.approx(
        HEIGHT_M / math.tan(math.radians(40)), abs=PIXEL_M
    )


def test_an_oblique_azimuth_hides_as_long_a_strip() -> None:
    azimuth = math.radians(205)
    step = math.sin(azimuth) / PIXEL_M, -math.cos(azimuth) / PIXEL_M
    surface = np.zeros(SHAPE, np.float32)
    surface[139:142, 139:142] = HEIGHT_M
    hidden = hidden_ground(Heights(surface, np.zeros_like(surface)), LineOfSight(step, 45.0))
    rows, cols = np.nonzero(hidden)
    far = np.hypot(rows - 140, cols - 140).argmax()
    away_m = np.array([cols[far] - 140, rows[far] - 140]) * PIXEL_M
    expected_m = [-HEIGHT_M * math.sin(azimuth), HEIGHT_M * math.cos(azimuth)]
    np.testing.assert_allclose(away_m, expected_m, atol=2 * PIXEL_M)


def test_ground_that_rises_away_from_the_sensor_is_hidden_less() -> None:
    slope, angle = 0.2, math.radians(35)
    hidden = hidden_ground(box(slope), LineOfSight(towards("left"), 35.0))
    # The roof's far edge is as much higher as the ground there.
    expected_m = HEIGHT_M / (1 / math.tan(angle) + slope)
    assert length_m(hidden, "left") == pytest.approx(expected_m, abs=PIXEL_M)


def test_a_slope_towards_the_radar_lengthens_what_is_laid_over_it() -> None:
    slope, lean = 0.2, 1 / math.tan(math.radians(35))
    echoes = radar_echoes(box(slope), LineOfSight(towards("left"), 35.0))
    # Ground x and roof 0 have one range: x − slope·x·lean = −(height)·lean.
    expected_m = HEIGHT_M * lean / (1 - slope * lean)
    assert length_m(echoes > 0, "left") == pytest.approx(expected_m, abs=2 * PIXEL_M)


def test_nothing_is_hidden_from_the_zenith_nor_on_bare_ground() -> None:
    assert not hidden_ground(box(), LineOfSight((1.0, 0.0), 0.0)).any()
    ground = box(0.1).ground_m
    bare, sight = Heights(ground, ground), LineOfSight(towards("left"), 40.0)
    assert not hidden_ground(bare, sight).any() and not radar_echoes(bare, sight).any()


@pytest.mark.parametrize(
    ("side", "place"),
    [
        ("left", (ROWS, slice(119, 120))),
        ("right", (ROWS, slice(160, 161))),
        ("up", (slice(109, 110), COLS)),
        ("down", (slice(170, 171), COLS)),
    ],
)
def test_double_bounce_lies_at_the_feet_of_walls_that_face_the_radar(
    side: str, place: tuple[slice, slice]
) -> None:
    expected = np.zeros(SHAPE)
    expected[place] = HEIGHT_M / PIXEL_M
    found = double_bounce(box(), LineOfSight(towards(side), 40.0))
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_double_bounce_needs_a_wall_and_ground_that_the_radar_sees() -> None:
    sight = LineOfSight(towards("left"), 45.0)
    ground = box(0.3).ground_m
    assert not double_bounce(Heights(ground, ground), sight).any()
    behind, alone = box(), double_bounce(box(), sight)
    # 20 m behind a house of 24 m: its foot is hidden, at 45° from 24 m on no more.
    behind.surface_m[ROWS, 200:210] = HEIGHT_M
    np.testing.assert_array_equal(double_bounce(behind, sight), alone)
    beyond = box()
    beyond.surface_m[ROWS, 212:222] = HEIGHT_M
    assert double_bounce(beyond, sight)[ROWS, 211].min() == pytest.approx(HEIGHT_M / PIXEL_M)


def test_what_the_radar_does_not_see_is_laid_over_nothing() -> None:
    heights = box()
    heights.surface_m[ROWS, 161:170] = 3.0  # in the box's radar shadow
    sight = LineOfSight(towards("left"), 45.0)
    np.testing.assert_array_equal(radar_echoes(heights, sight), radar_echoes(box(), sight))
