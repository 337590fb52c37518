from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from raster_files import UTM, utm_grid, wave_image, write_raster
from rasterio.crs import CRS

from groundtie.errors import GeoreferencingError, NoOverlapError, RasterContentError
from groundtie.pose.pose import Pose
from groundtie.pose.rotation_windows import LONGEST_PX, PoseWindows, read_windows
from groundtie.rasters.grid import Grid, apply_affine
from groundtie.rasters.pair import Image
from groundtie.rasters.reading import open_raster

SCALES = (0.5, 2.0)


@contextmanager
def images(*paths: Path) -> Iterator[list[Image]]:
    sources = [open_raster(path) for path in paths]
    yield [Image(source) for source in sources]
    for source in sources:
        source.close()


def windows_of(reference: Path, input: Path, **more: Any) -> PoseWindows:
    with images(reference, input) as pair:
        return read_windows(*pair, more.pop("scale", SCALES), **more)


def waves(path: Path, grid: Grid, georeferenced: bool = True) -> Path:
    values = wave_image(grid, 400.0).astype(np.float32)
    return write_raster(path, values, grid if georeferenced else None)


def corners(width: int, height: int) -> np.ndarray:
    return np.array([[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]], float)


class TestWithGeoreferencing:
    def test_windows_lie_at_their_nominal_places(self, tmp_path: Path) -> None:
        grid = utm_grid(120, 100)
        # Stored upside down, at another pixel size, the input has the same nominal ground.
        turned = Grid(Affine(-5, 0, 501_100, 0, 5, 4_999_100), UTM, 200, 180)
        windows = windows_of(waves(tmp_path / "a.tif", grid), waves(tmp_path / "b.tif", turned))
        assert windows.is_georeferenced
        assert windows.pixel_m == pytest.approx(10)
        seen = []
        for patch, place in (
            (windows.reference, windows.reference_grid),
            (windows.input, windows.input_grid),
        ):
            assert place.transform.a > 0 > place.transform.e
            expected = wave_image(place, 400.0)
            np.testing.assert_allclose(patch.values[patch.valid], expected[patch.valid], atol=0.5)
            seen.append(place.pixel_to_map([place.centre_px])[0])
        np.testing.assert_allclose(seen[0], seen[1])

    def test_another_crs(self, tmp_path: Path) -> None:
        grid = utm_grid(60, 50, 100.0)
        degrees = Grid(Affine(0.001, 0, 9.0, 0, -0.001, 45.152), CRS.from_epsg(4326), 80, 50)
        windows = windows_of(
            waves(tmp_path / "a.tif", grid),
            write_raster(
                tmp_path / "b.tif", np.random.default_rng(0).normal(size=(50, 80)), degrees
            ),
        )
        centre = windows.input_grid.pixel_to_map([windows.input_grid.centre_px])
        px = windows.nominal(centre)
        assert degrees.contains(px).all()
        assert windows.input.valid.any()

    def test_maps_in_degrees_get_square_pixels(self, tmp_path: Path) -> None:
        grid = Grid(Affine(0.001, 0, 9.0, 0, -0.001, 60.0), CRS.from_epsg(4326), 90, 80)
        windows = windows_of(waves(tmp_path / "a.tif", grid), waves(tmp_path / "b.tif", grid))
        width, height = windows.reference_grid.pixel_size
        # At 60° north a degree of longitude is half as long as one of latitude.
        assert width / height == pytest.approx(2, rel=0.01)

    @pytest.mark.slow
    @pytest.mark.parametrize("west", [179.95, 349.95])
    @pytest.mark.parametrize("turns", [(0, -360), (-360, 0)])
    def test_longitudes_may_count_from_elsewhere(
        self, tmp_path: Path, west: float, turns: tuple[int, int]
    ) -> None:
        degrees, pose = CRS.from_epsg(4326), Pose(20.0, 1.1, (3.0, -2.0))
        values = np.random.default_rng(0).normal(size=(80, 90))
        found = []
        for own, other in ((0, 0), turns):
            paths = [
                write_raster(
                    tmp_path / name,
                    values,
                    Grid(Affine(0.001, 0, west + turn, 0, -0.001, 10.0), degrees, 90, 80),
                )
                for name, turn in (("a.tif", own), ("b.tif", other))
            ]
            windows = windows_of(*paths)
            transform = windows.transform(pose)
            again = windows.pose(transform)
            assert again.rotation_deg == pytest.approx(pose.rotation_deg, abs=1e-6)
            assert again.shift_px == pytest.approx(pose.shift_px, abs=1e-6)
            places = windows.reference_grid.pixel_to_map(windows.reference_grid.places())
            found.append((windows.input.values, transform(places)))
        np.testing.assert_allclose(found[1][0], found[0][0], atol=1e-5)
        np.testing.assert_allclose(found[1][1], found[0][1], atol=1e-6)

    def test_large_images_are_reduced(self, tmp_path: Path) -> None:
        grid = utm_grid(1300, 900)
        windows = windows_of(waves(tmp_path / "a.tif", grid), waves(tmp_path / "b.tif", grid))
        assert max(windows.reference.values.shape) == LONGEST_PX
        assert windows.pixel_m == pytest.approx(13_000 / LONGEST_PX)

    def test_a_large_reference_is_cut_to_where_the_input_may_lie(self, tmp_path: Path) -> None:
        here = utm_grid(400, 400).window(300, 320, 60, 50)
        windows = windows_of(
            waves(tmp_path / "a.tif", utm_grid(400, 400)),
            waves(tmp_path / "b.tif", here),
            scale=(1.0, 1.0),
            radius_m=200.0,
        )
        reach = np.hypot(600, 500) / 2 + 200
        assert windows.reference_grid.width * 10 < 2 * reach + 20
        assert windows.limits(10, (1.0, 1.0)).radius == pytest.approx(20)

    def test_the_default_radius_is_a_quarter_of_the_input(self, tmp_path: Path) -> None:
        grid = utm_grid(120, 100)
        windows = windows_of(waves(tmp_path / "a.tif", grid), waves(tmp_path / "b.tif", grid))
        assert windows.radius_m == pytest.approx(300)


