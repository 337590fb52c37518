"""Errors that are put in come out again; outliers do not count."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from affine import Affine
from known_errors import DEGREES, GRID, LONLAT, PLAIN, places, shifted
from raster_files import UTM, utm_grid

from groundtie.assessment.accuracy import Assessment
from groundtie.assessment.point_errors import PointErrors
from groundtie.assessment.statistics import Statistics
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid


class TestPointErrors:
    @pytest.mark.parametrize("kind", ["translation", "similarity", "affine", "polynomial2"])
    def test_injected_errors_come_back(self, kind: str) -> None:
        xy = places()
        random = np.random.default_rng(1)
        model = fit_model(kind, xy, xy + random.normal(0, 15, xy.shape))
        transform = Transform(model, UTM, utm_grid(800, 600, 5.0))
        injected = random.normal(0, 2, xy.shape)
        found = PointErrors.of(transform, xy, transform(xy) + injected)
        np.testing.assert_allclose(found.error_px, injected, atol=1e-6)
        assert found.used.all()

    def test_metres_are_those_on_the_map(self) -> None:
        """One pixel of 10 m to the right is 10 m to the east; rows run to the south."""
        transform = shifted(37.0, -24.0)
        xy = places()
        found = PointErrors.of(transform, xy, transform(xy) + [1.0, 2.0])
        assert found.error_m is not None
        np.testing.assert_allclose(found.error_m, np.tile([10.0, -20.0], (40, 1)), atol=1e-6)

    def test_an_input_that_is_turned(self) -> None:
        """Columns of an image turned by 90° run to the south, rows to the west."""
        turned = Grid(Affine(0, -4, 500_900, -4, 0, 5_000_000), UTM, 300, 300)
        transform = shifted(0.0, 0.0, turned)
        xy = turned.pixel_to_map([[10.0, 20.0], [50.0, 70.0]])
        found = PointErrors.of(transform, xy, transform(xy) + [1.0, 0.0])
        np.testing.assert_allclose(found.error_m, [[0, -4], [0, -4]], atol=1e-6)
        found = PointErrors.of(transform, xy, transform(xy) + [0.0, 1.0])
        np.testing.assert_allclose(found.error_m, [[-4, 0], [-4, 0]], atol=1e-6)

    def test_metres_on_a_map_in_degrees(self) -> None:
        transform = shifted(0.0, 0.0, DEGREES, LONLAT)
        xy = places(grid=DEGREES)
        found = PointErrors.of(transform, xy, transform(xy) + [1.0, 0.0])
        # A ten-thousandth of a degree of longitude on the ellipsoid of WGS 84, at 45.135° north.
        latitude = math.radians(45.135)
        across_m = 6_378_137 / math.sqrt(1 - 0.00669438 * math.sin(latitude) ** 2)
        expected = across_m * math.radians(1e-4) * math.cos(latitude)
        np.testing.assert_allclose(found.in_metres.bias, [expected, 0], rtol=1e-5, atol=1e-6)

    def test_metres_in_degrees_are_those_of_each_points_latitude(self) -> None:
        latitudes = np.array([32.0, 34.0, 66.0, 68.0])
        grid = Grid(Affine(0.005, 0, 10, 0, -0.005, 70), LONLAT, 2000, 8000)
        transform, xy = shifted(0.0, 0.0, grid, LONLAT), np.column_stack([[12.0] * 4, latitudes])
        found = PointErrors.of(transform, xy, transform(xy) + [1.0, 0.0])
        # On the ellipsoid of WGS 84.
        phi = np.deg2rad(latitudes)
        across_m = 6_378_137 / np.sqrt(1 - 0.00669438 * np.sin(phi) ** 2) * np.cos(phi)
        expected = np.column_stack([np.deg2rad(0.005) * across_m, np.zeros(4)])
        np.testing.assert_allclose(found.error_m, expected, rtol=1e-5, atol=1e-6)

    @pytest.mark.parametrize("turn", [0.0, 360.0, -360.0])
    def test_metres_across_the_antimeridian(self, turn: float) -> None:
        """Points of a table may count longitudes the other way round."""
        grid = Grid(Affine(1e-3, 0, 179.95, 0, -1e-3, 0.05), LONLAT, 100, 100)
        transform, xy = shifted(0.0, 0.0, grid, LONLAT), grid.pixel_to_map([[70.0, 20.0]])
        found = PointErrors.of(transform, xy + [turn, 0], transform(xy) + [1.0, 0.0])
        assert found.error_px[0] == pytest.approx([1.0, 0.0], abs=1e-6)
        assert found.in_metres.bias == pytest.approx([111.32, 0.0], rel=1e-4, abs=1e-6)

    def test_a_stretch_shows_in_metres_where_the_registered_image_has_the_point(self) -> None:
        """The input claims all distances half as long: its pixel is worth two on the map."""
        model = PolynomialModel(
            "similarity",
            Frame(Affine.translation(502_000, 4_998_500)),
            np.array([[0, 0], [-0.5, 0], [0, -0.5]], float),
        )
        transform = Transform(model, UTM, GRID)
        xy = places()
        found = PointErrors.of(transform, xy, transform(xy) + [1.0, 0.0])
        assert found.in_metres.bias == pytest.approx((20.0, 0.0), abs=1e-6)
        assert found.in_pixels.bias == pytest.approx((1.0, 0.0), abs=1e-6)

    def test_pixels_of_an_input_without_georeferencing_have_no_metres(self) -> None:
        found = PointErrors.of(shifted(2, 3, PLAIN, None), [[5.0, 5.0]], [[7.0, 8.0]])
        assert found.error_m is None
        assert found.in_pixels.rmse == 0
        assert math.isnan(found.in_metres.rmse)

    def test_a_plain_input_on_a_map_has_metres(self) -> None:
        """As points of the Georeferencer have it: the model takes the map to pixels."""
        xy = places()
        model = fit_model("affine", xy, GRID.map_to_pixel(xy))
        transform = Transform(model, UTM, PLAIN)
        found = PointErrors.of(transform, xy, GRID.map_to_pixel(xy) + [0.0, 0.5])
        assert found.in_metres.bias == pytest.approx((0, -5), abs=1e-6)

    def test_what_the_transform_cannot_place_is_counted_apart(self) -> None:
        transform = shifted(37.0, -24.0)
        xy = places(3)
        px = transform(xy)
        xy[1] = np.inf
        found = PointErrors.of(transform, xy, px)
        assert found.placed.tolist() == [True, False, True]
        summary = found.summary()
        assert (summary["points"], summary["points_used"]) == (3, 2)
        assert summary["rmse_px"] == pytest.approx(0, abs=1e-6)

    @pytest.mark.parametrize("tolerance_px", [2.0, 3.0])
    def test_what_agrees_depends_on_the_tolerance(self, tolerance_px: float) -> None:
        transform, xy = shifted(0, 0), places()
        error = np.tile([2.5, 0.0], (len(xy), 1))
        found = PointErrors.of(transform, xy, transform(xy) + error)
        agreeing = replace(found, tolerance_px=tolerance_px).agreeing
        assert agreeing.all() == agreeing.any() == (tolerance_px > 2.5)

    def test_no_points(self) -> None:
        found = PointErrors.none().of_inliers()
        assert len(found) == found.summary()["points"] == 0
        assert math.isnan(found.in_pixels.rmse)


class TestWrongMatches:
    def errors(self, right: int, wrong: int, sigma: float = 0.4) -> PointErrors:
        """Return errors of which the last ones lie 6 to 11 px off, anywhere around."""
        random = np.random.default_rng(2)
        angle, radius = random.uniform(0, 2 * np.pi, wrong), random.uniform(6, 11, wrong)
        far = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        error = np.concatenate([random.normal(0, sigma, (right, 2)), far])
        xy = places(right + wrong)
        transform = shifted(0, 0)
        return PointErrors.of(transform, xy, transform(xy) + error)

    def test_they_do_not_count(self) -> None:
        found = self.errors(40, 12).of_inliers()
        assert found.used.tolist() == [True] * 40 + [False] * 12
        expected = Statistics.of(found.error_px[:40])
        assert found.in_pixels == expected
        assert (found.summary()["points"], found.summary()["points_used"]) == (52, 40)

    def test_right_ones_all_count(self) -> None:
        assert self.errors(60, 0).of_inliers().used.all()

    def test_how_far_right_ones_scatter_depends_on_the_error_allowed(self) -> None:
        errors = self.errors(60, 0, sigma=4.0)
        assert errors.of_inliers(10.0).used.mean() > 0.9
        errors = self.errors(60, 0, sigma=10.0)
        assert errors.of_inliers(10.0).used.mean() > 0.7
        assert errors.of_inliers(3.0).used.mean() < 0.2
        # A smaller one than usual makes no outliers.
        np.testing.assert_array_equal(errors.of_inliers(0.5).used, errors.of_inliers().used)

    @pytest.mark.parametrize("finer", [0.5, 4.0, 8.0])
    @pytest.mark.parametrize("limit", [None, 3.0])
    def test_the_size_of_the_inputs_pixels_makes_no_outlier(
        self, finer: float, limit: float | None
    ) -> None:
        """The same matches, in pixels of an input that is finer than the reference, or coarser."""
        one = self.errors(60, 15, sigma=1.5)
        scaled = replace(one, error_px=finer * one.error_px, window_px=finer * one.window_px)
        expected, found = (
            errors.of_inliers(None if limit is None else size * limit)
            for errors, size in ((one, 1.0), (scaled, finer))
        )
        np.testing.assert_array_equal(found.used, expected.used)
        assert found.used[:60].mean() > 0.9

    def test_matches_that_are_all_wrong_are_no_ground_for_a_verdict(self) -> None:
        verdict = Assessment(test_points=self.errors(0, 30).of_inliers(3.0)).judge(3.0)
        assert not verdict.accepted
        assert "of 30 test points agree" in verdict.reason
