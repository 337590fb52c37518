from __future__ import annotations

import cv2
import numpy as np
import pytest

from groundtie.simulation.canvas import Changes
from groundtie.simulation.cover import Cover, ParcelBook, ParcelTable
from groundtie.simulation.layout import CANOPY_M, DENSITIES, Layout, highest_object_m


def laid_out(
    density: str, seed: int = 0, shape: tuple[int, int] = (700, 800), px_per_m: float = 1.0
) -> tuple[np.ndarray, ParcelTable]:
    book = ParcelBook(np.random.default_rng(seed))
    changes = Changes(0.0, np.random.default_rng(1))
    layout = Layout(shape, px_per_m, np.random.default_rng(seed), book, changes, density)
    return layout.draw()[0], book.table()


def share(labels: np.ndarray, table: ParcelTable, cover: Cover) -> float:
    return float(np.mean(table.cover[labels] == cover))


class TestDensities:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("density", "low", "high"),
        [("rural", 0.0, 0.03), ("suburban", 0.08, 0.25), ("urban", 0.4, 0.55)],
    )
    def test_built_share(self, density: str, low: float, high: float) -> None:
        built = [share(*laid_out(density, seed), Cover.BUILDING) for seed in range(6)]
        assert low <= np.mean(built) <= high

    @pytest.mark.parametrize(
        ("density", "low", "high"), [("rural", 3, 8), ("suburban", 4, 12), ("urban", 10, 60)]
    )
    @pytest.mark.slow
    def test_heights(self, density: str, low: float, high: float) -> None:
        _, table = laid_out(density, 1)
        heights = table.height_m[table.cover == Cover.BUILDING]
        assert heights.min() >= low
        assert heights.max() <= high

    def test_urban_heights_spread_over_the_range(self) -> None:
        _, table = laid_out("urban", 1)
        heights = table.height_m[table.cover == Cover.BUILDING]
        assert np.percentile(heights, 10) < 13
        assert heights.max() > 45

    @pytest.mark.parametrize("density", list(DENSITIES))
    def test_weights_of_the_uses_make_a_whole(self, density: str) -> None:
        assert sum(weight for _, weight in DENSITIES[density]) == pytest.approx(1)

    @pytest.mark.parametrize("density", list(DENSITIES))
    def test_nothing_is_higher_than_said(self, density: str) -> None:
        _, table = laid_out(density, 2)
        assert table.height_m.max() <= highest_object_m(density)

    def test_highest_object(self) -> None:
        assert highest_object_m("urban") == 60
        assert highest_object_m("rural") == CANOPY_M[1]


class TestParts:
    @pytest.mark.parametrize("density", list(DENSITIES))
    @pytest.mark.slow
    def test_scene_has_roads_and_a_river_across(self, density: str) -> None:
        labels, table = laid_out(density, 3)
        assert share(labels, table, Cover.ROAD) > 0.02
        water = table.cover[labels] == Cover.WATER
        assert max(water.any(axis=0).mean(), water.any(axis=1).mean()) > 0.6

    def test_rural_scene_is_fields_of_many_directions_of_plough_rows(self) -> None:
        labels, table = laid_out("rural", 4)
        assert share(labels, table, Cover.FIELD) > 0.4
        fields = np.unique(labels[table.cover[labels] == Cover.FIELD])
        assert len(fields) > 10
        assert len(np.unique(table.rows_rad[fields])) > 5

    def test_woods_have_canopies(self) -> None:
        labels, table = laid_out("rural", 4, shape=(1200, 1200))
        woods = np.unique(labels[table.cover[labels] == Cover.FOREST])
        assert len(woods) > 0
        assert np.all(table.height_m[woods] > 3)

    @pytest.mark.slow
    @pytest.mark.parametrize("density", ["suburban", "urban"])
    def test_no_building_stands_across_water(self, density: str) -> None:
        labels, table = laid_out(density, 5)
        water = table.cover[labels] == Cover.WATER
        assert water.any()
        for number in np.unique(labels[table.cover[labels] == Cover.BUILDING]):
            row, column = np.nonzero(labels == number)
            hull = cv2.convexHull(np.column_stack([column, row]).astype(np.int32))
            x, y, width, height = cv2.boundingRect(hull)
            body = np.zeros((height, width), np.uint8)
            cv2.fillConvexPoly(body, hull - [x, y], 1)
            # Probes are a few metres apart: a bank may take a nibble, a river may not run through.
            assert water[y : y + height, x : x + width][body > 0].mean() < 0.03

    def test_streets_do_not_follow_the_raster(self) -> None:
        """The main direction is drawn: over seeds it takes all values."""
        turns = [laid_out("rural", seed, (300, 300))[1].rows_rad for seed in range(8)]
        directions = [np.median(t[t > 0] % (np.pi / 2)) for t in turns]
        assert np.ptp(directions) > 0.5


class TestReproducible:
    def test_same_seed(self) -> None:
        assert np.array_equal(laid_out("urban", 9)[0], laid_out("urban", 9)[0])

    def test_other_seed(self) -> None:
        assert not np.array_equal(laid_out("urban", 9)[0], laid_out("urban", 10)[0])

    @pytest.mark.slow
    def test_scale_changes_sizes_in_pixels(self) -> None:
        fine, fine_table = laid_out("suburban", 6, px_per_m=1.0)
        coarse, coarse_table = laid_out("suburban", 6, px_per_m=0.4)
        assert (coarse_table.cover == Cover.BUILDING).sum() > 3 * (
            fine_table.cover == Cover.BUILDING
        ).sum()
        assert share(coarse, coarse_table, Cover.BUILDING) == pytest.approx(
            share(fine, fine_table, Cover.BUILDING), abs=0.08
        )