class TestWithoutGeoreferencing:
    def test_all_of_both_is_read_pixel_by_pixel(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(0)
        arrays = [rng.uniform(1, 200, shape).astype(np.float32) for shape in ((90, 81), (120, 111))]
        paths = [write_raster(tmp_path / f"{i}.tif", a) for i, a in enumerate(arrays)]
        windows = windows_of(*paths)
        assert not windows.is_georeferenced
        assert windows.pixel_m == 1
        np.testing.assert_allclose(windows.reference.values, arrays[0], atol=1e-3)
        np.testing.assert_allclose(windows.input.values, arrays[1], atol=1e-3)

    @pytest.mark.parametrize("shape", [(90, 80), (131, 120)])
    def test_the_transform_is_the_pose_between_centres(
        self, tmp_path: Path, shape: tuple[int, int]
    ) -> None:
        rng = np.random.default_rng(0)
        reference = write_raster(tmp_path / "a.tif", rng.uniform(1, 9, (100, 110)))
        input = write_raster(tmp_path / "b.tif", rng.uniform(1, 9, shape))
        windows = windows_of(reference, input)
        pose = Pose(33.0, 1.2, (4.0, -7.0))
        px = corners(110, 100)
        transform = windows.transform(pose)
        # Map positions are pixel coordinates.
        np.testing.assert_allclose(
            transform(px), apply_affine(pose.between((100, 110), shape), px), atol=1e-6
        )
        np.testing.assert_allclose(transform.inverse(transform(px)), px, atol=1e-6)


class TestTransform:
    @pytest.mark.parametrize("pose", [Pose(), Pose(-30.0, 1.3, (12.5, -7.0))])
    def test_the_pose_of_its_transform_is_the_same(self, tmp_path: Path, pose: Pose) -> None:
        reference = waves(tmp_path / "reference.tif", utm_grid(100, 80))
        windows = windows_of(reference, waves(tmp_path / "input.tif", utm_grid(90, 120, 20.0)))
        again = windows.pose(windows.transform(pose))
        assert again.rotation_deg == pytest.approx(pose.rotation_deg, abs=1e-6)
        assert again.scale == pytest.approx(pose.scale, rel=1e-9)
        np.testing.assert_allclose(again.shift_px, pose.shift_px, atol=1e-6)

    def test_without_a_pose_it_is_the_nominal_one(self, tmp_path: Path) -> None:
        grid, other = utm_grid(100, 90), utm_grid(60, 50, 20.0)
        windows = windows_of(waves(tmp_path / "a.tif", grid), waves(tmp_path / "b.tif", other))
        xy = grid.pixel_to_map(corners(100, 90))
        np.testing.assert_allclose(windows.transform(Pose())(xy), other.map_to_pixel(xy), atol=1e-6)

    def test_a_shift_to_the_right_is_one_to_the_east(self, tmp_path: Path) -> None:
        grid = utm_grid(100, 90)
        windows = windows_of(waves(tmp_path / "a.tif", grid), waves(tmp_path / "b.tif", grid))
        moved = windows.transform(Pose(shift_px=(3.0, 2.0)))
        xy = grid.pixel_to_map(corners(100, 90))
        np.testing.assert_allclose(moved.model(xy) - xy, [[30.0, -20.0]] * 4, atol=1e-6)


class TestErrors:
    def test_only_one_is_georeferenced(self, tmp_path: Path) -> None:
        grid = utm_grid(50, 50)
        reference, input = waves(tmp_path / "a.tif", grid), waves(tmp_path / "b.tif", grid, False)
        with pytest.raises(GeoreferencingError, match=r"b\.tif has no georeferencing"):
            windows_of(reference, input)
        with pytest.raises(GeoreferencingError, match=r"b\.tif has no georeferencing"):
            windows_of(input, reference)

    def test_only_one_has_a_crs(self, tmp_path: Path) -> None:
        grid = utm_grid(50, 50)
        reference = waves(tmp_path / "a.tif", grid)
        input = waves(tmp_path / "b.tif", Grid(grid.transform, None, 50, 50))
        with pytest.raises(GeoreferencingError, match=r"b\.tif has no CRS"):
            windows_of(reference, input)

    def test_too_far_apart(self, tmp_path: Path) -> None:
        reference = waves(tmp_path / "a.tif", utm_grid(50, 50))
        input = waves(tmp_path / "b.tif", utm_grid(50, 50).shifted(5_000, 0))
        with pytest.raises(NoOverlapError, match="do not overlap"):
            windows_of(reference, input)

    @pytest.mark.parametrize(
        ("values", "message"), [(0.0, r"b\.tif has no valid pixel"), (5.0, r"b\.tif is constant")]
    )
    def test_nothing_to_compare(self, tmp_path: Path, values: float, message: str) -> None:
        reference = waves(tmp_path / "a.tif", utm_grid(50, 50))
        input = write_raster(
            tmp_path / "b.tif", np.full((50, 50), values, np.float32), utm_grid(50, 50), nodata=0
        )
        with pytest.raises(RasterContentError, match=message):
            windows_of(reference, input)


@pytest.mark.parametrize("which", [0, 1])
def test_a_mask_that_leaves_nothing_is_named(tmp_path: Path, which: int) -> None:
    grid = utm_grid(50, 50)
    paths = [waves(tmp_path / name, grid) for name in ("a.tif", "b.tif")]
    mask = write_raster(tmp_path / "mask.tif", np.zeros((50, 50), np.uint8), grid)
    name = paths[which].name
    with images(*paths) as pair, open_raster(mask) as hides:
        pair[which] = Image(pair[which].source, None, hides)
        with pytest.raises(RasterContentError, match=rf"the mask of .*/{name} leaves nothing"):
            read_windows(*pair, SCALES)


@pytest.mark.parametrize("which", [0, 1])
def test_masks_of_the_images_hide_what_they_hide(tmp_path: Path, which: int) -> None:
    grid = utm_grid(120, 100)
    paths = [waves(tmp_path / name, grid) for name in ("a.tif", "b.tif")]
    shown = np.ones((100, 120), np.uint8)
    shown[:, :30] = 0
    mask = write_raster(tmp_path / "mask.tif", shown, grid)
    with images(*paths) as pair, open_raster(mask) as hides:
        pair[which] = Image(pair[which].source, None, hides)
        windows = read_windows(*pair, SCALES)
    patches = windows.reference, windows.input
    grids = windows.reference_grid, windows.input_grid
    easting = grids[which].pixel_to_map([[col, 0] for col in range(grids[which].width)])[:, 0]
    column = easting > grid.pixel_to_map([[29.5, 0]])[0, 0]
    middle = patches[which].values.shape[0] // 2
    covered = patches[1 - which].valid[patches[1 - which].values.shape[0] // 2].any()
    assert covered
    inside = (easting > grid.pixel_to_map([[0, 0]])[0, 0]) & (
        easting < grid.pixel_to_map([[119, 0]])[0, 0]
    )
    np.testing.assert_array_equal(patches[which].valid[middle][inside], column[inside])
