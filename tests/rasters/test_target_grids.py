from __future__ import annotations

import numpy as np
import pytest
from affine import Affine
from hypothesis import given
from hypothesis import strategies as st
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.errors import GridSizeError, NoOverlapError
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, apply_affine, compose, reproject
from groundtie.rasters.target_grids import covering_grid, registered_grid

GRID = utm_grid(40, 30)
WGS84 = CRS.from_epsg(4326)


@given(
    low=st.tuples(st.floats(-500, 500), st.floats(-500, 500)),
    size=st.tuples(st.floats(1, 300), st.floats(1, 300)),
)
def test_a_covering_grid_is_the_smallest_of_the_lattice(
    low: tuple[float, float], size: tuple[float, float]
) -> None:
    px = np.array([low, np.add(low, size)])
    found = covering_grid(GRID, GRID.pixel_to_map(px))
    offset = GRID.map_to_pixel(found.pixel_to_map([[0, 0]]))
    np.testing.assert_allclose(offset, np.rint(offset), atol=1e-6)
    assert found.pixel_size == GRID.pixel_size
    low_px, high_px = found.map_to_pixel(GRID.pixel_to_map(px)) + 0.5
    # Up to the tolerance it reaches over every side by less than a pixel.
    assert (low_px > -0.01).all()
    assert (low_px < 1.01).all()
    assert (high_px < np.array([found.width, found.height]) + 0.01).all()
    assert (high_px > np.array([found.width, found.height]) - 1.01).all()


def test_the_own_outline_gives_the_same_grid() -> None:
    turned = Grid(compose(Affine.rotation(30), Affine.scale(3)), None, 17, 9)
    for grid in (GRID, turned):
        assert covering_grid(grid, grid.pixel_to_map(grid.outline())).window(0, 0, 1, 1) == (
            grid.window(0, 0, 1, 1)
        )
        found = registered_grid(grid, grid.pixel_to_map, grid.crs)
        assert (found.width, found.height) == (grid.width, grid.height)


def test_cutting_to_the_lattice() -> None:
    xy = GRID.pixel_to_map([[-20, 5], [10, 100]])
    part = covering_grid(GRID, xy, within=True)
    assert part == GRID.window(0, 5, 11, 25)
    with pytest.raises(NoOverlapError):
        covering_grid(GRID, xy + 10_000, within=True)


@pytest.mark.parametrize(
    ("west", "beside"), [(-60.0, True), (300.0, False), (-160.0, True), (200.0, False)]
)
def test_a_footprint_in_other_longitudes_is_named_as_such(west: float, beside: bool) -> None:
    """The footprint counts from 0 to 360, as climate models do; the grid is 50° wide."""
    grid = Grid(Affine(0.5, 0, west, 0, -0.5, 40), WGS84, 100, 100)
    footprint = np.array([[0.0, 75.0], [360.0, 75.0], [360.0, -75.0], [0.0, -75.0]])
    if not beside:
        assert covering_grid(grid, footprint, within=True) == grid
        return
    with pytest.raises(NoOverlapError, match=r"a full turn of longitude beside it.* by 360"):
        covering_grid(grid, footprint, within=True)
    # In other latitudes it is elsewhere, however longitudes are counted.
    with pytest.raises(NoOverlapError, match=r"does not lie on the grid$"):
        covering_grid(grid, footprint * [1, 0.1] + [0, 60], within=True)


def test_positions_that_are_not_finite_do_not_count() -> None:
    xy = np.vstack([GRID.pixel_to_map(GRID.outline()), [[np.inf, np.nan]]])
    assert covering_grid(GRID, xy) == GRID
    with pytest.raises(NoOverlapError, match="projection"):
        covering_grid(GRID, np.full((3, 2), np.inf))


def test_a_registered_grid_lines_up_with_the_input() -> None:
    found = registered_grid(GRID, lambda px: GRID.pixel_to_map(px) + [23, 0], UTM)
    assert found == GRID.window(2, 0, 41, 30)


