"""Errors that are put in come out again, as numbers that theory gives."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from raster_files import UTM, utm_grid
from rasterio.crs import CRS

from groundtie.assessment.accuracy import (
    Assessment,
    PointErrors,
    Statistics,
    measure_check_points,
    measure_tie_points,
)
from groundtie.errors import GeoreferencingError, TooFewPointsError, TransformFileError
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.tie_point_files import write_tie_points
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid

GRID = utm_grid(400, 300)
PLAIN = Grid(PIXEL_COORDINATES, None, 400, 300)
LONLAT = CRS.from_epsg(4326)
DEGREES = Grid(Affine(1e-4, 0, 9.0, 0, -1e-4, 45.15), LONLAT, 400, 300)


def shifted(dx: float, dy: float, grid: Grid = GRID, crs: CRS | None = UTM) -> Transform:
    """Return the transform of an input that claims to lie off by map units."""
    model = PolynomialModel("translation", Frame(Affine.identity()), np.array([[dx, dy]]))
    return Transform(model, crs, grid)


def places(count: int = 40, grid: Grid = GRID) -> np.ndarray:
    size = [grid.width - 1, grid.height - 1]
    return grid.pixel_to_map(np.random.default_rng(0).uniform([0, 0], size, (count, 2)))


def normal_errors(count: int, sigma: float) -> np.ndarray:
    """Return errors whose lengths are the quantiles of a circular normal distribution."""
    share = (np.arange(count) + 0.5) / count
    radius = sigma * np.sqrt(-2 * np.log(1 - share))
    angle = np.arange(count) * math.pi * (3 - math.sqrt(5))
    return radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


class TestStatistics:
    @pytest.mark.parametrize("sigma", [0.3, 2.5])
    def test_normal_errors_have_the_numbers_of_theory(self, sigma: float) -> None:
        """Rayleigh distribution; FGDC-STD-007.3: CE90 is 2.1460 standard deviations."""
        found = Statistics.of(normal_errors(1005, sigma))
        assert found.ce90 == pytest.approx(2.1460 * sigma, rel=1e-4)
        assert found.median == pytest.approx(sigma * math.sqrt(2 * math.log(2)), rel=1e-9)
        assert found.rmse == pytest.approx(sigma * math.sqrt(2), rel=1e-3)
        assert found.mean == pytest.approx(sigma * math.sqrt(math.pi / 2), rel=1e-3)
        np.testing.assert_allclose(found.std, sigma, rtol=0.01)
        np.testing.assert_allclose(found.bias, 0, atol=0.01 * sigma)

    def test_drawn_errors_scatter_around_theory(self) -> None:
        count, sigma = 20_000, np.array([0.5, 2.0])
        errors = np.random.default_rng(0).normal([0.7, -1.1], sigma, (count, 2))
        found = Statistics.of(errors)
        # Four standard errors of a mean, and of a standard deviation
        assert np.all(np.abs(found.bias - np.array([0.7, -1.1])) < 4 * sigma / math.sqrt(count))
        assert np.all(np.abs(found.std - sigma) < 4 * sigma / math.sqrt(2 * count))

    def test_a_few_errors_by_hand(self) -> None:
        found = Statistics.of(np.array([[3.0, 4.0], [0.0, 1.0], [0.0, -2.0], [-1.0, 0.0]]))
        assert found.rmse == pytest.approx(math.sqrt((25 + 1 + 4 + 1) / 4))
        assert found.mean == pytest.approx((5 + 1 + 2 + 1) / 4)
        assert found.median == pytest.approx(1.5)
        assert found.largest == 5
        assert found.ce90 == 5
        assert found.bias == pytest.approx((0.5, 0.75))
        assert found.std == pytest.approx((1.5, math.sqrt((17 + 4) / 4 - 0.75**2)))

    def test_a_pure_shift_is_all_bias(self) -> None:
        found = Statistics.of(np.tile([3.0, -4.0], (7, 1)))
        lengths = (found.rmse, found.mean, found.median, found.ce90, found.largest)
        assert lengths == pytest.approx((5,) * 5)
        assert (found.bias, found.std) == ((3, -4), (0, 0))

    @pytest.mark.slow
    @given(
        hnp.arrays(float, st.tuples(st.integers(1, 30), st.just(2)), elements=st.floats(-1e3, 1e3))
    )
    def test_relations_that_always_hold(self, errors: np.ndarray) -> None:
        found = Statistics.of(errors)
        total = sum(value**2 for value in (*found.bias, *found.std))
        assert found.rmse**2 == pytest.approx(total, abs=1e-6)
        tiny = 1e-9
        assert found.mean <= found.rmse + tiny
        assert found.median <= found.ce90 + tiny <= found.largest + 2 * tiny

    def test_nothing_measured_is_not_a_number(self) -> None:
        values = Statistics.of(np.zeros((0, 2))).summary("px", ("col", "row"))
        assert list(values) == [
            "rmse_px",
            "mean_px",
            "median_px",
            "ce90_px",
            "max_px",
            "bias_col_px",
            "bias_row_px",
            "std_col_px",
            "std_row_px",
        ]
        assert all(math.isnan(value) for value in values.values())


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
        # A ten-thousandth of a degree of longitude on the sphere, at 45.1° north
        expected = 6_371_000 * math.radians(1e-4) * math.cos(math.radians(45.135))
        np.testing.assert_allclose(found.in_metres.bias, [expected, 0], rtol=1e-3, atol=1e-6)

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

    def test_no_points(self) -> None:
        found = PointErrors.none().of_right_matches()
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
        found = self.errors(40, 12).of_right_matches()
        assert found.used.tolist() == [True] * 40 + [False] * 12
        expected = Statistics.of(found.error_px[:40])
        assert found.in_pixels == expected
        assert (found.summary()["points"], found.summary()["points_used"]) == (52, 40)

    def test_right_ones_all_count(self) -> None:
        assert self.errors(60, 0).of_right_matches().used.all()

    def test_how_far_right_ones_scatter_depends_on_the_error_allowed(self) -> None:
        errors = self.errors(60, 0, sigma=4.0)
        assert errors.of_right_matches(10.0).used.mean() > 0.9
        assert errors.of_right_matches(0.5).used.mean() < 0.2

    def test_matches_that_are_all_wrong_are_no_ground_for_a_verdict(self) -> None:
        verdict = Assessment(test_points=self.errors(0, 30).of_right_matches(3.0)).judge(3.0)
        assert not verdict.accepted
        assert "of 30 test points agree" in verdict.reason


class TestVerdict:
    def errors(self, error: Any, count: int = 20) -> PointErrors:
        xy = places(count)
        transform = shifted(37.0, -24.0)
        return PointErrors.of(transform, xy, transform(xy) + np.asarray(error, float))

    def test_small_errors_are_accepted(self) -> None:
        errors = self.errors(normal_errors(25, 0.5), 25)
        verdict = Assessment(check_points=errors, control_points=self.errors([0, 0], 9)).judge(2.0)
        assert verdict.accepted
        assert verdict.reason == "check points confirm the registration"
        assert (verdict.check_points, verdict.check_points_agreeing) == (25, 25)
        assert (verdict.fit_points, verdict.fit_points_used) == (9, 9)
        assert verdict.check_rmse_px == pytest.approx(errors.in_pixels.rmse)
        assert verdict.check_rmse_m == pytest.approx(10 * verdict.check_rmse_px, rel=1e-6)
        assert verdict.check_ce90_px == pytest.approx(2.146 * 0.5, rel=1e-3)
        assert verdict.summary()["chance"] is None

    @pytest.mark.parametrize(("length", "accepted"), [(2.999, True), (3.001, False)])
    def test_the_limit(self, length: float, accepted: bool) -> None:
        verdict = Assessment(check_points=self.errors([length, 0])).judge(3.0)
        assert verdict.accepted == accepted
        if not accepted:
            assert verdict.reason == "error at check points is 3.00 px, above 3 px"

    def test_check_points_go_before_test_points(self) -> None:
        good, bad = self.errors([0.1, 0]), self.errors([9.0, 0])
        assert Assessment(check_points=good, test_points=bad).judge(3.0).accepted
        verdict = Assessment(check_points=bad, test_points=good).judge(3.0)
        assert "error at check points is 9.00 px" in verdict.reason
        verdict = Assessment(test_points=good).judge(3.0)
        assert verdict.reason == "test points confirm the registration"

    def test_control_points_do_not_matter(self) -> None:
        good, bad = self.errors([0.1, 0]), self.errors([50.0, 0])
        assert Assessment(check_points=good, control_points=bad).judge(3.0).accepted

    @pytest.mark.parametrize(
        ("name", "label"), [("two_way", "two-way"), ("three_way", "three-way")]
    )
    def test_inconsistency_refuses(self, name: str, label: str) -> None:
        good, bad = self.errors([0.1, 0]), self.errors([0.0, 3.5])
        assert Assessment(check_points=good, **{name: good}).judge(3.0).accepted
        verdict = Assessment(check_points=good, **{name: bad}).judge(3.0)
        assert not verdict.accepted
        assert verdict.reason == f"{name.replace('_', '-')} inconsistency is 3.50 px, above 3 px"

    def test_two_points_are_too_few(self) -> None:
        verdict = Assessment(check_points=self.errors([0.1, 0], 2)).judge(3.0)
        assert verdict.reason == "2 check points are too few to measure anything"

    def test_a_point_that_cannot_be_placed_is_no_small_error(self) -> None:
        errors = self.errors([0.1, 0])
        errors.error_px[3] = np.inf
        verdict = Assessment(check_points=errors).judge(3.0)
        assert verdict.reason == "the transform cannot place 1 of 20 check points"

    def test_a_quarter_of_the_test_points_must_be_right(self) -> None:
        errors = self.errors([0.1, 0], 40)
        for right, accepted in ((10, True), (9, False)):
            marked = replace(errors, counted=np.arange(40) < right)
            assert Assessment(test_points=marked).judge(3.0).accepted == accepted

    def test_without_points_there_is_no_verdict(self) -> None:
        assessment = Assessment(control_points=self.errors([0, 0]), two_way=self.errors([0, 0]))
        assert not assessment.can_be_judged
        with pytest.raises(TooFewPointsError, match="no points took no part in the fit"):
            assessment.judge(3.0)


def test_the_summary_has_all_parts_whatever_was_measured() -> None:
    summary = Assessment().summary()
    assert list(summary) == [
        "control_points",
        "test_points",
        "check_points",
        "two_way",
        "three_way",
    ]
    assert all(part["points"] == 0 and math.isnan(part["ce90_m"]) for part in summary.values())


def tie_points(transform: Transform, error_px: np.ndarray) -> TiePoints:
    """Return points with these errors: every third is held out, number 1 is rejected."""
    count = len(error_px)
    px = np.random.default_rng(3).uniform(20, 280, (count, 2))
    return TiePoints(
        reference_xy=transform.inverse(px),
        input_px=px + error_px,
        score=np.ones(count),
        covariance_px2=np.tile(np.eye(2), (count, 1, 1)),
        two_way_error_px=np.zeros(count),
        is_check=np.arange(count) % 3 == 0,
        state=np.where(np.arange(count) == 1, "rejected: far", "used"),
    )


class TestFiles:
    transform = shifted(37.0, -24.0)

    def written(self, path: Path, text: str) -> Path:
        path.write_text(text, encoding="utf-8")
        return path

    @pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".csv"])
    @pytest.mark.parametrize(("crs", "grid"), [(UTM, GRID), (UTM, DEGREES), (None, PLAIN)])
    def test_roles_of_tie_points(
        self, tmp_path: Path, suffix: str, crs: CRS | None, grid: Grid
    ) -> None:
        """Points of the fit are off by 1 px along columns, those held out by 0.5 px along rows."""
        transform = shifted(12.0, 7.0, grid, crs)
        error = np.where((np.arange(30) % 3 == 0)[:, None], [0.0, 0.5], [1.0, 0.0])
        error[1] = [30, 30]
        path = tmp_path / f"points{suffix}"
        write_tie_points(path, tie_points(transform, error), transform)
        control, test = measure_tie_points(path, transform)
        assert (len(control), len(test)) == (19, 10)
        assert control.in_pixels.bias == pytest.approx((1, 0), abs=1e-3)
        assert test.in_pixels.bias == pytest.approx((0, 0.5), abs=1e-3)
        # As check points, only those that were held out count.
        check = measure_check_points(path, transform)
        assert len(check) == 10
        assert check.in_pixels.rmse == pytest.approx(0.5, abs=1e-3)

    def test_a_file_of_the_georeferencer(self, tmp_path: Path) -> None:
        path = tmp_path / "a.points"
        write_tie_points(path, tie_points(self.transform, np.tile([1.0, 0.0], (12, 1))),
                         self.transform)  # fmt: skip
        control, test = measure_tie_points(path, self.transform)
        # Neither the rejected one nor the four held out are enabled.
        assert (len(control), len(test)) == (7, 0)
        assert control.in_pixels.rmse == pytest.approx(1)
        assert len(measure_check_points(path, self.transform)) == 7

    def table(self, path: Path, columns: str, rows: np.ndarray) -> Path:
        lines = [columns, *(",".join(f"{value!r}" for value in row) for row in rows.tolist())]
        return self.written(path, "\n".join(lines) + "\n")

    @pytest.mark.parametrize("grid", [GRID, DEGREES])
    def test_a_simple_table_by_column_and_row(self, tmp_path: Path, grid: Grid) -> None:
        """The reference is in the transform's CRS, also where the input's is another one."""
        transform = shifted(37.0, -24.0, grid)
        xy = transform.inverse(np.random.default_rng(0).uniform(10, 290, (15, 2)))
        rows = np.hstack([xy, transform(xy) + [0.25, -0.75]])
        path = self.table(tmp_path / "p.csv", "reference_x,reference_y,input_col,input_row", rows)
        found = measure_check_points(path, transform)
        assert len(found) == 15
        assert found.in_pixels.bias == pytest.approx((0.25, -0.75), abs=1e-6)

    @pytest.mark.parametrize("grid", [GRID, DEGREES])
    def test_a_simple_table_by_the_inputs_own_map(self, tmp_path: Path, grid: Grid) -> None:
        transform = shifted(37.0, -24.0, grid)
        xy = transform.inverse(np.random.default_rng(0).uniform(10, 290, (15, 2)))
        own = grid.pixel_to_map(transform(xy) + [0.25, -0.75])
        # The columns by pixel are nonsense: the map counts.
        rows = np.hstack([xy, own, np.zeros((15, 2))])
        names = "reference_x,reference_y,input_x,input_y,input_col,input_row"
        path = self.table(tmp_path / "p.csv", names, rows)
        found = measure_check_points(path, transform)
        assert found.in_pixels.bias == pytest.approx((0.25, -0.75), abs=1e-5)

    def test_a_table_that_names_its_crs(self, tmp_path: Path) -> None:
        """45.1° north, 9° east is on the central meridian of UTM zone 32, at x = 500 km."""
        px = self.transform([[500_000.0, 4_994_000.0]])
        path = self.written(
            tmp_path / "p.csv",
            "reference_x,reference_y,input_col,input_row,reference_crs\n"
            f"9.0,45.1,{px[0, 0]},0,EPSG:4326\n",
        )
        found = measure_check_points(path, self.transform)
        assert found.error_px[0, 0] == pytest.approx(0, abs=1e-4)

    def test_roles_and_states_of_a_simple_table(self, tmp_path: Path) -> None:
        path = self.written(
            tmp_path / "p.csv",
            "reference_x,reference_y,input_col,input_row,role,state\n"
            "500105,4999895,1,1,fit,used\n"
            "500205,4999795,2,2,check,used\n"
            "500305,4999695,3,3,check,rejected: blurred\n",
        )
        assert [len(part) for part in measure_tie_points(path, self.transform)] == [1, 1]
        assert measure_check_points(path, self.transform).input_px.tolist() == [[2, 2]]

    def test_a_byte_order_mark_and_quotes(self, tmp_path: Path) -> None:
        path = self.written(
            tmp_path / "p.csv",
            '\ufeff"reference_x","reference_y","input_col","input_row"\n"500105","4999895","3","4"\n',
        )
        assert measure_check_points(path, self.transform).input_px.tolist() == [[3, 4]]

    NAMES = "reference_x,reference_y,input_col,input_row\n"

    @pytest.mark.parametrize(
        ("name", "text", "error", "message"),
        [
            ("p.csv", NAMES, TooFewPointsError, "holds no points"),
            ("p.csv", NAMES + "1,2,3,north\n", TransformFileError, "'north'"),
            ("p.csv", NAMES + "1,2,3\n", TransformFileError, "cannot read"),
            ("p.csv", NAMES + "1,2,3,nan\n", TransformFileError, "not finite"),
            ("p.csv", NAMES + "1,inf,3,4\n", TransformFileError, "not finite"),
            ("p.csv", "x,input_col,input_row\n1,2,3\n", TransformFileError, "'reference_x'"),
            ("p.csv", "reference_x,reference_y\n1,2\n", TransformFileError, "is missing"),
            ("p.csv", "", TooFewPointsError, "holds no points"),
            ("p.txt", "", TransformFileError, "tie points are read from"),
            ("p.gpkg", "no database", TransformFileError, "cannot read"),
            ("p.geojson", "{}", TransformFileError, "'features' is missing"),
        ],
    )
    def test_bad_files(
        self, tmp_path: Path, name: str, text: str, error: type[Exception], message: str
    ) -> None:
        path = self.written(tmp_path / name, text)
        with pytest.raises(error, match=message) as caught:
            measure_check_points(path, self.transform)
        assert name in str(caught.value) or name == "p.txt"

    def test_a_missing_file(self, tmp_path: Path) -> None:
        with pytest.raises(TransformFileError, match="No such file"):
            measure_check_points(tmp_path / "p.csv", self.transform)

    def test_a_place_that_is_not_on_its_map(self, tmp_path: Path) -> None:
        """Latitude and longitude in the wrong order are met like this."""
        text = self.NAMES.replace("\n", ",reference_crs\n") + "45.1,509.0,3,4,EPSG:4326\n"
        path = self.written(tmp_path / "p.csv", text)
        with pytest.raises(GeoreferencingError, match=r"p\.csv holds positions outside of a map"):
            measure_check_points(path, self.transform)

    def test_bytes_that_are_no_text(self, tmp_path: Path) -> None:
        (tmp_path / "p.csv").write_bytes(b"\xff\xfe\x00\x01")
        with pytest.raises(TransformFileError, match="cannot read"):
            measure_check_points(tmp_path / "p.csv", self.transform)

    def test_only_one_has_a_crs(self, tmp_path: Path) -> None:
        plain = shifted(1, 2, PLAIN, None)
        path = tmp_path / "p.gpkg"
        write_tie_points(path, tie_points(self.transform, np.zeros((9, 2))), self.transform)
        with pytest.raises(GeoreferencingError, match=r"only one of .*p\.gpkg and the transform"):
            measure_check_points(path, plain)


def test_the_summary_is_for_json() -> None:
    errors = PointErrors.of(shifted(1, 2), places(), shifted(1, 2)(places()) + [1, 0])
    summary = json.loads(json.dumps(Assessment(check_points=errors).summary()["check_points"]))
    assert summary["rmse_px"] == pytest.approx(1)
    assert summary["bias_x_m"] == pytest.approx(10)
    assert summary["std_y_m"] == pytest.approx(0, abs=1e-6)


def test_statistics_in_another_unit_are_those_of_its_errors() -> None:
    errors = np.random.default_rng(0).normal(size=(50, 2))
    scaled, expected = Statistics.of(errors).scaled(0.5), Statistics.of(0.5 * errors)
    assert scaled.summary("m", ("x", "y")) == pytest.approx(expected.summary("m", ("x", "y")))
