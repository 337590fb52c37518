"""Inconsistencies that are put in come out again, exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from affine import Affine
from hypothesis import given
from hypothesis import strategies as st
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.assessment.consistency import Leg, consistency, spread_over
from groundtie.assessment.point_errors import PointErrors
from groundtie.errors import GeoreferencingError, NoOverlapError
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import PIXEL_COORDINATES, FloatArray, Grid

# Images A, B and C of one place, with pixels of their own.
A, B, C = utm_grid(200, 160), utm_grid(400, 320, 5.0), utm_grid(100, 80, 20.0)
PLAIN = Grid(PIXEL_COORDINATES, None, 200, 160)
LONLAT = CRS.from_epsg(4326)


def shifted(dx: float, dy: float, grid: Grid, crs: CRS | None = UTM) -> Transform:
    """Return the transform of an input, on `grid`, that claims to lie off by map units."""
    model = PolynomialModel("translation", Frame(Affine.identity()), np.array([[dx, dy]]))
    return Transform(model, crs, grid)


def affine(linear: FloatArray, centre: FloatArray, shift: FloatArray, grid: Grid) -> Transform:
    """Return the transform that claims (xy - centre) · linear + centre + shift, on a UTM map."""
    xy = centre + np.random.default_rng(0).uniform(-800, 800, (30, 2))
    return Transform(fit_model("affine", xy, (xy - centre) @ linear + centre + shift), UTM, grid)


def two_way(transform: Transform, back: Transform) -> PointErrors:
    return consistency(Leg("t.json", transform), [Leg("back.json", back)])


def assert_shift(found: PointErrors, expected_px: tuple[float, float]) -> None:
    """Assert that all misses are the same, and so all statistics of their lengths."""
    px = found.in_pixels
    length = math.hypot(*expected_px)
    assert (px.rmse, px.mean, px.median, px.ce90, px.largest) == pytest.approx(
        (length,) * 5, abs=1e-6
    )
    assert px.bias == pytest.approx(expected_px, abs=1e-6)
    assert px.std == pytest.approx((0, 0), abs=1e-6)


class TestTwoWay:
    @pytest.mark.parametrize("miss_m", [(0.0, 0.0), (3.0, 4.0), (-12.5, 0.0), (0.0, 60.0)])
    def test_a_pure_shift_is_the_rmse(self, miss_m: tuple[float, float]) -> None:
        """B lies off by (35, −20) m; back, the match is off by a further shift."""
        back = shifted(-35 + miss_m[0], 20 + miss_m[1], A)
        found = two_way(shifted(35, -20, B), back)
        # The transform believes in a place that is off to the right, so the start lies left of it;
        # rows run to the south; B has pixels of 5 m.
        assert_shift(found, (-miss_m[0] / 5, miss_m[1] / 5))
        assert found.in_metres.rmse == pytest.approx(math.hypot(*miss_m), abs=1e-6)
        assert found.in_metres.bias == pytest.approx((-miss_m[0], -miss_m[1]), abs=1e-6)

    def test_the_table_of_the_thesis(self) -> None:
        """S table 6.10, spacing of 1 m: (-14.80, -52.61) and (15.01, 52.90) give RC 0.36."""
        found = two_way(shifted(-14.80, -52.61, PLAIN, None), shifted(15.01, 52.90, PLAIN, None))
        assert round(found.in_pixels.mean, 2) == 0.36
        assert found.error_m is None

    def test_an_exact_inverse_is_consistent(self) -> None:
        centre = np.array([501_000.0, 4_999_200.0])
        linear = np.array([[1.02, 0.03], [-0.04, 0.97]])
        shift = np.array([40.0, -25.0])
        inverse = np.linalg.inv(linear)
        found = two_way(
            affine(linear, centre, shift, B), affine(inverse, centre, -shift @ inverse, A)
        )
        assert found.in_pixels.largest < 1e-6
        assert len(found) > 500

    def test_a_rotation_misses_by_its_chord(self) -> None:
        """Points turn about the centre: each misses by 2 sin(angle / 2) times its distance."""
        angle = math.radians(0.5)
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        centre = B.pixel_to_map([B.centre_px])[0]
        found = two_way(shifted(0, 0, B), affine(turn, centre, np.zeros(2), A))
        distance = np.hypot(*(found.position_px - B.centre_px).T)
        chord = 2 * math.sin(angle / 2) * distance
        np.testing.assert_allclose(np.hypot(*found.error_px.T), chord, atol=1e-6)
        assert found.in_pixels.rmse == pytest.approx(np.sqrt((chord**2).mean()))
        # The reference, as turned, does not reach into all corners of the input.
        assert found.in_pixels.bias == pytest.approx((0, 0), abs=0.02)

    def test_images_in_several_crs(self) -> None:
        """Both believe the georeferencing; only the projections differ."""
        lonlat = Grid(Affine(1e-4, 0, 9.002, 0, -1e-4, 45.15), LONLAT, 150, 120)
        found = two_way(
            Transform.nominal(UTM, lonlat), Transform.nominal(LONLAT, utm_grid(200, 200))
        )
        assert found.in_pixels.largest < 1e-3
        moved = two_way(
            Transform.nominal(UTM, lonlat), shifted(2e-4, 0, utm_grid(200, 200), LONLAT)
        )
        assert_near_shift(moved, (-2.0, 0.0))

    def test_only_the_overlap_counts(self) -> None:
        """The reference covers the left part of the input: 96 pixels twice as large."""
        half = A.window(0, 0, 96, 160)
        found = two_way(shifted(0, 0, B), shifted(0, 0, half))
        whole = two_way(shifted(0, 0, B), shifted(0, 0, A))
        assert len(found) == (spread_over(B)[:, 0] < 191.5).sum()
        assert len(whole) == len(spread_over(B))

    def test_a_flexible_way_back_is_followed_everywhere(self) -> None:
        """A bulge of 15 m in a thin-plate spline shows at its place, and only there."""
        xy = A.pixel_to_map(A.places())
        centre = A.pixel_to_map([[60.0, 60.0]])[0]
        bulge = 15 * np.exp(-((xy - centre) ** 2).sum(axis=1) / 300**2)
        nominal = xy + np.column_stack([bulge, 0 * bulge])
        back = Transform(fit_model("tps", xy, nominal), UTM, A)
        found = two_way(shifted(0, 0, A), back)
        on_map = A.pixel_to_map(found.position_px)
        distance = np.hypot(*(on_map - centre).T)
        expected = back.model(on_map)[:, 0] - on_map[:, 0]
        np.testing.assert_allclose(found.error_px[:, 0], -expected / 10, atol=1e-6)
        assert found.error_px[distance < 100, 0].max() < -1
        assert np.abs(found.error_px[distance > 900]).max() < 0.2

    def test_places_that_do_not_meet(self) -> None:
        far = A.window(5000, 0, 100, 100)
        with pytest.raises(NoOverlapError, match=r"all of these reach: t\.json, back\.json"):
            two_way(shifted(0, 0, B), shifted(0, 0, far))

    @pytest.mark.parametrize("own_crs", [UTM, None])
    def test_maps_that_are_not_the_same(self, own_crs: CRS | None) -> None:
        other = None if own_crs is not None else UTM
        forward = shifted(0, 0, B if own_crs is not None else PLAIN, own_crs)
        with pytest.raises(GeoreferencingError, match=r"back\.json does not continue t\.json"):
            two_way(forward, shifted(0, 0, A if other is not None else PLAIN, other))

    def test_a_way_that_ends_on_another_map(self) -> None:
        with pytest.raises(GeoreferencingError, match=r"t\.json does not continue back\.json"):
            two_way(shifted(0, 0, B), shifted(0, 0, Grid(A.transform, None, 200, 160)))


class TestThreeWay:
    # In metres: how far B, as seen from A, and so on, claims to lie off its place.
    a_to_b, b_to_c = np.array([-125.0, -27.0]), np.array([38.0, -23.0])

    def found(self, last: Leg) -> PointErrors:
        start = Leg("t.json", shifted(*self.a_to_b, B))
        return consistency(start, [Leg("onward.json", shifted(*self.b_to_c, C)), last])

    def test_the_formula_of_the_thesis(self) -> None:
        """S eq 5.2: RC = X_SIFT − X_pre + X_post, along each axis, and its length.

        B is the image before, C the one after; both are registered to A, and C to B.
        """
        a_to_c = np.array([-88.0, -49.0])
        # From A to C by B, minus directly
        rc = self.b_to_c - (a_to_c - self.a_to_b)
        found = self.found(Leg("direct.json", shifted(*a_to_c, C), reverse=True))
        assert found.in_metres.rmse == pytest.approx(math.hypot(*rc), abs=1e-6)
        assert_shift(found, (-rc[0] / 5, rc[1] / 5))

    def test_transforms_that_close_are_consistent(self) -> None:
        closing = Leg("closing.json", shifted(*-(self.a_to_b + self.b_to_c), A))
        assert self.found(closing).in_pixels.largest < 1e-6

    @pytest.mark.parametrize("miss_m", [(7.0, -2.0), (0.0, 11.0)])
    def test_a_shift_in_the_closing_is_the_rmse(self, miss_m: tuple[float, float]) -> None:
        off = -(self.a_to_b + self.b_to_c) + miss_m
        found = self.found(Leg("closing.json", shifted(*off, A)))
        assert_shift(found, (-miss_m[0] / 5, miss_m[1] / 5))

    def test_the_direct_transform_is_the_closing_one_inverted(self) -> None:
        miss = np.array([6.0, -9.0])
        off = self.a_to_b + self.b_to_c + miss
        direct = self.found(Leg("direct.json", shifted(*off, C), reverse=True))
        closing = self.found(Leg("closing.json", shifted(*-off, A)))
        assert direct.in_pixels.rmse == pytest.approx(closing.in_pixels.rmse, abs=1e-6)
        assert direct.in_pixels.bias == pytest.approx(closing.in_pixels.bias, abs=1e-6)

    def test_all_three_images_must_meet(self) -> None:
        """C covers the upper half only; the input's pixels that it shows are counted."""
        part = C.window(0, 0, 100, 40)
        onward = Leg("onward.json", shifted(0, 0, part))
        way = [onward, Leg("closing.json", shifted(0, 0, A))]
        found = consistency(Leg("t.json", shifted(0, 0, B)), way)
        assert len(found) == (spread_over(B)[:, 1] < 159.5).sum()
        onward = Leg("onward.json", shifted(0, 0, C.window(900, 0, 10, 10)))
        with pytest.raises(NoOverlapError, match=r"t\.json, onward\.json, closing\.json"):
            consistency(Leg("t.json", shifted(0, 0, B)), [onward, way[1]])

    def test_plain_images(self) -> None:
        """Without georeferencing the images' maps are their pixels."""
        steps = [shifted(*shift, PLAIN, None) for shift in ((5, 2), (-3, 4), (-1, -6))]
        way = [Leg("onward", steps[1]), Leg("closing", steps[2])]
        found = consistency(Leg("t", steps[0]), way)
        # Around the triangle, a shift of (5 − 3 − 1, 2 + 4 − 6) is left.
        assert_shift(found, (-1.0, 0.0))


