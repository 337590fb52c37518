from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundtie.simulation.polygons import (
    Polygon,
    area,
    clip,
    contains,
    fitted_rectangle,
    inset,
    main_frame,
    points_along,
    rectangle,
    subdivide,
)

SQUARE: Polygon = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]

angles = st.floats(0, 2 * math.pi)


def is_convex(polygon: Polygon) -> bool:
    corners = np.array(polygon)
    edges = np.roll(corners, -1, axis=0) - corners
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    return bool(np.all(turns >= -1e-6) or np.all(turns <= 1e-6))


class TestArea:
    def test_square(self) -> None:
        assert area(SQUARE) == 100

    def test_triangle_in_either_sense(self) -> None:
        triangle: Polygon = [(0, 0), (4, 0), (0, 3)]
        assert area(triangle) == area(triangle[::-1]) == 6

    @given(angles)
    def test_does_not_depend_on_the_turn(self, angle: float) -> None:
        assert area(rectangle((3, -2), (4, 5), angle)) == pytest.approx(80)


class TestClip:
    def test_half_of_a_square(self) -> None:
        kept = clip(SQUARE, (5, 0), (1, 0))
        assert sorted(kept) == [(5, 0), (5, 10), (10, 0), (10, 10)]

    def test_everything(self) -> None:
        assert clip(SQUARE, (-1, 0), (1, 0)) == SQUARE

    def test_nothing(self) -> None:
        assert clip(SQUARE, (11, 0), (1, 0)) == []

    @given(angles, st.floats(-12, 12))
    def test_both_sides_make_the_whole(self, angle: float, offset: float) -> None:
        normal = (math.cos(angle), math.sin(angle))
        point = (5 + offset * normal[0], 5 + offset * normal[1])
        parts = (clip(SQUARE, point, normal), clip(SQUARE, point, (-normal[0], -normal[1])))
        assert sum(area(part) for part in parts if part) == pytest.approx(100)

    @given(angles, st.floats(-6, 6))
    def test_stays_on_its_side_and_convex(self, angle: float, offset: float) -> None:
        normal = (math.cos(angle), math.sin(angle))
        point = (5 + offset * normal[0], 5 + offset * normal[1])
        kept = clip(SQUARE, point, normal)
        for x, y in kept:
            assert (x - point[0]) * normal[0] + (y - point[1]) * normal[1] >= -1e-9
        assert not kept or is_convex(kept)


class TestContains:
    @pytest.mark.parametrize("order", [1, -1], ids=["counter-clockwise", "clockwise"])
    def test_inside_and_outside(self, order: int) -> None:
        assert contains(SQUARE[::order], (5, 5))
        assert not contains(SQUARE[::order], (5, 11))
        assert not contains(SQUARE[::order], (-0.1, 5))


class TestPointsAlong:
    def test_square(self) -> None:
        points = points_along(SQUARE, 2)
        assert points == [(0, 0), (5, 0), (10, 0), (10, 5), (10, 10), (5, 10), (0, 10), (0, 5)]

    def test_one_per_side_are_the_corners(self) -> None:
        assert points_along(SQUARE, 1) == SQUARE


class TestMainFrame:
    @given(st.floats(-50, 50), st.floats(-50, 50), st.floats(2, 30), st.floats(0.2, 0.9), angles)
    def test_recovers_a_rectangle(
        self, x: float, y: float, half: float, ratio: float, angle: float
    ) -> None:
        centre, found, turn = main_frame(rectangle((x, y), (half, half * ratio), angle))
        assert centre == pytest.approx((x, y), abs=1e-6)
        assert found == pytest.approx((half, half * ratio), rel=1e-6)
        assert math.sin(turn - angle) == pytest.approx(0, abs=1e-6)


