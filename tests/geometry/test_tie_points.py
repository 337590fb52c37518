from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from affine import Affine
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.geometry.fitting import fit_model
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid, apply_affine, compose

GRID = utm_grid(100, 100)
NOMINAL = Transform.nominal(UTM, GRID)


def some_points(count: int = 5) -> TiePoints:
    rng = np.random.default_rng(0)
    px = rng.uniform(0, 99, (count, 2))
    return TiePoints(
        reference_xy=GRID.pixel_to_map(px) + [10, 0],
        input_px=px,
        score=np.arange(count, dtype=float),
        covariance_px2=np.tile(np.eye(2), (count, 1, 1)),
        forward_backward_error_px=np.zeros(count),
        is_check=np.arange(count) % 2 == 0,
        state=np.array(["used"] * count),
    )


def test_residuals_are_what_was_measured_minus_what_is_predicted() -> None:
    # The map position is 10 m east of where the input claims it, so the prediction is 1 px on.
    np.testing.assert_allclose(some_points().residual_px(NOMINAL), [[-1, 0]] * 5, atol=1e-6)


@pytest.mark.parametrize(("scale", "angle_deg"), [(0.5, 0), (2, 0), (1, 90), (0.5, 30)])
def test_residuals_on_a_grid_are_in_its_pixels(scale: float, angle_deg: float) -> None:
    """Matched 1 px too far right, wherever the input's own pixels lie and however large."""
    by = compose(Affine.rotation(angle_deg), Affine.scale(scale))
    px = some_points().input_px
    model = fit_model("affine", GRID.pixel_to_map(px), GRID.pixel_to_map(apply_affine(by, px)))
    points = replace(
        some_points(),
        reference_xy=GRID.pixel_to_map(px),
        input_px=apply_affine(by, px + [1, 0]),
    )
    found = points.residual_on(GRID, Transform(model, UTM, GRID))
    np.testing.assert_allclose(found, [[1, 0]] * 5, atol=1e-6)


def test_pixels_are_no_longitudes() -> None:
    """A scan without georeferencing may be tied to a map in degrees, far from column 0."""
    scan = Grid(PIXEL_COORDINATES, None, 2000, 1500)
    px = np.array([[10.0, 20.0], [500.0, 700.0], [1990.0, 1400.0]])
    degrees = CRS.from_epsg(4326)
    points = replace(some_points(3), reference_xy=[-100.0, 45.0] + 1e-4 * px, input_px=px)
    found = points.nominal_xy(Transform.nominal(degrees, scan))
    np.testing.assert_array_equal(found, px)


def test_rejecting_keeps_the_first_reason() -> None:
    points = some_points().reject(np.array([1, 0, 0, 1, 0], bool), "too far")
    points = points.reject(np.array([1, 1, 0, 0, 0], bool), "a much longer reason than before")
    assert points.state.tolist() == [
        "rejected: too far",
        "rejected: a much longer reason than before",
        "used",
        "rejected: too far",
        "used",
    ]
    assert points.used.tolist() == [False, False, True, False, True]


def test_taking_and_joining_rows() -> None:
    points = some_points()
    joined = TiePoints.concatenate([points.take(points.is_check), points.take(~points.is_check)])
    assert joined.score.tolist() == [0, 2, 4, 1, 3]
    assert len(joined) == 5
    assert joined.covariance_px2.shape == (5, 2, 2)
    longer = points.reject(points.is_check, "a reason")
    assert TiePoints.concatenate([points, longer]).state[5] == "rejected: a reason"


def test_no_points_at_all() -> None:
    none = some_points().take(np.zeros(5, bool))
    assert len(none) == 0
    assert none.residual_px(NOMINAL).shape == (0, 2)
    assert none.reject(np.zeros(0, bool), "reason").used.shape == (0,)
