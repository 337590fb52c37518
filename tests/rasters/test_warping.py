from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rasterio.warp
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from raster_files import utm_grid, wave_image, waves, write_raster
from rasterio.crs import CRS

from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, apply_affine, compose, reproject
from groundtie.rasters.lattice import NOWHERE, coordinates, lattice
from groundtie.rasters.metadata import rounded
from groundtie.rasters.reading import Window, open_raster
from groundtie.rasters.warping import METHODS, reduction, resample, sample, source_window

RNG = np.random.default_rng(0)
PLANE = Grid(PIXEL_COORDINATES, None, 100, 80)


def every_pixel(grid: Grid) -> np.ndarray:
    cols, rows = np.meshgrid(np.arange(grid.width), np.arange(grid.height))
    return grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))


def bent(xy: np.ndarray) -> np.ndarray:
    x, y = xy.T / 100
    return 100 * np.column_stack([x + 0.05 * y**2 + 0.02 * x**3, y - 0.04 * x * y])


@pytest.mark.parametrize("amplitude", [0.0, 0.3, 5.0])
@pytest.mark.parametrize("size", [(100, 80), (1, 1), (1, 200), (65, 64), (200, 3)])
def test_coordinates_are_good_to_a_hundredth_of_a_pixel(
    amplitude: float, size: tuple[int, int]
) -> None:
    def wavy(xy: np.ndarray) -> np.ndarray:
        return bent(xy) + amplitude * np.sin(xy[:, ::-1] / 17)

    grid = Grid(PIXEL_COORDINATES, None, *size)
    px = coordinates(grid, wavy)
    assert px.shape == (2, size[1], size[0])
    expected = wavy(every_pixel(grid)).T.reshape(px.shape)
    assert np.abs(px - expected).max() < 0.01


def test_a_straight_map_is_evaluated_at_few_places() -> None:
    asked = []

    def affine(xy: np.ndarray) -> np.ndarray:
        asked.append(len(xy))
        return apply_affine(compose(Affine.rotation(3), Affine.scale(1.1)), xy)

    grid = utm_grid(512, 512)
    px = coordinates(grid, affine)
    expected = affine(every_pixel(grid)).T.reshape(px.shape)
    np.testing.assert_allclose(px, expected, atol=1e-6)
    assert sum(asked[:-1]) < 500


def test_positions_outside_of_a_projection_are_nowhere() -> None:
    def half(xy: np.ndarray) -> np.ndarray:
        return np.where(xy[:, :1] < 40, xy, np.inf)

    px = coordinates(PLANE, half)
    np.testing.assert_array_equal(px[0, :, :40], np.broadcast_to(np.arange(40.0), (80, 40)))
    assert (px[:, :, 40:] < -1e6).all()
    image, valid = np.ones((80, 100), np.float32), np.ones((80, 100), bool)
    for method in METHODS:
        _, known = resample(image, valid, px, method)
        assert known[:, :40].all()
        assert not known[:, 40:].any()


def test_a_lattice_knows_whether_it_lies_on_the_image() -> None:
    nodes = lattice(PLANE, lambda xy: xy)
    assert nodes.lies_within(100, 80)
    assert not nodes.lies_within(99, 80)
    assert not lattice(PLANE, lambda xy: xy - 0.6).lies_within(100, 80)
    assert lattice(PLANE, lambda xy: xy * 0.5 + 10).lies_within(100, 80)


