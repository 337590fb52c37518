from __future__ import annotations

import numpy as np
import pytest

from groundtie.simulation.cover import BANDS, OPEN_GROUND, Cover, ParcelBook, ParcelTable


def drawn(cover: Cover, count: int = 400, seed: int = 0) -> ParcelTable:
    book = ParcelBook(np.random.default_rng(seed))
    for _ in range(count):
        book.add(cover)
    return book.table()


class TestParcelBook:
    def test_numbers_count_up_and_index_the_table(self) -> None:
        book = ParcelBook(np.random.default_rng(0))
        assert [book.add(Cover.ROAD), book.add(Cover.BUILDING, 7.5), book.add(Cover.FIELD, 0, 1)]
        table = book.table()
        assert table.cover.tolist() == [Cover.ROAD, Cover.BUILDING, Cover.FIELD]
        assert table.height_m.tolist() == [0, 7.5, 0]
        assert table.rows_rad.tolist() == [0, 0, 1]

    def test_types_and_shapes(self) -> None:
        table = drawn(Cover.FIELD, 3)
        assert (table.cover.dtype, table.height_m.dtype) == (np.uint8, np.float32)
        assert table.backscatter_db.dtype == table.reflectance.dtype == np.float32
        assert table.reflectance.shape == (3, len(BANDS))

    def test_same_generator_same_parcels(self) -> None:
        first, second = drawn(Cover.FIELD, 20), drawn(Cover.FIELD, 20)
        assert np.array_equal(first.reflectance, second.reflectance)
        assert np.array_equal(first.backscatter_db, second.backscatter_db)


class TestRadiometry:
    @pytest.mark.parametrize("cover", list(Cover))
    def test_reflectance_is_physical(self, cover: Cover) -> None:
        table = drawn(cover)
        assert table.reflectance.min() > 0
        assert table.reflectance.max() < 0.7

    def test_vegetation_is_brightest_in_the_near_infrared_and_water_darkest(self) -> None:
        for cover in (Cover.FOREST, Cover.GRASS):
            red, nir = drawn(cover).reflectance[:, 2:].T
            assert np.all(nir > 2 * red)
        red, nir = drawn(Cover.WATER).reflectance[:, 2:].T
        assert np.all(nir < red)

    def test_radar_and_camera_do_not_agree_on_fields(self) -> None:
        table = drawn(Cover.FIELD, 2000)
        for band in range(len(BANDS)):
            r = np.corrcoef(table.backscatter_db, table.reflectance[:, band])[0, 1]
            # 1 / sqrt(2000) = 0.022 is the deviation of the correlation of unrelated numbers.
            assert abs(r) < 0.08

    def test_classes_rank_differently(self) -> None:
        radar = {cover: drawn(cover).backscatter_db.mean() for cover in Cover}
        camera = {cover: drawn(cover).reflectance[:, :3].mean() for cover in Cover}
        # Both brighter: neither a falling nor a rising relation would hold for all classes.
        assert radar[Cover.FIELD] > radar[Cover.WATER]
        assert camera[Cover.FIELD] > camera[Cover.WATER]
        assert radar[Cover.FOREST] > radar[Cover.ROAD]
        assert camera[Cover.FOREST] < camera[Cover.ROAD]

    def test_roads_are_dark_or_bright_to_the_camera_and_dark_to_the_radar(self) -> None:
        table = drawn(Cover.ROAD)
        visible = table.reflectance[:, :3].mean(axis=1)
        assert (visible < 0.12).any()
        assert (visible > 0.22).any()
        assert table.backscatter_db.max() < drawn(Cover.FIELD).backscatter_db.min()


def test_open_ground_has_nothing_that_stands_or_flows() -> None:
    assert not {Cover.BUILDING, Cover.FOREST, Cover.WATER} & set(OPEN_GROUND)
