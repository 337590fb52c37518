from __future__ import annotations

import math

import pytest
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.errors import ParameterError
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
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


@pytest.mark.parametrize(("kind", "is_known"), [("similarity", False), ("affine", True)])
def test_the_rows_of_a_scan_run_downwards(kind: str, is_known: bool) -> None:
    """A map's y runs upwards: no rotation and scale takes one to the other."""
    scan = Grid(PIXEL_COORDINATES, None, 400, 300)
    corners = scan.outline(1)
    points = TiePoints.unmeasured(GRID.pixel_to_map(corners), corners, UTM, ["used"] * 4)
    if is_known:
        found = TiePointEvidence.of(points, kind, scan)
        assert found.fit().rmse_px < 1e-6
        return
    with pytest.raises(ParameterError, match="without georeferencing to a map"):
        TiePointEvidence.of(points, kind, scan)
    # Pixels of a reference run downwards, too.
    plain = TiePoints.unmeasured(corners + 10, corners, None, ["used"] * 4)
    assert TiePointEvidence.of(plain, kind, scan).fit().rmse_px < 1e-6
