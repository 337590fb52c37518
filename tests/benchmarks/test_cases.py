"""Cases are read as they are written down, and written so that they carry their own truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from benchmark_cases import CHECK_POINT_ERROR_PX, MATRIX, SIZES, image, pixels, to_input
from rasterio.warp import Resampling, reproject

from benchmarks.attempt import Pair, on_pixels
from benchmarks.cases import (
    KINDS,
    REFERENCE_TRANSFORM,
    SAR_OPTICAL,
    RealCase,
    data_folder,
    draw_shift,
    image_size,
    read_cases,
    read_image,
    search_radius_m,
    write_case,
    write_image,
)
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid

SHIFT = (7.25, -3.5)


def claimed_map(path: Path, px: np.ndarray) -> np.ndarray:
    """Map positions that a file claims for its pixel centres, by rasterio's own reckoning."""
    with rasterio.open(path) as source:
        return np.column_stack(source.xy(px[:, 1], px[:, 0], offset="center"))


@pytest.fixture
def pair(cases: dict[str, RealCase], tmp_path: Path) -> Pair:
    return write_case(cases["hills"], SHIFT, tmp_path)


def test_only_kinds_that_coregister_is_made_for_are_read(cases: dict[str, RealCase]) -> None:
    assert list(cases) == ["hills", "plain"]


def test_a_case_is_what_is_written_down(cases: dict[str, RealCase], data: Path) -> None:
    hills, plain = cases["hills"], cases["plain"]
    assert (hills.kind, hills.sigma_px) == (SAR_OPTICAL, 2.0)
    assert (hills.reference, hills.input) == (
        data / "hills" / "reference.tif",
        data / "hills" / "input.tif",
    )
    assert hills.check_points == data / "hills" / "check_points.csv"
    assert plain.check_points is None
    np.testing.assert_array_equal(hills.matrix, MATRIX)


def test_the_truth_is_that_of_check_points_where_there_are_some(
    cases: dict[str, RealCase],
) -> None:
    points, lattice = cases["hills"].truths()
    assert len(points.reference_px) == 4
    assert points.error_px(to_input) == pytest.approx(CHECK_POINT_ERROR_PX)
    assert lattice.error_px(to_input) == pytest.approx(0, abs=1e-9)


def test_without_check_points_the_truth_is_the_matrix(cases: dict[str, RealCase]) -> None:
    truth, lattice = cases["plain"].truths()
    assert truth is lattice
    np.testing.assert_allclose(lattice.reference_px.max(axis=0), [89, 79])
    np.testing.assert_allclose(lattice.input_px, to_input(lattice.reference_px))


def test_shifts_are_drawn_once_and_for_all(cases: dict[str, RealCase]) -> None:
    hills, plain = cases["hills"], cases["plain"]
    assert draw_shift(hills, 20, 0) == draw_shift(hills, 20, 0)
    drawn = [draw_shift(case, 20, n) for case in (hills, plain) for n in range(5)]
    assert len(set(drawn)) == 10


def test_shifts_fill_the_square_and_stay_within_the_search_radius(
    cases: dict[str, RealCase],
) -> None:
    drawn = np.array([draw_shift(cases["hills"], 20, n) for n in range(300)])
    assert np.abs(drawn).max() <= 20
    # Uniform between -20 and 20: mean 0, standard deviation 40 / sqrt 12; four standard errors.
    assert np.abs(drawn.mean(axis=0)).max() < 4 * 11.55 / np.sqrt(300)
    np.testing.assert_allclose(drawn.std(axis=0), 11.55, rtol=0.15)
    assert np.hypot(*drawn.T).max() < search_radius_m(20) == pytest.approx(29.284, abs=1e-3)


def test_the_reference_has_square_pixels_of_a_metre(pair: Pair) -> None:
    with rasterio.open(pair.reference) as source:
        assert source.crs.to_epsg() == 32633
        assert source.transform == REFERENCE_TRANSFORM
        assert source.res == (1.0, 1.0)


