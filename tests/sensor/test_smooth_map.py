from __future__ import annotations

import numpy as np
from rasterio.crs import CRS

from groundtie.rasters.grid import LON_LAT, reproject
from groundtie.sensor.smooth_map import smooth_map

UTM = CRS.from_epsg(32632)


def to_utm(lon_lat: np.ndarray) -> np.ndarray:
    return reproject(lon_lat, LON_LAT, UTM)


def test_a_projection_is_replaced_to_a_millimetre() -> None:
    low, high = np.array([8.8, 45.0]), np.array([9.2, 45.3])
    found = smooth_map(to_utm, low, high, 1e-3)
    assert found is not to_utm
    places = np.random.default_rng(5).uniform(low, high, (5000, 2))
    assert np.abs(found(places) - to_utm(places)).max() < 1e-3


def test_beyond_the_box_nothing_is_made_up() -> None:
    found = smooth_map(to_utm, np.array([8.8, 45.0]), np.array([9.2, 45.3]), 1e-3)
    assert np.isnan(found(np.array([[9.3, 45.1], [9.0, 44.9]]))).all()
    assert np.isfinite(found(np.array([[8.8, 45.0], [9.2, 45.3]]))).all()


def test_what_no_polynomial_follows_stays_exact() -> None:
    def rough(xy: np.ndarray) -> np.ndarray:
        return np.sin(40 * xy)

    assert smooth_map(rough, np.zeros(2), np.ones(2), 1e-3) is rough

    def torn(xy: np.ndarray) -> np.ndarray:
        return np.full_like(xy, np.nan)

    assert smooth_map(torn, np.zeros(2), np.ones(2), 1e-3) is torn