def shifted(image: np.ndarray, dx: float, dy: float, method: str) -> tuple[np.ndarray, np.ndarray]:
    cols, rows = np.meshgrid(np.arange(image.shape[1]) + dx, np.arange(image.shape[0]) + dy)
    return resample(image, np.ones(image.shape, bool), np.stack([cols, rows]), method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "dtype", ["uint8", "int16", "uint16", "int32", "uint32", "float32", "float64", "complex64"]
)
def test_whole_shifts_move_pixels_unchanged(method: str, dtype: str) -> None:
    limit = {"uint8": 255, "int16": 32767, "uint16": 65535}.get(dtype, 2**31 - 1)
    image = RNG.integers(0, limit, (30, 40)).astype(dtype)
    image[10, 10] = limit
    values, known = shifted(image, 3, -2, method)
    assert values.dtype == image.dtype
    np.testing.assert_allclose(values[2:, :-3], image[:-2, 3:], rtol=1e-6)
    assert known[2:, :-3].all()
    assert not known[:2].any()
    assert not known[:, -3:].any()
    assert not values[~known].any()


# In 25 px long waves of amplitude 30, bilinear errs by 30 (2 pi / 25)^2 / 8 along each axis. Cubic
# is of third order. Lanczos, not exact for ramps, moves the image by up to 0.025 px.
@pytest.mark.parametrize(("method", "most"), [("bilinear", 0.6), ("cubic", 0.1), ("lanczos", 0.19)])
@pytest.mark.parametrize("shift", [(0.5, 0.5), (-0.25, 0.75), (0.125, 0.0)])
def test_a_smooth_image_is_found_between_its_pixels(
    method: str, most: float, shift: tuple[float, float]
) -> None:
    grid = utm_grid(80, 60)
    image = wave_image(grid, 250)
    values, known = shifted(image, *shift, method)
    xy = grid.pixel_to_map(grid.map_to_pixel(every_pixel(grid)) + shift)
    error = np.abs(values - waves(xy, 250).reshape(values.shape))[8:-8, 8:-8]
    assert known[8:-8, 8:-8].all()
    assert error.max() < most


def test_nearest_takes_the_nearest() -> None:
    image = np.arange(12, dtype=np.int64).reshape(3, 4) + 2**60
    px = np.array([[[0.4, 0.6, 3.4, 3.6]], [[0.0, 1.4, 1.6, 0.0]]])
    values, known = resample(image, np.ones((3, 4), bool), px, "nearest")
    assert known.tolist() == [[True, True, True, False]]
    assert (values[0, :3] - 2**60).tolist() == [0, 5, 11]


@pytest.mark.parametrize("noise", [0.0, 1e-8])
@pytest.mark.parametrize(("dx", "dy"), [(0.5, 0.0), (-0.5, 0.5), (1.5, -2.5), (0.0, -0.5)])
def test_halfway_between_pixels_nearest_takes_those_of_gdal(
    dx: float, dy: float, noise: float
) -> None:
    """Each pixel once, however rounding moves the positions, and whichever window is read."""
    image = np.arange(1, 1201, dtype=np.uint16).reshape(30, 40)
    place = Affine(10, 0, 500_000, 0, -10, 5_000_000)
    expected = np.zeros_like(image)
    rasterio.warp.reproject(
        image,
        expected,
        src_transform=place,
        dst_transform=compose(place, Affine.translation(dx, dy)),
        src_crs="EPSG:32633",
        dst_crs="EPSG:32633",
        resampling=rasterio.warp.Resampling.nearest,
    )
    px = np.stack(np.meshgrid(np.arange(40.0) + dx, np.arange(30.0) + dy))
    px += RNG.uniform(-noise, noise, px.shape)
    for corner in ((0, 0), (1, 0), (0, 1)):
        part = px - np.reshape(corner, (2, 1, 1))
        window = image[corner[1] :, corner[0] :]
        found = resample(window, np.ones(window.shape, bool), part, "nearest")[0]
        inner = (slice(4, -4),) * 2
        np.testing.assert_array_equal(found[inner], expected[inner])
    whole = resample(image, np.ones(image.shape, bool), px, "nearest")[0]
    np.testing.assert_array_equal(whole, expected)


