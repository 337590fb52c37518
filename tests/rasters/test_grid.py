from __future__ import annotations

import math

import numpy as np
import pytest
import rasterio.transform
from affine import Affine
from hypothesis import given
from hypothesis import strategies as st
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.rasters.grid import (
    PIXEL_COORDINATES,
    Grid,
    apply_affine,
    compose,
    crs_name,
    epsg_of,
    reproject,
)

WGS84 = CRS.from_epsg(4326)
# GDAL names EPSG:23033 and EPSG:32633 for them: other datums.
NEAR_CODES = (
    "+proj=utm +zone=33 +ellps=intl +units=m",
    "+proj=utm +zone=33 +ellps=WGS84 +towgs84=100,200,50 +units=m",
)
coordinate = st.floats(-1e5, 1e5)


def test_pixel_centres_are_where_rasterio_puts_them() -> None:
    grid = Grid(Affine(2, 0.3, 500, 0.1, -3, 900), UTM, 40, 30)
    rows, cols = [0, 7, 29], [0, 11, 39]
    expected = np.column_stack(rasterio.transform.xy(grid.transform, rows, cols))
    np.testing.assert_allclose(grid.pixel_to_map(np.column_stack([cols, rows])), expected)


def test_images_without_georeferencing_have_pixels_for_a_map() -> None:
    grid = Grid(PIXEL_COORDINATES, None, 40, 30)
    np.testing.assert_array_equal(grid.pixel_to_map([[3, 4]]), [[3, 4]])
    assert not grid.is_georeferenced
    assert utm_grid(40, 30).is_georeferenced
    assert Grid(Affine.scale(2), None, 4, 4).is_georeferenced


@given(
    size=st.tuples(st.floats(0.1, 1000), st.floats(0.1, 1000)),
    turn=st.floats(-180, 180),
    origin=st.tuples(coordinate, coordinate),
    px=st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=5),
)
def test_pixels_to_the_map_and_back(
    size: tuple[float, float],
    turn: float,
    origin: tuple[float, float],
    px: list[tuple[float, float]],
) -> None:
    transform = compose(Affine.translation(*origin), Affine.rotation(turn), Affine.scale(*size))
    grid = Grid(transform, None, 10, 10)
    np.testing.assert_allclose(grid.map_to_pixel(grid.pixel_to_map(px)), px, atol=1e-4)
    np.testing.assert_allclose(grid.pixel_size, size)
    assert grid.pixel_size_m == pytest.approx(math.sqrt(size[0] * size[1]))


@given(col=st.integers(-50, 50), row=st.integers(-50, 50))
def test_a_window_is_the_same_lattice(col: int, row: int) -> None:
    grid = utm_grid(40, 30)
    part = grid.window(col, row, 5, 6)
    np.testing.assert_allclose(part.pixel_to_map([[1, 2]]), grid.pixel_to_map([[col + 1, row + 2]]))
    assert (part.width, part.height, part.crs) == (5, 6, UTM)


def test_scaling_keeps_the_corner() -> None:
    grid = utm_grid(41, 30).scaled(4)
    np.testing.assert_allclose(
        grid.pixel_to_map([[-0.5, -0.5]]), utm_grid(41, 30).pixel_to_map([[-0.5, -0.5]])
    )
    assert (grid.width, grid.height) == (10, 7)
    assert grid.pixel_size == (40, 40)
    assert utm_grid(3, 3).scaled(100).width == 1


def test_shifting_is_in_map_units() -> None:
    grid = utm_grid(4, 4)
    moved = grid.shifted(3, -7).pixel_to_map([[1, 1]]) - grid.pixel_to_map([[1, 1]])
    np.testing.assert_allclose(moved, [[3, -7]])


def test_no_lattice_on_pixels_without_georeferencing_has_any() -> None:
    own = Grid(PIXEL_COORDINATES, None, 40, 30)
    for grid in (own.scaled(2.0), own.window(5, 6, 7, 8), own.shifted(3.0, 0.5)):
        for further in (grid, grid.scaled(1.5), grid.window(1, 2, 3, 4), grid.shifted(-1, -1)):
            assert not further.is_georeferenced and further.metres_per_pixel is None
    local = Grid(Affine.scale(2.0, -2.0), None, 40, 30)
    assert local.is_georeferenced and local.scaled(2.0).metres_per_pixel == pytest.approx(4.0)


def test_containing() -> None:
    px = [[-0.5, -0.5], [3.5, 2.5], [-0.51, 0], [0, 2.51], [np.nan, 0], [np.inf, 0]]
    assert utm_grid(4, 3).contains(px).tolist() == [True, True, False, False, False, False]


