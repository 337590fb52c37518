"""Shapes of other maps, and across the antimeridian, against areas that theory gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from affine import Affine
from raster_files import utm_grid
from rasterio.crs import CRS
from shapely.geometry import MultiPolygon, Polygon, box, mapping

from groundtie.errors import VectorLayerError
from groundtie.geometry.map_shapes import MapShapes
from groundtie.geometry.vector_layers import VectorLayer
from groundtie.masks.layer import drawn_onto
from groundtie.rasters.grid import Grid, reproject

DEGREES = CRS.from_epsg(4326)
# 5 km, from 9° east.
SCENE = utm_grid(500, 500)


def covered(geometry: Any, crs: CRS, grid: Grid) -> float:
    """Return the share of a grid that a polygon of a layer covers."""
    feature = {"geometry": geometry, "properties": {}}
    found = VectorLayer("layer", crs, (), (feature,)).on_map(grid).features
    return float(drawn_onto(grid, [(one["geometry"], 1) for one in found], np.uint8).mean())


@pytest.mark.parametrize(
    "bounds", [(-180, -90, 180, 90), (-170, -85, 170, 85), (0, -90, 360, 90), (8, 44, 10, 46)]
)
def test_a_polygon_of_all_the_earth_covers_every_scene(bounds: tuple[int, ...]) -> None:
    """Its corners alone have no place on the map of a UTM zone, or a wrong one."""
    assert covered(mapping(box(*bounds)), DEGREES, SCENE) == 1.0


@pytest.mark.parametrize("width_deg", [0.2, 1.0, 10.0, 60.0])
def test_a_long_edge_follows_its_parallel(width_deg: float) -> None:
    """On a UTM map a parallel is a curve; half of the scene lies south of this one."""
    centre = reproject(SCENE.pixel_to_map([SCENE.centre_px]), SCENE.crs, DEGREES)[0]
    west, east = centre[0] - width_deg / 2, centre[0] + width_deg / 2
    area = mapping(box(west, centre[1] - 5, east, centre[1]))
    assert covered(area, DEGREES, SCENE) == pytest.approx(0.5, abs=0.002)


def test_a_straight_edge_on_one_map_stays_straight() -> None:
    area = mapping(box(SCENE.transform.c - 1e6, 0, SCENE.transform.c + 2500, 1e7))
    assert covered(area, SCENE.crs, SCENE) == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("west", [179.0, -181.0])
@pytest.mark.parametrize(
    ("epsg", "is_cut"), [(4326, False), (4326, True), (32760, False), (3832, False)]
)
def test_a_polygon_across_the_antimeridian(west: float, epsg: int, is_cut: bool) -> None:
    """GeoJSON wants it cut there (RFC 7946, 3.1.9); it covers a quarter of the scene."""
    grid = Grid(Affine(0.01, 0, west, 0, -0.01, -16.0), DEGREES, 200, 200)
    area: Any = MultiPolygon([box(179.5, -17.5, 180, -16.5), box(-180, -17.5, -179.5, -16.5)])
    if not is_cut:
        edge = box(179.5, -17.5, 180.5, -16.5).exterior
        ring = np.array(
            [edge.interpolate(at, normalized=True).coords[0] for at in np.linspace(0, 1, 201)]
        )
        area = Polygon(reproject(ring, DEGREES, CRS.from_epsg(epsg)))
    assert covered(mapping(area), CRS.from_epsg(epsg), grid) == pytest.approx(0.25, abs=0.002)


def test_what_lies_elsewhere_covers_nothing() -> None:
    assert covered(mapping(box(100, 20, 110, 30)), DEGREES, SCENE) == 0.0


def test_a_polygon_that_crosses_itself_covers_what_it_covers() -> None:
    """A triangle whose tip is the scene's middle; beyond its surroundings it crosses itself."""
    shapes = MapShapes.around(SCENE, DEGREES)
    assert shapes is not None
    left, lower, right, upper = shapes.box
    ring = np.array([(0.2, 1.0), (0.8, 1.0), (0.8, 3.0), (0.5, 0.5), (0.2, 3.0)])
    area = Polygon(ring * [right - left, upper - lower] + [left, lower])
    assert not area.is_valid
    # Sides of 0.3 in 2.5, up to a sixth: of the scene, whose side is a third.
    tip = 0.5 * (2 / 6 * 0.3 / 2.5) / 6 * 9
    assert covered(mapping(area), DEGREES, SCENE) == pytest.approx(tip, abs=0.01)


def test_what_has_no_place_on_the_images_map_is_one_line() -> None:
    """Beyond the pole, within the scene's surroundings."""
    grid = Grid(Affine(1000, 0, 400_000, 0, -1000, 9_995_000), CRS.from_epsg(32632), 200, 200)
    with pytest.raises(VectorLayerError, match="cannot use a geometry of layer"):
        covered(mapping(box(0, 80, 20, 95)), DEGREES, grid)