def test_the_input_claims_a_place_that_is_off_by_the_shift(pair: Pair) -> None:
    px = pixels(SIZES["reference"])[::97]
    right = claimed_map(pair.reference, px)
    claimed = claimed_map(pair.input, to_input(px))
    # Columns go east, rows south.
    np.testing.assert_allclose(claimed - right, np.tile([7.25, 3.5], (len(px), 1)), atol=1e-6)


def test_without_a_shift_the_input_falls_on_the_reference(
    cases: dict[str, RealCase], tmp_path: Path
) -> None:
    found = write_case(cases["hills"], (0.0, 0.0), tmp_path)
    np.testing.assert_allclose(
        registered(found)[30:50, 30:60], image("reference")[0, 30:50, 30:60], atol=1.0
    )


def test_with_a_shift_it_falls_beside_it(cases: dict[str, RealCase], tmp_path: Path) -> None:
    found = write_case(cases["hills"], (4.0, -3.0), tmp_path)
    np.testing.assert_allclose(
        registered(found)[27:47, 34:64], image("reference")[0, 30:50, 30:60], atol=1.0
    )


def registered(pair: Pair) -> np.ndarray:
    """The input on the reference's grid as GDAL puts it there."""
    moved = np.zeros(SIZES["reference"][::-1], np.float32)
    with rasterio.open(pair.input) as source, rasterio.open(pair.reference) as reference:
        reproject(
            rasterio.band(source, 1),
            moved,
            dst_transform=reference.transform,
            dst_crs=reference.crs,
            resampling=Resampling.cubic,
        )
    return moved


def test_the_transform_that_takes_the_shift_out_has_no_error(pair: Pair) -> None:
    assert pair.lattice is not None
    with rasterio.open(pair.input) as source:
        grid = Grid(source.transform, source.crs, source.width, source.height)
    # Map positions to where the input claims them to be; rows go south.
    offset = np.array([[SHIFT[0], -SHIFT[1]]])
    model = PolynomialModel("translation", Frame(Affine.identity()), offset)
    mapping = on_pixels(Transform(model, grid.crs, grid), pair.reference)
    assert pair.lattice.error_px(mapping) == pytest.approx(0, abs=1e-6)


def test_believing_the_georeferencing_is_wrong_by_the_shift(pair: Pair) -> None:
    assert pair.lattice is not None
    with rasterio.open(pair.input) as source:
        grid = Grid(source.transform, source.crs, source.width, source.height)
    mapping = on_pixels(Transform.nominal(grid.crs, grid), pair.reference)
    assert pair.lattice.error_px(mapping) == pytest.approx(np.hypot(*SHIFT))


def test_pixels_are_copied_as_they_are(pair: Pair, cases: dict[str, RealCase]) -> None:
    for written, original in ((pair.reference, "reference"), (pair.input, "input")):
        np.testing.assert_array_equal(read_image(written), image(original))
    assert pair.sigma_px == cases["hills"].sigma_px
    assert image_size(pair.input) == SIZES["input"]


def test_a_fourth_band_of_bytes_is_transparency(tmp_path: Path) -> None:
    rgba = np.full((4, 8, 8), 200, np.uint8)
    path = write_image(rgba, REFERENCE_TRANSFORM, tmp_path / "rgba.tif")
    with rasterio.open(path) as source:
        names = [interpretation.name for interpretation in source.colorinterp]
    assert names == ["red", "green", "blue", "alpha"]


def test_the_data_folder_can_be_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("GROUNDTIE_DATA", str(tmp_path))
    assert data_folder() == tmp_path
    monkeypatch.delenv("GROUNDTIE_DATA")
    assert data_folder().parts[-2:] == ("shared", "data")


def test_the_real_cases(real_data: Path) -> None:
    real = read_cases(real_data)
    assert sum(case.kind == SAR_OPTICAL for case in real) == 9
    assert {case.kind for case in real} == set(KINDS)
    for case in real:
        truth, lattice = case.truths()
        assert case.sigma_px > 0
        # Check points and matrix are two accounts of one truth.
        assert truth.error_px(case.reference_to_input) < 4.0, case.name
        assert lattice.error_px(case.reference_to_input) == pytest.approx(0, abs=1e-9)