def test_the_outline_runs_around_the_outer_border() -> None:
    outline = utm_grid(40, 30).outline(4)
    assert outline.shape == (16, 2)
    assert outline[[0, 4, 8, 12]].tolist() == [
        [-0.5, -0.5],
        [39.5, -0.5],
        [39.5, 29.5],
        [-0.5, 29.5],
    ]
    on_border = np.isin(outline[:, 0], [-0.5, 39.5]) | np.isin(outline[:, 1], [-0.5, 29.5])
    assert on_border.all()


@pytest.mark.parametrize("latitude", [0.0, 30.0, -45.0, 60.0, 89.0])
def test_degrees_have_their_length_on_the_ellipsoid(latitude: float) -> None:
    """As PROJ has them: an azimuthal equidistant map has true distances from its centre."""
    centre = np.array([9.0, latitude])
    grid = Grid(Affine(2e-4, 0, 8.999, 0, -1e-4, latitude + 5e-4), WGS84, 10, 10)
    local = CRS.from_proj4(f"+proj=aeqd +lat_0={latitude} +lon_0=9 +datum=WGS84")
    half = 5e-4 * np.eye(2)
    (x, _, before_x, _), (_, y, _, before_y) = reproject(
        np.concatenate([centre + half, centre - half]), WGS84, local
    ).T
    east, north = (x - before_x) * 1000, (y - before_y) * 1000
    assert grid.metres_per_unit == pytest.approx((east, north), rel=1e-6)
    assert grid.pixel_sides_m == pytest.approx((2e-4 * east, 1e-4 * north), rel=1e-6)
    assert grid.pixel_size_m == pytest.approx(1e-4 * math.sqrt(2 * east * north), rel=1e-6)
    assert grid.metres_per_pixel == pytest.approx(max(2e-4 * east, 1e-4 * north), rel=1e-6)


def test_feet_are_not_metres() -> None:
    grid = Grid(Affine(10, 0, 6e6, 0, -10, 2e6), CRS.from_epsg(2227), 10, 10)
    assert grid.pixel_size_m == pytest.approx(10 * 1200 / 3937)


@pytest.mark.parametrize("latitude", [-60.0, 0.0, 48.0])
@pytest.mark.parametrize("lon", [9.0, 180.0])
@pytest.mark.parametrize(
    "text", ["EPSG:3857", "EPSG:3395", "+proj=merc +lat_ts=48 +datum=WGS84 +units=us-ft"]
)
def test_metres_of_mercator_maps_are_those_on_the_ground(
    text: str, lon: float, latitude: float
) -> None:
    """By UTM, whose scale is 0.9996 at its central meridian; at 180° by that of zone 60, 3° off."""
    crs = CRS.from_user_input(text)
    zone = CRS.from_user_input(f"+proj=utm +zone={32 if lon == 9 else 60} +datum=WGS84")
    centre = reproject(np.array([[lon, latitude]]), WGS84, crs)[0]
    size = 10.0
    grid = Grid(Affine(size, 0, centre[0] - 5 * size, 0, -size, centre[1] + 5 * size), crs, 10, 10)
    across = reproject(grid.pixel_to_map([[4.5, 4.5], [5.5, 4.5], [4.5, 5.5]]), crs, zone)
    metres = np.hypot(*(across[1:] - across[0]).T) / size
    scale = (
        0.9996 if lon == 9 else 0.9996 * (1 + np.deg2rad(3 * np.cos(np.deg2rad(latitude))) ** 2 / 2)
    )
    np.testing.assert_allclose(grid.metres_per_unit, metres / scale, rtol=1e-4)


@pytest.mark.parametrize(
    ("text", "lon", "latitude"),
    [
        ("EPSG:32662", 10.0, 60.0),
        ("EPSG:4087", 10.0, 60.0),
        ("EPSG:4087", 180.0, -35.0),
        ("EPSG:6933", 10.0, 60.0),
        ("EPSG:6933", -70.0, 5.0),
        ("EPSG:3413", 20.0, 80.0),
        ("EPSG:3995", -100.0, 62.0),
        ("EPSG:3031", 0.0, -90.0),
        ("ESRI:54009", 100.0, 50.0),
        ("+proj=eqc +lat_ts=30 +datum=WGS84 +units=us-ft", 10.0, 60.0),
    ],
)
def test_metres_of_any_map_are_those_on_the_ground(text: str, lon: float, latitude: float) -> None:
    """By an azimuthal map around the place: along x, and in area."""
    crs = CRS.from_user_input(text)
    around = CRS.from_user_input(f"+proj=aeqd +lat_0={latitude} +lon_0={lon} +datum=WGS84")
    (x, y) = reproject(np.array([[lon, latitude]]), WGS84, crs)[0]
    grid = Grid(Affine(100, 0, x - 5000, 0, -100, y + 5000), crs, 100, 100)
    sides = grid.pixel_to_map([[49, 49.5], [50, 49.5], [49.5, 49], [49.5, 50]])
    left, right, above, below = reproject(sides, crs, around)
    width, area = np.hypot(*(right - left)), abs(np.linalg.det([right - left, below - above]))
    np.testing.assert_allclose(grid.pixel_sides_m, (width, area / width), rtol=1e-4)
    assert grid.pixel_size_m == pytest.approx(np.sqrt(area), rel=1e-4)


