"""Errors at the points of files of all formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from known_errors import DEGREES, GRID, PLAIN, shifted
from raster_files import UTM, utm_grid, write_raster
from rasterio.crs import CRS

from groundtie.arrays import Raster
from groundtie.assessment.measuring import (
    AssessmentFiles,
    matching_px,
    measure_check_points,
    measure_tie_points,
)
from groundtie.errors import GeoreferencingError, TooFewPointsError, TransformFileError
from groundtie.geometry.tie_point_files import write_tie_points
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.rasters.reading import open_raster


def tie_points(transform: Transform, error_px: np.ndarray) -> TiePoints:
    """Return points with these errors: every third is held out, number 1 is rejected."""
    count = len(error_px)
    px = np.random.default_rng(3).uniform(20, 280, (count, 2))
    return TiePoints(
        reference_xy=transform.inverse(px),
        input_px=px + error_px,
        score=np.ones(count),
        covariance_px2=np.tile(np.eye(2), (count, 1, 1)),
        forward_backward_error_px=np.zeros(count),
        is_check=np.arange(count) % 3 == 0,
        state=np.where(np.arange(count) == 1, "rejected: far", "used"),
    )


@pytest.mark.parametrize(("size_m", "expected"), [(100.0, 10.0), (10.0, 1.0), (2.0, 1.0)])
def test_images_are_matched_in_pixels_of_the_coarser(
    tmp_path: Path, size_m: float, expected: float
) -> None:
    """The input's pixels are 10 m a side."""
    grid = Grid(Affine(size_m, 0, 500_000, 0, -size_m, 5_300_000), UTM, 30, 20)
    path = write_raster(tmp_path / "r.tif", np.ones((20, 30), np.uint8), grid)
    with open_raster(path) as reference:
        assert matching_px(shifted(37.0, -24.0), reference) == pytest.approx(expected)
    assert matching_px(shifted(37.0, -24.0), None) == 1


def test_nothing_is_known_of_pixels_that_lie_outside_of_the_transforms_map() -> None:
    # In the middle, a quarter turn from the zone's.
    grid = Affine(0.5, 0, 98.25, 0, -0.5, 0.75)
    far = open_raster(Raster(np.zeros((3, 3), np.uint8), grid, CRS.from_epsg(4326)))
    assert matching_px(shifted(0.0, 0.0), far) == 1


class TestFiles:
    transform = shifted(37.0, -24.0)

    @pytest.mark.parametrize("finer", [1, 20])
    def test_points_agree_within_pixels_of_the_coarser_image(
        self, tmp_path: Path, finer: int
    ) -> None:
        """Errors of 1.9 and of 2.1 pixels of 10 m, in an input of finer pixels."""
        transform = shifted(0.0, 0.0, utm_grid(400 * finer, 300 * finer, 10 / finer))
        error = finer * np.where((np.arange(60) < 30)[:, None], [1.9, 0.0], [0.0, 2.1])
        for name in ("ties.gpkg", "checks.gpkg"):
            write_tie_points(tmp_path / name, tie_points(transform, error), transform)
        given = AssessmentFiles(
            *(None, tmp_path / "ties.gpkg", tmp_path / "checks.gpkg", None, None, None, None)
        )
        path = write_raster(tmp_path / "r.tif", np.ones((300, 400), np.uint8), GRID)
        with open_raster(path) as reference:
            found = given.measure(transform, 20.0 * finer, reference)
        for part in (found.test_points, found.check_points):
            assert part.used.all()
            assert part.agreeing.tolist() == [True] * 10 + [False] * 10

    def written(self, path: Path, text: str) -> Path:
        path.write_text(text, encoding="utf-8")
        return path

    @pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".csv"])
    @pytest.mark.parametrize(("crs", "grid"), [(UTM, GRID), (UTM, DEGREES), (None, PLAIN)])
    @pytest.mark.slow
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
        assert measure_check_points(path, self.transform).position_px.tolist() == [[2, 2]]

    @pytest.mark.parametrize("held_out", ["", "500205,4999795,2,2,check,rejected: blurred\n"])
    def test_points_of_a_fit_are_no_check_points(self, tmp_path: Path, held_out: str) -> None:
        """Nor are points that a person drew beside them: a model is fitted to these, too."""
        path = self.written(
            tmp_path / "p.csv",
            "reference_x,reference_y,input_col,input_row,role,state\n"
            "500105,4999895,1,1,fit,used\n500305,4999695,3,3,,\n" + held_out,
        )
        with pytest.raises(TooFewPointsError, match=r"p\.csv: no points took no part in the fit"):
            measure_check_points(path, self.transform)

    def test_a_byte_order_mark_and_quotes(self, tmp_path: Path) -> None:
        path = self.written(
            tmp_path / "p.csv",
            '\ufeff"reference_x","reference_y","input_col","input_row"\n"500105","4999895","3","4"\n',
        )
        assert measure_check_points(path, self.transform).position_px.tolist() == [[3, 4]]

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