@pytest.mark.parametrize("method", METHODS)
def test_a_void_of_a_pixel_stays_one_halfway(method: str) -> None:
    valid = np.ones((20, 40), bool)
    valid[:, [10, 21]] = False
    px = np.stack(np.meshgrid(np.arange(2, 38) + 0.5, np.arange(5.0, 10.0)))
    _, known = resample(np.ones(valid.shape, np.float32), valid, px, method)
    for row in known:
        assert px[0, 0, ~row].tolist() == [9.5, 20.5]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("nodata", [-9999.0, 1e30])
def test_nodata_never_bleeds(method: str, nodata: float) -> None:
    """A constant image stays constant, however its holes are shaped."""
    image = np.full((40, 40), 50.0, np.float32)
    valid = cv2.GaussianBlur(RNG.random((40, 40)), (0, 0), 1.5) > 0.47
    image[~valid] = nodata
    cols, rows = np.meshgrid(np.linspace(1, 38, 91), np.linspace(1, 38, 91))
    values, known = resample(image, valid, np.stack([cols, rows]), method)
    np.testing.assert_allclose(values[known], 50, rtol=1e-5)
    nearest = valid[np.rint(rows).astype(int), np.rint(cols).astype(int)]
    np.testing.assert_array_equal(known, nearest)
    assert 0.2 < known.mean() < 0.9


@settings(max_examples=25)
@given(
    method=st.sampled_from(METHODS),
    seed=st.integers(0, 99),
    dx=st.integers(-96, 96).map(lambda n: n / 32),
    dy=st.integers(-96, 96).map(lambda n: n / 32),
)
def test_valid_exactly_where_the_nearest_pixel_is(
    method: str, seed: int, dx: float, dy: float
) -> None:
    rng = np.random.default_rng(seed)
    valid = rng.random((12, 14)) > 0.3
    image = rng.integers(10, 20, valid.shape).astype(np.uint8)
    cols, rows = np.meshgrid(np.arange(14) + dx, np.arange(12) + dy)
    values, known = resample(image, valid, np.stack([cols, rows]), method)
    padded = np.pad(valid, 8)
    expected = padded[np.floor(rows + 8.5).astype(int), np.floor(cols + 8.5).astype(int)]
    np.testing.assert_array_equal(known, expected)
    assert not values[~known].any()
    if method in ("nearest", "bilinear") and known.any():
        assert values[known].min() >= 10
        assert values[known].max() <= 19


def test_integers_are_rounded_and_clipped() -> None:
    image = np.zeros((20, 20), np.uint8)
    image[:, 10:] = 255
    values, _ = shifted(image, 0.5, 0, "cubic")
    # A step overshoots on both sides: at 8.5 and 10.5 it would be -16 and 271.
    assert values[10, 8] == 0
    assert values[10, 10] == 255
    assert values[10, 9] == 128


@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint64])
def test_the_largest_integers_do_not_wrap(dtype: Any) -> None:
    largest = np.iinfo(dtype).max
    for precision in (np.float32, np.float64):
        values = rounded(np.array([largest, 2.0 * largest], precision), np.dtype(dtype))
        np.testing.assert_allclose(values.astype(float), float(largest), rtol=1e-7)


def test_complex_values_keep_their_phase() -> None:
    grid = utm_grid(60, 50)
    image = wave_image(grid, 300) * np.exp(1j * wave_image(grid, 500) / 50)
    values, _ = shifted(image.astype(np.complex64), 0.5, 0.25, "cubic")
    xy = grid.pixel_to_map(grid.map_to_pixel(every_pixel(grid)) + [0.5, 0.25])
    expected = (waves(xy, 300) * np.exp(1j * waves(xy, 500) / 50)).reshape(values.shape)
    assert np.abs(values - expected)[8:-8, 8:-8].max() < 0.1


