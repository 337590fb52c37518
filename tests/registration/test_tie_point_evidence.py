from __future__ import annotations

import math

import pytest
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.registration.tie_point_evidence import TiePointEvidence

GRID = utm_grid(400, 300)
FEET = CRS.from_user_input("+proj=utm +zone=32 +datum=WGS84 +units=us-ft")


@pytest.mark.parametrize("crs", [UTM, CRS.from_epsg(4326), CRS.from_epsg(3857), FEET, None])
@pytest.mark.parametrize(
    ("kind", "unknowns"), [("translation", 1), ("similarity", 2), ("affine", 3)]
)
def test_the_border_moves_as_the_model_has_it_on_any_map(
    crs: CRS | None, kind: str, unknowns: int
) -> None:
    """Each of n points at the raster's corners has the number of unknowns over n as leverage."""
    corners = GRID.outline(1)
    reference_xy = Transform.nominal(crs, GRID).nominal_xy(corners)
    points = TiePoints.unmeasured(reference_xy, corners, crs, ["used"] * 4)
    found = TiePointEvidence.of(points, kind, GRID)
    assert found.border_spread_px == pytest.approx(math.sqrt(unknowns / 4), abs=1e-6)