@pytest.mark.parametrize(
    ("text", "lon", "latitude"),
    [
        ("EPSG:4326", 10.0, 60.0),
        ("EPSG:32633", 17.9, 60.0),
        ("EPSG:2048", 19.5, -30.0),
        ("EPSG:5513", 15.0, 50.0),
        ("EPSG:3413", 20.0, 80.0),
        ("EPSG:3031", 170.0, -75.0),
        ("EPSG:6933", 10.0, 60.0),
    ],
)
def test_east_and_north_of_any_map(text: str, lon: float, latitude: float) -> None:
    """By an azimuthal map around the place; survey maps differ from it by their scale."""
    crs = CRS.from_user_input(text)
    around = CRS.from_user_input(f"+proj=aeqd +lat_0={latitude} +lon_0={lon} +datum=WGS84")
    centre, *ends = reproject(np.array([[0.0, 0], [100, 0], [0, 100]]), around, crs)
    grid = Grid(Affine(1e-5, 0, centre[0], 0, -1e-5, centre[1]), crs, 1, 1)
    expected = (np.array(ends) - centre) / 100
    np.testing.assert_allclose(grid.east_north, expected, atol=0.01 * np.abs(expected).max())


@pytest.mark.parametrize("text", ["EPSG:32633", "EPSG:3035"])
def test_outside_of_a_projections_domain_east_and_north_lie_along_its_axes(text: str) -> None:
    grid = Grid(Affine(1, 0, 9e9, 0, -1, 9e9), CRS.from_user_input(text), 1, 1)
    np.testing.assert_array_equal(grid.east_north, np.eye(2))


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("EPSG:32633", (5e5, 5e6)),
        ("EPSG:32633", (8.3e5, 1e5)),
        ("EPSG:3035", (4.3e6, 3.2e6)),
        ("EPSG:31467", (3.5e6, 5.5e6)),
        ("EPSG:2056", (2.6e6, 1.2e6)),
        ("EPSG:2154", (1.2e6, 6.1e6)),
        ("EPSG:5070", (0.0, 2.5e6)),
        # Sheared: areas and lengths along x are kept.
        ("+proj=sinu +R=6371007.181", (7e6, 5.5e6)),
    ],
)
def test_no_unit_of_a_projection_that_keeps_lengths_is_changed(
    text: str, place: tuple[float, float]
) -> None:
    grid = Grid(Affine(10, 0, place[0], 0, -10, place[1]), CRS.from_user_input(text), 10, 10)
    assert grid.metres_per_unit == (1.0, 1.0)


def test_units_of_a_map_that_nothing_leads_from_are_what_they_say() -> None:
    """Of another planet, or far outside of the projection's domain."""
    mars = CRS.from_user_input("+proj=eqc +R=3396190 +units=m")
    assert Grid(Affine(10, 0, 0, 0, -10, 3e6), mars, 10, 10).metres_per_unit == (1.0, 1.0)
    far = Grid(Affine(10, 0, 1e12, 0, -10, 1e12), CRS.from_epsg(3035), 10, 10)
    assert far.metres_per_unit == (1.0, 1.0)


def test_far_off_a_mercator_map_units_have_a_length() -> None:
    grid = Grid(Affine(10, 0, 0, 0, -10, 1e12), CRS.from_epsg(3857), 10, 10)
    assert min(grid.metres_per_unit) > 0


def test_grads_are_no_degrees() -> None:
    """400 grads are 360°: 60 grads of latitude are 54°."""
    place = Affine(0.001, 0, 2, 0, -0.001, 60.005)
    grads = Grid(place, CRS.from_epsg(4807), 10, 10).metres_per_unit
    degrees = Grid(Affine(9e-4, 0, 2, 0, -9e-4, 54.0045), WGS84, 10, 10).metres_per_unit
    assert grads == pytest.approx(0.9 * np.array(degrees), rel=1e-6)
    from_wkt = CRS.from_wkt(WGS84.to_wkt())
    in_degrees = (Grid(place, crs, 10, 10).metres_per_unit for crs in (WGS84, from_wkt))
    assert next(in_degrees) == next(in_degrees)


