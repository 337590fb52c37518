"""Errors of RPCs in metres."""

from __future__ import annotations

import numpy as np
from rasterio.crs import CRS
from rpc_models import camera_rpc

from groundtie.assessment.sensor_accuracy import SensorErrors
from groundtie.geometry.tie_points import TiePoints
from groundtie.rasters.grid import LON_LAT, reproject
from groundtie.sensor.control_points import ControlPoints

UTM = CRS.from_epsg(32632)


def test_errors_in_degrees_are_as_long_as_on_another_map() -> None:
    """In a strip of 150 km from south to north, where degrees of longitude shrink by 4 %."""
    rpc = camera_rpc(size=(300, 1500), centre=(9.0, 60.0), pixel_m=100.0)
    height = np.zeros(5)
    px = np.column_stack([np.full(5, 150.0), np.linspace(50, 1450, 5)])
    lon_lat = rpc.localise(px + [12.0, -5.0], height)

    def lengths_m(crs: CRS) -> np.ndarray:
        points = TiePoints(
            reproject(lon_lat, LON_LAT, crs), px, np.ones(5), np.tile(np.eye(2), (5, 1, 1)),
            np.zeros(5), np.ones(5, bool), np.full(5, "used"),
        )  # fmt: skip
        return np.hypot(*SensorErrors.of(rpc, ControlPoints.of(points, height, crs)).error_m.T)

    # Along the central meridian of the zone, where the unit is 0.9996 m.
    np.testing.assert_allclose(lengths_m(LON_LAT), lengths_m(UTM) / 0.9996, rtol=1e-3)
