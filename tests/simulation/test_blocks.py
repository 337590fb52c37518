from __future__ import annotations

import cv2
import numpy as np
import pytest

from groundtie.simulation.blocks import HIGHEST_M, QUARTERS, Builder, Building, lots, perimeter
from groundtie.simulation.polygons import Polygon, area, contains, rectangle

BLOCK = rectangle((200, 150), (60, 45), 0.3)
BUILDERS = [pytest.param(quarter.build, id=quarter.build.__name__) for quarter in QUARTERS]


def built(build: Builder, scale: float = 1.0, block: Polygon = BLOCK) -> list[Building]:
    return build(block, scale, np.random.default_rng(1))


def test_shares_of_the_quarters_make_a_whole() -> None:
    assert sum(quarter.share for quarter in QUARTERS) == pytest.approx(1)


def test_streets_are_8_to_30_m_wide() -> None:
    assert min(q.street_m[0] for q in QUARTERS) >= 8
    assert max(q.street_m[1] for q in QUARTERS) <= 30


@pytest.mark.parametrize("build", BUILDERS)
class TestBuilders:
    def test_everything_stands_inside_the_block(self, build: Builder) -> None:
        shrunk = rectangle((200, 150), (60 + 1e-6, 45 + 1e-6), 0.3)
        corners = [c for b in built(build) for outline, _ in b for c in outline]
        assert corners
        assert all(contains(shrunk, corner) for corner in corners)

    def test_nothing_is_higher_than_said(self, build: Builder) -> None:
        for seed in range(20):
            for building in build(BLOCK, 1.0, np.random.default_rng(seed)):
                assert min(h for _, h in building) > 0
                assert max(h for _, h in building) <= HIGHEST_M

    def test_later_parts_are_higher_than_the_first(self, build: Builder) -> None:
        for building in built(build):
            assert all(h > building[0][1] for _, h in building[1:])

    def test_scale_changes_pixels_and_not_heights(self, build: Builder) -> None:
        double = [(2 * x, 2 * y) for x, y in BLOCK]
        for one, two in zip(built(build), built(build, 2.0, double), strict=True):
            for (outline, height), (larger, same) in zip(one, two, strict=True):
                assert same == pytest.approx(height)
                assert area(larger) == pytest.approx(4 * area(outline))


class TestPerimeter:
    def test_houses_surround_a_courtyard(self) -> None:
        image = np.zeros((300, 400))
        for seed in range(10):
            drawn = np.zeros(image.shape, np.uint8)
            for building in perimeter(BLOCK, 1.0, np.random.default_rng(seed)):
                cv2.fillConvexPoly(drawn, np.rint(building[0][0]).astype(np.int32), 1)
            image += drawn / 10
        row, column = np.mgrid[:300, :400]
        u = (column - 200) * np.cos(0.3) + (row - 150) * np.sin(0.3)
        v = (row - 150) * np.cos(0.3) - (column - 200) * np.sin(0.3)
        edge = np.minimum(60 - abs(u), 45 - abs(v))
        # One house in 25 is missing, and half of the yards have a small building at the back.
        assert image[(edge > 1) & (edge < 10)].mean() == pytest.approx(0.96, abs=0.03)
        assert image[(edge > 17)].mean() < 0.2

    def test_pointed_blocks_are_built_over_as_lots(self) -> None:
        wedge = [(0.0, 0.0), (120.0, 0.0), (0.0, 30.0)]
        assert built(perimeter, block=wedge) == built(lots, block=wedge)