@pytest.mark.parametrize(
    ("map_size", "expected"), [(1, (1, 1)), (14, (1, 1)), (16, (2, 2)), (40, (4, 4)), (37, (4, 4))]
)
def test_reduction_by_pixel_size(map_size: float, expected: tuple[int, int]) -> None:
    grid = utm_grid(300, 300)
    assert reduction(utm_grid(50, 50, map_size), grid.map_to_pixel, (99, 99)) == expected


def test_reduction_does_not_mind_rotation_nor_infinity() -> None:
    turn = compose(Affine.rotation(40), Affine.scale(2, 5))
    assert reduction(PLANE, lambda xy: apply_affine(Affine.rotation(45), xy), (9, 9)) == (1, 1)
    assert reduction(PLANE, lambda xy: apply_affine(turn, xy), (9, 9)) == (4, 4)
    assert reduction(PLANE, lambda xy: xy * np.inf, (9, 9)) == (1, 1)
    # An image has no more pixels to average than it has.
    assert reduction(PLANE, lambda xy: xy * 1e30, (9, 7)) == (9, 7)


def test_the_source_window_holds_the_kernel_and_starts_at_multiples() -> None:
    px = np.array([[[10.2, 30.7]], [[5.0, 8.0]]])
    assert source_window(px, (100, 100), "bilinear") == Window(8, 3, 26, 8)
    col, row, width, height = source_window(px, (100, 100), "cubic", (4, 3))
    assert (col % 4, row % 3, width % 4, height % 3) == (0, 0, 0, 0)
    assert col <= 10 - 12
    assert row + height > 8 + 9
    far = source_window(px + 1000, (100, 100), "cubic")
    assert far.width == far.height == 0


def test_reduction_is_that_where_the_input_is_seen() -> None:
    """A tenth of a grid shows it, far from its centre; elsewhere positions are unknown."""
    image = utm_grid(400, 400, 10.0)
    wide = utm_grid(4000, 100, 40.0)

    def to_px(xy: np.ndarray) -> np.ndarray:
        px = image.map_to_pixel(xy)
        return np.where(px[:, :1] < 1000, px, np.nan)

    assert reduction(wide, to_px, image.size) == (4, 4)


def test_reduction_of_a_small_input_on_a_map_of_the_world() -> None:
    """At 60° a hundredth of a degree is 557 m of longitude, and 1114 m of latitude."""
    world = Grid(Affine(0.01, 0, -180, 0, -0.01, 90), CRS.from_epsg(4326), 36000, 18000)
    centre = reproject(np.array([[15.0, 60.0]]), world.crs, CRS.from_epsg(32633))[0]
    place = Affine(100, 0, centre[0] - 50_000, 0, -100, centre[1] + 50_000)
    image = Grid(place, CRS.from_epsg(32633), 1000, 1000)
    assert reduction(world, world.to_pixels_of(image), image.size) == (6, 11)


@pytest.mark.parametrize(("shift", "shown"), [(0.0, True), (400.0, False)])
def test_a_tile_is_resampled_by_few_exact_positions(
    tmp_path: Path, shift: float, shown: bool
) -> None:
    """Tiles beside the image, of which they show nothing, are common, too."""
    asked = []

    def to_px(xy: np.ndarray) -> np.ndarray:
        asked.append(len(xy))
        return xy * 1.01 + shift

    path = write_raster(tmp_path / "input.tif", np.ones((300, 300), np.float32))
    with open_raster(path) as source:
        _, valid = sample(source, Grid(PIXEL_COORDINATES, None, 256, 256), to_px)
    assert valid.all() == valid.any() == shown
    assert sum(asked) < 256 * 256 / 50


def test_the_source_window_ignores_unknown_positions() -> None:
    px = np.mgrid[:20, :30][::-1] + 20_000.0
    known = source_window(px, (40_000, 40_000), "cubic", (2, 2))
    px[:, 3, 4] = NOWHERE
    px[:, 5, 6] = [-5000, 20_010]
    assert source_window(px, (40_000, 40_000), "cubic", (2, 2)) == known
    assert source_window(px * 0 + NOWHERE, (40_000, 40_000), "cubic")[2:] == (0, 0)


