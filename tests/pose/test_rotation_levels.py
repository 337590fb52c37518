from __future__ import annotations

import math

import numpy as np
import pytest
from turned_pairs import turned_pair

from groundtie.context import Context
from groundtie.pose.pose import Pose
from groundtie.pose.rotation_fields import Template
from groundtie.pose.rotation_levels import Level, parabola


def surface_with(*peaks: tuple[int, int, float], radius: int = 20) -> np.ndarray:
    """Return a surface of 0 with paraboloid peaks at shifts (x, y), in no pixel of each other."""
    down, across = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    surface = np.zeros(down.shape, np.float32)
    for x, y, height in peaks:
        surface = np.maximum(surface, height - 0.5 * ((across - x) ** 2 + (down - y) ** 2))
    return surface.astype(np.float32)


@pytest.fixture(scope="module")
def level(context: Context) -> Level:
    return Level.of(*turned_pair(Pose(15.0, 1.2)), 2.0, [1.0, 1.2, 1.9], context)


class TestFields:
    def test_inputs_are_as_fine_as_the_reference_or_nearly(self, level: Level) -> None:
        assert level.pixel_px == 2.0
        for scale in (1.0, 1.2, 1.9):
            assert level.input(scale).pixel_px == pytest.approx(2 * scale, rel=0.1)

    def test_each_fineness_is_made_once(self, context: Context) -> None:
        level = Level.of(*turned_pair(Pose()), 2.0, np.linspace(0.97, 1.03, 9), context)
        assert len(level.inputs) == 1

    def test_the_nearest_one_is_taken(self, level: Level) -> None:
        assert level.input(5.0) is level.input(1.9)
        assert level.input(0.3) is level.input(1.0)

    def test_in_one_thread(self, level: Level, one_thread: Context) -> None:
        other = Level.of(*turned_pair(Pose(15.0, 1.2)), 2.0, [1.0, 1.2, 1.9], one_thread)
        assert list(other.inputs) == list(level.inputs)
        for scale, field in level.inputs.items():
            np.testing.assert_array_equal(field.parts, other.inputs[scale].parts)


class TestPeaks:
    def test_between_the_values(self, level: Level) -> None:
        surface = surface_with((3, -4, 10.0))
        surface[16, 24] += 0.2
        (found,) = level.peaks(surface, Pose(), math.inf, 1)
        x, y = np.array(found.pose.shift_px) / level.pixel_px
        assert 3 < x < 3.5
        assert y == pytest.approx(-4)
        assert found.height > 10

    def test_shifts_turn_and_scale_with_the_pose(self, level: Level) -> None:
        pose = Pose(90.0, 1.5, (10.0, 20.0))
        (found,) = level.peaks(surface_with((6, 0, 9.0)), pose, math.inf, 1)
        # Right in the reference is up in an input that is turned counter-clockwise by 90°.
        np.testing.assert_allclose(found.pose.shift_px, (10, 20 - 6 * 1.5 * 2), atol=1e-6)
        assert (found.pose.rotation_deg, found.pose.scale) == (90.0, 1.5)

    def test_several_best_first(self, level: Level) -> None:
        surface = surface_with((3, -4, 10.0), (-12, 8, 7.0), (4, -3, 9.0), (0, 15, 5.0))
        found = level.peaks(surface, Pose(), math.inf, 3)
        assert [round(one.height) for one in found] == [10, 7, 5]

    def test_shifts_beyond_the_radius_do_not_count(self, level: Level) -> None:
        surface = surface_with((15, 0, 10.0), (3, 2, 4.0))
        (found,) = level.peaks(surface, Pose(), 12.0, 1)
        np.testing.assert_allclose(found.pose.shift_px, (6, 4), atol=1e-6)

    def test_the_radius_is_along_the_inputs_axes(self, level: Level) -> None:
        # 14 px of the level along the diagonal are 10 along each axis of what is turned by 45°.
        for angle, inside in ((0.0, False), (45.0, True)):
            (found,) = level.peaks(surface_with((14, 0, 9.0)), Pose(angle), 22.0, 1)
            assert (found.height > 8.5) == inside

    def test_at_the_border_there_is_nothing_between(self, level: Level) -> None:
        (found,) = level.peaks(surface_with((20, -20, 9.0)), Pose(), math.inf, 1)
        np.testing.assert_allclose(found.pose.shift_px, (40, -40))

    def test_the_best_shift_of_two_images(self, level: Level) -> None:
        found = level.best(Template(level.reference, 6), Pose(15.0, 1.2, (4.0, -3.0)))
        assert np.hypot(*found.pose.shift_px) < 0.6


class TestParabola:
    @pytest.mark.parametrize("top", [-0.4, 0.0, 0.3])
    def test_its_top_is_found(self, top: float) -> None:
        values = [5 - 2 * (x - top) ** 2 for x in (-1, 0, 1)]
        place, above = parabola(values)
        assert place == pytest.approx(top)
        assert values[1] + above == pytest.approx(5)

    @pytest.mark.parametrize("values", [[1, 1, 1], [2, 1, 2], [0, 1, 2]])
    def test_without_a_top_the_middle_stays(self, values: list[float]) -> None:
        assert parabola(values) == (0.0, 0.0)