def test_another_pixel_size_gives_borders_at_its_multiples() -> None:
    place = compose(Affine.translation(500_003, 5e6), Affine.rotation(20), Affine.scale(10, -10))
    turned = Grid(place, UTM, 40, 30)
    found = registered_grid(turned, turned.pixel_to_map, UTM, 25.0)
    assert found.pixel_size == (25, 25)
    assert found.transform.c % 25 == 0
    assert found.transform.f % 25 == 0
    assert (found.transform.a, found.transform.e) == (25, -25)
    assert found.contains(found.map_to_pixel(turned.pixel_to_map(turned.outline()))).all()


@pytest.mark.parametrize("grid", [GRID, Grid(PIXEL_COORDINATES, None, 40, 30)])
def test_pixels_larger_than_the_whole_raster_are_refused(grid: Grid) -> None:
    longest = 40 * grid.pixel_size_m
    assert registered_grid(grid, grid.pixel_to_map, grid.crs, longest).width <= 2
    for size in (1.01 * longest, 1e308):
        with pytest.raises(GridSizeError, match="larger than the whole raster"):
            registered_grid(grid, grid.pixel_to_map, grid.crs, size)


def test_another_crs_keeps_the_size_of_the_pixels() -> None:
    to_degrees = lambda px: reproject(GRID.pixel_to_map(px), UTM, WGS84)  # noqa: E731
    found = registered_grid(GRID, to_degrees, WGS84)
    assert found.crs == WGS84
    # 10 m, but for the sphere and the scale of UTM
    assert found.pixel_size_m == pytest.approx(10, rel=0.005)
    width, height = np.array(found.pixel_size) * found.metres_per_unit
    assert width == pytest.approx(height, rel=1e-3)
    assert found.contains(found.map_to_pixel(to_degrees(GRID.outline()))).all()


def test_pixel_coordinates_stay_pixel_coordinates() -> None:
    plain = Grid(PIXEL_COORDINATES, None, 40, 30)
    assert registered_grid(plain, plain.pixel_to_map, None, 1.0) == plain
    found = registered_grid(plain, plain.pixel_to_map, None, 2.0)
    assert (found.width, found.height) == (20, 15)
    np.testing.assert_allclose(found.pixel_to_map([[0, 0]]), [[0.5, 0.5]])


def test_a_footprint_outside_of_the_projection() -> None:
    with pytest.raises(NoOverlapError, match="projection"):
        registered_grid(GRID, lambda px: px * np.inf, WGS84)


@pytest.mark.parametrize(("scale", "fits"), [(15.0, True), (17.0, False), (1e9, False)])
def test_a_transform_that_stretches_a_raster_out_of_all_proportion(
    scale: float, fits: bool
) -> None:
    def stretch(px: np.ndarray) -> np.ndarray:
        return GRID.pixel_to_map(px * scale)

    if fits:
        found = registered_grid(GRID, stretch, UTM)
        assert found.width == pytest.approx(40 * scale, abs=2)
        return
    with pytest.raises(GridSizeError, match=r"stretches the raster|more pixels a side"):
        registered_grid(GRID, stretch, UTM)


def test_a_strip_may_be_rotated() -> None:
    """Its box has many times its pixels then, but its diagonal stays."""
    strip = utm_grid(4000, 20)

    def rotate(px: np.ndarray) -> np.ndarray:
        return apply_affine(Affine.rotation(45), strip.pixel_to_map(px))

    assert registered_grid(strip, rotate, UTM).height > 2800


def test_pixels_that_have_no_size_on_the_map() -> None:
    def one_place(px: np.ndarray) -> np.ndarray:
        return np.full((len(px), 2), 7.0)

    with pytest.raises(GridSizeError, match="no size on the map"):
        registered_grid(GRID, one_place, WGS84)
    with pytest.raises(GridSizeError, match="more pixels a side"):
        covering_grid(GRID, np.array([[0.0, 0.0], [1e30, 1e30]]))