@pytest.mark.parametrize("shift", [0.0, 0.21, 0.5, 0.79])
def test_cubic_does_not_move_the_image(shift: float) -> None:
    cols, rows = np.meshgrid(np.arange(40.0), np.arange(30.0))
    parabola = 0.05 * (cols - 20) ** 2 - 0.03 * rows**2 + 2 * cols
    values, _ = shifted(parabola, shift, -shift, "cubic")
    x, y = cols + shift, rows - shift
    expected = 0.05 * (x - 20) ** 2 - 0.03 * y**2 + 2 * x
    np.testing.assert_allclose(values[3:-3, 3:-3], expected[3:-3, 3:-3], atol=1e-9)


@pytest.mark.parametrize(("dx", "dy"), [(0.0, 0.0), (13.0, -27.5), (-104.0, 66.0)])
def test_sampling_a_raster_recovers_a_known_shift(tmp_path: Path, dx: float, dy: float) -> None:
    """The input shows at x + d what the reference shows at x."""
    grid = utm_grid(120, 100)
    image = wave_image(grid.shifted(-dx, -dy), 400).astype(np.float32)
    source = open_raster(write_raster(tmp_path / "a.tif", image, grid))
    chip = grid.window(40, 30, 30, 25)
    values, valid = sample(source, chip, lambda xy: grid.map_to_pixel(xy + [dx, dy]))
    assert valid.all()
    assert np.abs(values - wave_image(chip, 400)).max() < 0.1


def test_sampling_onto_larger_pixels_averages(tmp_path: Path) -> None:
    """Noise with variance 1 has variance 1/100 in means of 100 pixels; a single pixel has 1."""
    grid = utm_grid(400, 300)
    noise = RNG.normal(0, 1, (300, 400)).astype(np.float32)
    source = open_raster(write_raster(tmp_path / "a.tif", noise, grid))
    values, valid = sample(source, grid.scaled(10), grid.map_to_pixel)
    assert valid.all()
    np.testing.assert_allclose(values, noise.reshape(30, 10, 40, 10).mean(axis=(1, 3)), atol=1e-5)
    single, _ = sample(source, grid.scaled(10), grid.map_to_pixel, "nearest")
    assert single.std() > 0.9


def test_sampling_beside_the_raster_is_empty(tmp_path: Path) -> None:
    grid = utm_grid(40, 30)
    source = open_raster(write_raster(tmp_path / "a.tif", np.ones((30, 40), np.uint8), grid))
    values, valid = sample(source, grid.window(500, 500, 7, 6), grid.map_to_pixel)
    assert values.shape == valid.shape == (6, 7)
    assert not valid.any()


@pytest.mark.parametrize("method", ["nearest", "cubic"])
@pytest.mark.parametrize(("own", "other"), [(-180.0, 0.0), (0.0, -180.0), (0.0, 0.0)])
def test_the_whole_earth_is_found_however_longitudes_are_counted(
    tmp_path: Path, own: float, other: float, method: str
) -> None:
    """In the middle of the one map the other one begins: no pixel spans the Earth there."""
    grid, onto = (
        Grid(Affine(0.5, 0, west, 0, -0.5, 90), CRS.from_epsg(4326), 720, 360)
        for west in (own, other)
    )
    image, expected = (
        (each.pixel_to_map(each.places(1))[0, 0] + 0.5 * np.arange(720) + 180) % 360
        for each in (grid, onto)
    )
    path = write_raster(tmp_path / "a.tif", np.tile(image.astype(np.float32), (360, 1)), grid)
    with open_raster(path) as source:
        values, valid = sample(source, onto, onto.to_pixels_of(grid), method)
    assert valid.all()
    np.testing.assert_array_equal(values, np.tile(expected.astype(np.float32), (360, 1)))