class TestAcrossTheAntimeridian:
    """A grid from 179.99° to 180.01°, of which PROJ has the east as -180° to -179.99°."""

    GRID = Grid(Affine(1e-5, 0, 179.99, 0, -1e-5, -17.0), WGS84, 2000, 400)
    UTM60 = CRS.from_epsg(32760)
    ZONE = Grid(Affine(10, 0, 818_000, 0, -10, 8_118_000), UTM60, 100, 100)

    @pytest.mark.parametrize("turn", [0.0, -360.0])
    def test_longitudes_go_on_as_the_grids_do(self, turn: float) -> None:
        grid = self.GRID.shifted(turn, 0)
        px = grid.places()
        xy = reproject(grid.pixel_to_map(px), WGS84, self.UTM60)
        np.testing.assert_allclose(self.ZONE.to_pixels_of(grid)(xy), px, atol=1e-3)

    def test_between_maps_of_other_longitudes(self) -> None:
        west = self.GRID.shifted(-360.0, 0)
        px = west.places()
        found = west.to_pixels_of(self.GRID)(west.pixel_to_map(px))
        np.testing.assert_allclose(found, px, atol=1e-4)

    def test_what_has_no_longitude_stays_infinite(self) -> None:
        xy = np.array([[np.inf, np.inf], [np.nan, np.nan], [179.995, -17.001]])
        found = self.GRID.to_own_map(xy, WGS84)
        np.testing.assert_array_equal(found, xy)

    @pytest.mark.parametrize(
        ("left", "width", "expected"),
        [
            (-180.0, 360, [-179.9, -0.1, 0.1, -0.1, -70.0]),
            (0.0, 360, [180.1, 359.9, 0.1, 359.9, 290.0]),
            (200.0, 100, [180.1, 359.9, 360.1, 359.9, 290.0]),
            (-100.0, 50, [-179.9, -0.1, 0.1, -0.1, -70.0]),
        ],
    )
    def test_longitudes_are_counted_as_a_grid_anywhere_does(
        self, left: float, width: int, expected: list[float]
    ) -> None:
        """Also of the whole Earth, from -180° or, as climate models have it, from 0°."""
        grid = Grid(Affine(1, 0, left, 0, -1, 90), WGS84, width, 180)
        xy = np.array([[-179.9, 1.0], [-0.1, 2.0], [0.1, 3.0], [359.9, 4.0], [-70.0, -30.0]])
        found = grid.to_own_map(xy, WGS84)
        np.testing.assert_allclose(found, np.column_stack([expected, xy[:, 1]]), rtol=1e-12)
        assert grid.covers(found)[4]


def test_reprojecting_there_and_back() -> None:
    lonlat = np.array([[9.0, 45.0], [9.5, 46.0]])
    xy = reproject(lonlat, WGS84, UTM)
    # The central meridian of zone 32 is at 9°.
    assert xy[0, 0] == pytest.approx(500_000)
    np.testing.assert_allclose(reproject(xy, UTM, WGS84), lonlat, atol=1e-9)
    assert reproject(lonlat, None, UTM) is lonlat
    assert reproject(lonlat, UTM, UTM) is lonlat


def test_no_points_at_all() -> None:
    nothing = np.empty((0, 2))
    assert utm_grid(4, 4).map_to_pixel(nothing).shape == (0, 2)
    assert reproject(nothing, WGS84, UTM).shape == (0, 2)
    assert apply_affine(Affine.identity(), nothing).shape == (0, 2)


def test_positions_off_the_projection_are_infinite_and_spoil_no_others() -> None:
    lonlat = np.array([[15.0, 45.0], [15.0, 95.0], [15.5, 45.5], [15.5, -120.0], [14.0, 46.0]])
    found = reproject(lonlat, WGS84, UTM)
    outside = [False, True, False, True, False]
    np.testing.assert_array_equal(np.isinf(found).all(axis=1), outside)
    good = lonlat[~np.array(outside)]
    np.testing.assert_allclose(reproject(found[~np.array(outside)], UTM, WGS84), good, atol=1e-9)


def test_of_composed_transforms_the_last_is_applied_first() -> None:
    move, turn, scale = Affine.translation(3, -7), Affine.rotation(25), Affine.scale(2, 0.5)
    points = np.array([[0.0, 0.0], [4.0, -1.0], [-2.5, 9.0]])
    expected = apply_affine(move, apply_affine(turn, apply_affine(scale, points)))
    np.testing.assert_allclose(apply_affine(compose(move, turn, scale), points), expected)
    assert compose(move) == move


@pytest.mark.parametrize("text", [*NEAR_CODES, "EPSG:32633", "EPSG:4326", "ESRI:102003"])
def test_the_name_of_a_crs_means_no_other(text: str) -> None:
    crs = CRS.from_user_input(text)
    assert CRS.from_user_input(crs_name(crs)) == crs
    if text not in NEAR_CODES:
        assert crs_name(crs) == text
    assert epsg_of(crs) == (int(text[5:]) if text.startswith("EPSG") else None)