class TestFittedRectangle:
    def test_fills_a_rectangle_as_asked(self) -> None:
        box = fitted_rectangle(rectangle((0, 0), (20, 10), 0.3), (0.5, 0.8))
        assert box is not None
        assert area(box) == pytest.approx(800 * 0.4)

    @given(st.lists(angles, min_size=3, max_size=7, unique=True), st.floats(0.3, 1.0))
    def test_lies_inside(self, turns: list[float], fill: float) -> None:
        polygon = [(10 * math.cos(t), 10 * math.sin(t)) for t in sorted(turns)]
        box = fitted_rectangle(polygon, (fill, fill))
        assert box is None or all(contains(polygon, corner) for corner in box)

    def test_gives_up_on_a_needle(self) -> None:
        needle: Polygon = [(0, 0), (100, 0), (0, 1)]
        assert fitted_rectangle(needle, (1, 1)) is None


class TestSubdivide:
    def test_cells_cover_the_polygon(self) -> None:
        done = subdivide(rectangle((0, 0), (100, 60), 0.4), 300, 0, np.random.default_rng(1))
        assert done.lanes == []
        assert sum(map(area, done.cells)) == pytest.approx(200 * 120)

    def test_cells_and_lanes_cover_the_polygon(self) -> None:
        done = subdivide(rectangle((0, 0), (100, 60), 0.4), 900, 4, np.random.default_rng(1))
        covered = sum(map(area, done.cells)) + sum(map(area, done.lanes))
        assert covered == pytest.approx(200 * 120, rel=1e-3)

    def test_cells_are_convex_and_of_the_wanted_size(self) -> None:
        done = subdivide(rectangle((0, 0), (100, 60), 0.4), 300, 2, np.random.default_rng(5))
        assert all(map(is_convex, done.cells))
        # A cell is cut as long as it is larger than 0.8 to 2 times the wanted size.
        assert max(map(area, done.cells)) < 2 * 300
        assert 0.3 * 300 < np.mean(list(map(area, done.cells))) < 1.4 * 300

    def test_cells_are_not_needles(self) -> None:
        done = subdivide(rectangle((0, 0), (100, 60), 0.4), 300, 0, np.random.default_rng(5))
        ratios = [max(half) / min(half) for half in (main_frame(c)[1] for c in done.cells)]
        assert np.median(ratios) < 2
        assert max(ratios) < 5

    def test_lanes_are_as_wide_as_asked(self) -> None:
        done = subdivide(rectangle((0, 0), (100, 60), 0), 9000, 6, np.random.default_rng(0))
        for lane in done.lanes:
            length = max(main_frame(lane)[1]) * 2
            # The ends of a lane are cut slanted.
            assert area(lane) / length == pytest.approx(6, rel=0.1)

    def test_follows_its_generator(self) -> None:
        def cut(seed: int) -> list[Polygon]:
            return subdivide(SQUARE, 5, 0, np.random.default_rng(seed)).cells

        assert cut(3) == cut(3)
        assert cut(3) != cut(4)


class TestInset:
    def test_of_a_turned_rectangle(self) -> None:
        inner = inset(rectangle((10, 20), (8, 6), 0.4), 1.5)
        np.testing.assert_allclose(inner, rectangle((10, 20), (6.5, 4.5), 0.4))

    def test_sides_move_by_the_distance(self) -> None:
        outer = [(0.0, 0.0), (100.0, 10.0), (90.0, 80.0), (-10.0, 60.0)]
        inner = inset(outer, 7.0)
        assert inner is not None
        for k, (a, b) in enumerate(zip(outer, outer[1:] + outer[:1], strict=True)):
            along = np.subtract(b, a) / math.dist(a, b)
            for corner in (inner[k], inner[(k + 1) % 4]):
                x, y = np.subtract(corner, a)
                assert along[0] * y - along[1] * x == pytest.approx(7)

    def test_none_where_nothing_is_left(self) -> None:
        assert inset(rectangle((0, 0), (20, 5), 0.0), 6.0) is None
        assert inset([(0.0, 0.0), (100.0, 0.0), (0.0, 20.0)], 5.0) is None
