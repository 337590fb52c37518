from __future__ import annotations

import math

import numpy as np
import pytest
from affine import Affine
from rasterio.crs import CRS

from groundtie.arrays import Raster
from groundtie.rasters.reading import RasterSource, open_raster
from groundtie.rasters.rendered import RADAR, SUN, Light, rendered
from groundtie.rasters.windows import Window

UTM = CRS.from_epsg(32633)
PX_M = 10.0
NORTH_UP = Affine(PX_M, 0, 500_000, 0, -PX_M, 5_000_000)


def plane(
    x_rise: float, y_rise: float, transform: Affine = NORTH_UP, crs: CRS = UTM
) -> RasterSource:
    """Ground that rises by so much per metre along the axes of the map."""
    rows, cols = np.mgrid[0:20, 0:30] + 0.5
    x, y = transform.a * cols + transform.b * rows, transform.d * cols + transform.e * rows
    return open_raster(Raster((500 + x_rise * x + y_rise * y).astype(np.float32), transform, crs))


def brightness(source: RasterSource, light: Light) -> float:
    values, valid = rendered(source, light).read(Window(5, 5, 10, 8))
    assert valid.all()
    np.testing.assert_allclose(values, values[0, 0], rtol=1e-3)
    return float(values[0, 0])


@pytest.mark.parametrize("azimuth", [0.0, 90.0, 200.0])
def test_a_slope_that_faces_the_sun_is_brightest(azimuth: float) -> None:
    """Lambert: light is the cosine of the angle between the sun and the slope's normal."""
    towards = np.array([math.sin(math.radians(azimuth)), math.cos(math.radians(azimuth))])
    level = brightness(plane(0, 0), Light(SUN, azimuth))
    facing = brightness(plane(*(-towards)), Light(SUN, azimuth))  # 45°, at a right angle
    assert level == pytest.approx(1.0)
    # Of the sun's light alone, level ground has a share of cos 45°.
    assert facing - 0.3 == pytest.approx((level - 0.3) / math.cos(math.radians(45)), rel=1e-3)
    assert brightness(plane(*towards), Light(SUN, azimuth)) == pytest.approx(0.3, abs=1e-3)


def test_a_radar_gathers_more_of_slopes_that_face_it() -> None:
    """The ground range of a step in slant range, over that of level ground, as power."""
    light = Light(RADAR, 270.0)
    rise = 0.4  # to the east: the slope faces the radar in the west
    look = math.radians(45)
    slope = math.atan(rise)
    level, facing = 1 / math.sin(look), math.cos(slope) / math.sin(look - slope)
    expected = math.sqrt(facing / level)
    assert brightness(plane(rise, 0), light) == pytest.approx(expected, rel=1e-3)
    assert brightness(plane(-rise, 0), light) < 1
    assert brightness(plane(0, rise), light) == pytest.approx(1.0, abs=1e-3)


def test_ground_that_turns_away_from_the_radar_is_dark_and_what_is_laid_over_finite() -> None:
    light = Light(RADAR, 270.0)
    assert brightness(plane(-1.2, 0), light) == 0
    assert 3 < brightness(plane(1.5, 0), light) < 4


def test_the_map_need_not_lie_north_up() -> None:
    """On South African maps, west lies along x and south along y."""
    place = Affine(PX_M, 0, 0, 0, PX_M, 3_320_000)
    for rise in ((0.3, 0.0), (0.0, 0.3)):
        turned = plane(*rise, place, CRS.from_epsg(2048))
        light = Light(SUN, 150.0)
        ahead = plane(-rise[0], -rise[1])
        assert brightness(turned, light) == pytest.approx(brightness(ahead, light), rel=1e-3)


def test_pixels_need_not_lie_north_up() -> None:
    east_down = Affine(0, PX_M, 500_000, -PX_M, 0, 5_000_000)
    for rise in ((0.3, 0.0), (0.0, 0.3)):
        ways = [brightness(plane(*rise, way), Light(SUN, 150.0)) for way in (NORTH_UP, east_down)]
        assert ways[0] == pytest.approx(ways[1], rel=1e-3)


def test_degrees_are_metres_on_the_ground() -> None:
    # Lengths of a degree at 60° on the ellipsoid of WGS 84.
    turned = Affine(PX_M / 55_800.0, 0, 10, 0, -PX_M / 111_412.3, 60)
    heights = 0.4 * PX_M * np.tile(np.arange(30, dtype=np.float32), (20, 1))
    geographic = open_raster(Raster(heights, turned, CRS.from_epsg(4326)))
    projected = open_raster(Raster(heights, NORTH_UP, UTM))
    light = Light(RADAR, 270.0)
    assert brightness(geographic, light) == pytest.approx(brightness(projected, light), rel=1e-3)


@pytest.mark.parametrize("void", [np.nan, -9999.0, 32767.0])
def test_windows_are_parts_of_the_whole_and_voids_stay_voids(void: float) -> None:
    """Heights that no place on Earth has are voids, declared or not."""
    heights = np.random.default_rng(0).normal(0, 5, (40, 50)).astype(np.float32)
    heights[20, 25] = void
    image = rendered(open_raster(Raster(heights, NORTH_UP, UTM)), Light(SUN, 150.0))
    whole, known = image.read(Window(0, 0, 50, 40))
    part, part_known = image.read(Window(13, 9, 20, 21))
    np.testing.assert_array_equal(part, whole[9:30, 13:33])
    np.testing.assert_array_equal(part_known, known[9:30, 13:33])
    # Slopes at neighbours ask for the void; at the border nothing is known.
    assert not known[20, 24] and not known[19, 25] and known[20, 23]
    assert known[1:-1, 1:-1].sum() == 38 * 48 - 4 and not known[0].any()


def test_what_was_rendered_is_rendered_anew_from_its_heights() -> None:
    source = plane(0.3, 0.1)
    first = rendered(source, Light(SUN, 150.0))
    again = rendered(first, Light(RADAR, 270.0))
    np.testing.assert_array_equal(
        again.read(again.window)[0], rendered(source, Light(RADAR, 270.0)).read(source.window)[0]
    )
    assert not again.is_same_as(first)
