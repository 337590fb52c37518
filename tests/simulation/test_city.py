from __future__ import annotations

import numpy as np
import pytest

from groundtie.simulation.canvas import Changes
from groundtie.simulation.city import CityLayout
from groundtie.simulation.cover import Cover, ParcelBook, ParcelTable

SHAPE = (700, 800)


def laid_out(
    seed: int = 0, changed: float = 0.0, px_per_m: float = 1.0
) -> tuple[np.ndarray, np.ndarray, ParcelTable]:
    """The images' labels, and the parcels."""
    book = ParcelBook(np.random.default_rng(seed))
    changes = Changes(changed, np.random.default_rng(seed + 100))
    layout = CityLayout(
        SHAPE,
        px_per_m,
        np.random.default_rng(seed),
        book,
        changes,
        np.random.default_rng(seed + 200),
    )
    radar, camera = layout.draw()
    return radar, camera, book.table()


def shares(labels: np.ndarray, table: ParcelTable) -> dict[Cover, float]:
    counts = np.bincount(table.cover[labels].ravel(), minlength=len(Cover))
    return {cover: float(counts[cover] / labels.size) for cover in Cover}


class TestParts:
    @pytest.mark.slow
    def test_covers_of_a_city(self) -> None:
        made = [laid_out(seed) for seed in range(5)]
        found = [shares(radar, table) for radar, _, table in made]
        mean = {cover: np.mean([share[cover] for share in found]) for cover in Cover}
        assert 0.2 < mean[Cover.BUILDING] < 0.4
        assert 0.08 < mean[Cover.ASPHALT] < 0.25
        assert 0.02 < mean[Cover.FOREST] < 0.15
        assert 0.003 < mean[Cover.CAR] < 0.05
        assert mean[Cover.WATER] > 0.01
        assert mean[Cover.RAIL] > 0.01
        assert mean[Cover.FIELD] == 0

    @pytest.mark.slow
    def test_heights_reach_up_to_60_m(self) -> None:
        heights = np.concatenate(
            [t.height_m[t.cover == Cover.BUILDING] for *_, t in map(laid_out, range(3))]
        )
        assert heights.max() <= 60
        assert heights.max() > 50
        assert 10 < np.median(heights) < 25

    @pytest.mark.slow
    def test_nothing_stands_across_water_or_rails(self) -> None:
        """Their outlines do not touch them: the ground on both sides of a wall is dry."""
        book = ParcelBook(np.random.default_rng(7))
        layout_of, changing, traffic = (np.random.default_rng(seed) for seed in (7, 2, 1))
        layout = CityLayout(SHAPE, 1.0, layout_of, book, Changes(0.0, changing), traffic)
        radar, _ = layout.draw()
        cover = book.table().cover
        ground = cover[layout.labels]
        barred = np.isin(ground, (Cover.WATER, Cover.RAIL))
        assert barred.any()
        assert (cover[radar][barred] == Cover.BUILDING).mean() < 0.002

    def test_walls_have_windows(self) -> None:
        *_, table = laid_out()
        built = table.cover == Cover.BUILDING
        assert np.all((table.window_m[built] >= 2.8) & (table.window_m[built] <= 4.5))
        assert not table.window_m[~built].any()
        assert np.ptp(table.wall_reflectance[built]) > 0.15

    @pytest.mark.slow
    def test_no_cars_where_they_are_smaller_than_a_pixel(self) -> None:
        radar, _, table = laid_out(px_per_m=0.4)
        assert shares(radar, table)[Cover.CAR] < 0.01


class TestAcquisitions:
    def test_cars_drive_away_and_nothing_else_changes(self) -> None:
        radar, camera, table = laid_out(3)
        covers = table.cover[radar], table.cover[camera]
        differ = covers[0] != covers[1]
        car = (covers[0] == Cover.CAR) | (covers[1] == Cover.CAR)
        assert differ.any()
        assert np.all(car[differ])
        assert (covers[0] == Cover.CAR).mean() == pytest.approx(
            (covers[1] == Cover.CAR).mean(), rel=0.15
        )

    @pytest.mark.slow
    @pytest.mark.parametrize("changed", [0.1, 0.4])
    def test_share_of_changed_buildings(self, changed: float) -> None:
        only_radar = only_camera = number = 0
        for seed in range(4):
            radar, camera, table = laid_out(seed, changed)
            in_radar, in_camera = (
                set(np.unique(labels[table.cover[labels] == Cover.BUILDING]))
                for labels in (radar, camera)
            )
            only_radar += len(in_radar - in_camera)
            only_camera += len(in_camera - in_radar)
            number += len(in_radar | in_camera)
        # Buildings have two or three parts each: some 500 draws.
        for gone in (only_radar, only_camera):
            assert gone / number == pytest.approx(changed / 2, rel=0.35)

    @pytest.mark.slow
    def test_changes_leave_the_rest_as_it_is(self) -> None:
        unchanged, _, table = laid_out(3)
        radar, _, _ = laid_out(3, 0.2)
        built = table.cover[unchanged] == Cover.BUILDING
        assert np.array_equal(radar[~built], unchanged[~built])


class TestReproducible:
    @pytest.mark.slow
    def test_same_seed(self) -> None:
        assert np.array_equal(laid_out(9)[0], laid_out(9)[0])

    @pytest.mark.slow
    def test_other_seed(self) -> None:
        assert not np.array_equal(laid_out(9)[0], laid_out(10)[0])