def assert_near_shift(found: PointErrors, expected_px: tuple[float, float]) -> None:
    np.testing.assert_allclose(found.error_px, np.tile(expected_px, (len(found), 1)), atol=1e-3)


class TestLattice:
    @pytest.mark.slow
    @given(st.integers(1, 4000), st.integers(1, 4000))
    def test_it_covers_the_grid_evenly(self, width: int, height: int) -> None:
        px = spread_over(Grid(PIXEL_COORDINATES, None, width, height))
        for axis, side in zip(px.T, (width, height), strict=True):
            places = np.unique(axis)
            # From half a step within one border to half a step within the other
            np.testing.assert_allclose(places[0] + 0.5, side - 0.5 - places[-1], atol=1e-6)
            if len(places) > 1:
                np.testing.assert_allclose(np.diff(places), side / len(places), atol=1e-6)
        assert len(px) <= 33**2
        assert len(np.unique(px, axis=0)) == len(px)

    def test_small_grids_have_a_place_a_pixel(self) -> None:
        px = spread_over(Grid(PIXEL_COORDINATES, None, 3, 2))
        assert px.tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]


def test_a_way_back_may_count_longitudes_the_other_way() -> None:
    """Both images lie across the antimeridian, one of them counted from the east."""
    west, east = (
        Grid(Affine(1e-3, 0, start, 0, -1e-3, 0.05), LONLAT, 100, 100)
        for start in (179.95, -180.05)
    )
    way = [Leg("back.json", shifted(0.0, 0.0, east, LONLAT), reverse=True)]
    found = consistency(Leg("t.json", shifted(0.0, 0.0, west, LONLAT)), way)
    assert found.in_pixels.largest < 1e-6
