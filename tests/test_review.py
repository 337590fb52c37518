"""Points under a person's hands: what is changed counts, check points stay out, all at once."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import rasterio.transform
from noise_pairs import ORIGIN, SHIFT, true_input_px, write_pair
from rasterio.crs import CRS
from rpc_scenes import SIZE, make_scene

from groundtie.errors import NothingFoundError, TooFewPointsError
from groundtie.geometry.models import KINDS, shift_model
from groundtie.geometry.tie_points import EDITED, TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.review import (
    MOST_SPLINE_POINTS,
    SWITCHED_OFF,
    Review,
    of_sensor_image,
    refine_click,
    without_points,
)
from groundtie.sensor.bias import Bias
from groundtie.sensor.rpc_files import write_rpc
from groundtie.tools.refine_rpc import refine_rpc
from groundtie.tools.warp import warp

CRS_33 = CRS.from_epsg(32633)
GRID = Grid(rasterio.transform.from_origin(500_000, 5_000_000, 10, 10), CRS_33, 1000, 1000)


def review_of(count: int, noise_px: float = 0.3, check: int = 0, seed: int = 0) -> Review:
    """Return points that a shift of (5, -7) px and noise were put on."""
    random = np.random.default_rng(seed)
    px = random.uniform(0, 999, (count, 2))
    seen = px + [5.0, -7.0] + random.normal(0, noise_px, (count, 2))
    nothing = np.full(count, np.nan)
    points = TiePoints(
        GRID.pixel_to_map(px),
        seen,
        np.full(count, 9.0),
        np.full((count, 2, 2), np.nan),
        nothing,
        np.arange(count) >= count - check,
        np.full(count, "used"),
        CRS_33,
    )
    return Review(points, GRID)


def rmse_px(review: Review, kind: str, check: bool = False) -> float:
    """Return the root mean square residual at the points of a fit, or at check points."""
    which = review.points.check if check else review.points.fit
    return float(np.sqrt(np.mean(review.fit(kind).residuals_px[which] ** 2)))


def test_all_models_are_fitted_with_the_error_at_points_left_out() -> None:
    review = review_of(60, noise_px=0.3, check=20)
    fits = review.fits()
    assert list(fits) == list(KINDS)
    for fit in fits.values():
        assert fit.residuals_px.shape == (60,)
    # Noise of 0.3 px on both axes; a model of p parameters from n coordinates errs by more at what
    # it has not seen, and fits what it has by less: sigma sqrt(2 (1 ± p/n)).
    expected = 0.3 * np.sqrt(2)
    assert fits["translation"].left_out_px == pytest.approx(expected, rel=0.2)
    assert rmse_px(review, "translation", check=True) == pytest.approx(expected, rel=0.3)
    assert rmse_px(review, "polynomial3") < rmse_px(review, "translation")
    assert fits["polynomial3"].left_out_px > fits["translation"].left_out_px  # type: ignore[operator]


def test_a_point_moved_by_50_m_changes_its_residual_and_the_fit() -> None:
    review = review_of(40, noise_px=0.01)
    moved = review.move(3, reference_xy=review.points.reference_xy[3] + [30.0, 40.0])
    after = moved.fit("affine")
    assert after.residuals_px[3] > 4
    assert rmse_px(moved, "affine") > 10 * rmse_px(review, "affine")
    assert moved.worst(after.residuals_px)[0] == 3
    assert moved.points.edited.tolist() == [index == 3 for index in range(40)]
    assert not review.points.edited.any()  # what was there before is as it was
    elsewhere = review.move(3, input_px=review.points.input_px[3] + [5.0, 0.0]).fit("affine")
    assert elsewhere.residuals_px[3] > 4


def test_a_point_switched_off_takes_no_part_and_can_come_back() -> None:
    review = review_of(30, noise_px=0.01)
    wrong = review.move(0, input_px=(0.0, 0.0))
    off = wrong.switch([0], on=False)
    assert off.points.state[0] == SWITCHED_OFF
    assert rmse_px(off, "similarity") < 0.05 < rmse_px(wrong, "similarity")
    assert rmse_px(off.switch([0], on=True), "similarity") == rmse_px(wrong, "similarity")
    assert 0 not in off.worst(off.fit("similarity").residuals_px)


def test_check_points_stay_check_points() -> None:
    review = review_of(30, check=10)
    before = review.fit("affine")
    moved = review.move(25, input_px=review.points.input_px[25] + [40.0, 0.0])
    after = moved.fit("affine")
    assert moved.points.is_check[25]
    np.testing.assert_array_equal(
        after.transform(review.points.reference_xy), before.transform(review.points.reference_xy)
    )
    assert rmse_px(moved, "affine", check=True) > rmse_px(review, "affine", check=True) + 5


@pytest.mark.slow
def test_points_of_a_person_are_marked_in_the_file_and_by_warp(tmp_path: Path) -> None:
    write_pair(tmp_path, 0)
    reference_xy = np.array(ORIGIN) + [
        [50.0, -50.0],
        [300.0, -60.0],
        [200.0, -330.0],
        [90.0, -300.0],
    ]
    # The georeferencing is off by SHIFT: what lies there is seen at these pixels.
    seen = true_input_px(reference_xy)
    review = without_points(tmp_path / "reference.tif", tmp_path / "input.tif")
    for xy, px in zip(reference_xy, seen, strict=True):
        review = review.add(xy, px)
    fit = review.fit("translation")
    review.write(tmp_path / "p.gpkg", fit.transform)
    again = Review.open(tmp_path / "p.gpkg", tmp_path / "input.tif")
    assert again.points.edited.all()
    np.testing.assert_allclose(again.points.input_px, seen, atol=1e-6)
    result = warp(
        tmp_path / "input.tif", tmp_path / "o.tif", tmp_path / "p.gpkg", model="translation"
    )
    assert result.fit is not None
    assert result.fit.edited == 4
    assert "edited by hand: 4 points" in "\n".join(result.lines())
    shift = result.transform.nominal_xy(seen) - reference_xy
    np.testing.assert_allclose(shift, [SHIFT] * 4, atol=1e-6)


def test_an_added_point_keeps_the_other_columns() -> None:
    review = review_of(5).add(GRID.pixel_to_map([10.0, 20.0]), (15.0, 13.0), score=7.0)
    assert len(review.points) == 6
    assert review.points.score[-1] == 7.0
    assert review.points.more[EDITED].tolist() == [0, 0, 0, 0, 0, 1]
    assert not review.points.is_check[-1]


def test_too_few_points_leave_the_models_that_they_hold() -> None:
    fits = review_of(3).fits()
    assert set(fits) == {"translation", "rigid", "similarity", "affine"}
    with pytest.raises(TooFewPointsError):
        review_of(3).fit("polynomial2")
    assert review_of(0).fits() == {}


def lying_at(places_px: np.ndarray) -> Review:
    """Return the points of a shift of (5, -7) px at these pixels of the reference."""
    review = review_of(len(places_px))
    for index, place in enumerate(places_px):
        review = review.move(index, GRID.pixel_to_map(place), place + [5.0, -7.0])
    return review


@pytest.mark.parametrize("along", [(1.0, 0.0), (0.3, 0.7), (1.0, -1.0)])
def test_points_on_a_line_hold_no_spline(along: tuple[float, float]) -> None:
    fits = lying_at(100 + np.outer(np.arange(0.0, 240.0, 20.0), along)).fits()
    assert "tps" not in fits
    assert fits["similarity"].residuals_px.max() < 1e-6


@pytest.mark.parametrize("count", [2, 5])
@pytest.mark.filterwarnings("error")
def test_points_at_one_place_hold_a_shift_alone(count: int) -> None:
    fits = lying_at(np.full((count, 2), 100.0)).fits()
    assert fits["translation"].residuals_px.max() < 1e-6
    assert not {"rigid", "similarity", "tps"} & set(fits)
    assert all(np.isfinite(fit.residuals_px).all() for fit in fits.values())


def test_points_at_one_place_are_objected_to() -> None:
    review = review_of(6)
    for index in range(6):
        review = review.move(
            index, GRID.pixel_to_map([100.0 + index, 100.0]), (105.0 + index, 93.0)
        )
    objection = review.objection("affine")
    assert "follows" in objection or "to a line" in objection
    assert review_of(6).objection("affine") == ""


def test_a_spline_is_fitted_to_few_points_only() -> None:
    """Two thousand points answer a person at once: all models but the spline.

    How long that takes is printed; the goal is 0.2 s of processor.
    """
    moved = review_of(2000, check=200).move(0, input_px=(1.0, 1.0))
    start = time.process_time()
    fits = moved.fits()
    print(f"models of 2000 points: {time.process_time() - start:.3f} s of processor")
    assert "tps" not in fits
    assert len(fits) == len(KINDS) - 1
    assert "tps" in review_of(MOST_SPLINE_POINTS).fits(["tps"])


@pytest.mark.parametrize("off", [(0.0, 0.0), (4.0, -3.0), (-5.5, 2.5)])
def test_a_click_is_refined_by_similarity(tmp_path: Path, off: tuple[float, float]) -> None:
    """The pair is a negative of itself, so it is mutual information that finds the place."""
    write_pair(tmp_path, 0)
    with rasterio.open(tmp_path / "input.tif") as source:
        grid = Grid(source.transform, source.crs, source.width, source.height)
    nominal = Transform(shift_model(0.0, 0.0), CRS_33, grid)
    xy = np.array(ORIGIN) + [180.25, -200.5]
    truth = true_input_px(xy[None])[0]
    names = tmp_path / "reference.tif", tmp_path / "input.tif"
    found, peak = refine_click(*names, xy, truth + off, nominal)
    np.testing.assert_allclose(found, truth, atol=0.3)
    assert peak.height > 5


def test_clicks_at_different_places_are_not_refined(tmp_path: Path) -> None:
    write_pair(tmp_path, 0)
    with rasterio.open(tmp_path / "input.tif") as source:
        grid = Grid(source.transform, source.crs, source.width, source.height)
    nominal = Transform(shift_model(0.0, 0.0), CRS_33, grid)
    names = tmp_path / "reference.tif", tmp_path / "input.tif"
    lost = 0
    for shift in (60.0, 90.0, 120.0):
        xy = np.array(ORIGIN) + [100.0 + shift, -150.0]
        try:
            _, peak = refine_click(*names, xy, (200.0, 300.0 - shift), nominal)
            lost += peak.height < 5
        except NothingFoundError:
            lost += 1
    assert lost == 3


@pytest.mark.parametrize("value", [1, 90, 200])
def test_a_click_on_constant_ground_is_refused(tmp_path: Path, value: int) -> None:
    """As on a calm lake, a little larger than what is compared: no place there is like another."""
    write_pair(tmp_path, 0)
    with rasterio.open(tmp_path / "reference.tif", "r+") as raster:
        image = raster.read()
        image[:, 170:230, 170:230] = value
        raster.write(image)
    with rasterio.open(tmp_path / "input.tif") as source:
        grid = Grid(source.transform, source.crs, source.width, source.height)
    nominal = Transform(shift_model(0.0, 0.0), CRS_33, grid)
    xy = np.array(ORIGIN) + [200.0, -200.0]
    names = tmp_path / "reference.tif", tmp_path / "input.tif"
    with pytest.raises(NothingFoundError, match="do not match: click again"):
        refine_click(*names, xy, true_input_px(xy), nominal)


@pytest.mark.slow
def test_control_of_an_image_with_rpcs_is_reviewed_alike(tmp_path: Path) -> None:
    """Points by the exact RPCs; the image's own are 8 px off, and a moved point is marked."""
    scene = make_scene(tmp_path, Bias("shift", SIZE, np.array([[-6.0, 5.0]]), np.zeros((2, 2))))
    files = scene.reference, scene.image
    write_rpc(tmp_path / "exact_RPC.TXT", scene.truth)
    terrain = scene.dem, "ellipsoidal"
    exact = of_sensor_image(*files, tmp_path / "exact_RPC.TXT", *terrain, None)
    px = np.stack(np.meshgrid(*(np.linspace(60, side - 60, 4) for side in SIZE)), -1).reshape(-1, 2)
    xy = exact.nominal.nominal_xy(px)
    height = exact.input_grid.orientation.heights_at(xy)  # type: ignore[attr-defined]
    header = "reference_x,reference_y,input_col,input_row,height_m"
    table = np.column_stack([xy, px, height])
    np.savetxt(tmp_path / "gcps.csv", table, delimiter=",", header=header, comments="")
    review = of_sensor_image(*files, tmp_path / "exact_RPC.TXT", *terrain, tmp_path / "gcps.csv")
    assert rmse_px(review, "translation") < 0.01
    np.testing.assert_allclose(review.input_px(review.nominal_xy[0]), px[0], atol=1e-3)
    moved = review.move(3, reference_xy=xy[3] + 5.0)
    assert moved.fit("translation").residuals_px[3] > 4
    # The ground has another height there; where a point stays, it keeps its own.
    assert np.isnan(moved.points.more["height_m"][3])
    assert moved.points.more["height_m"][2] == pytest.approx(height[2])
    moved.write(tmp_path / "moved.gpkg", moved.nominal)
    refined = refine_rpc(
        scene.image,
        tmp_path / "refined_RPC.TXT",
        gcps=tmp_path / "moved.gpkg",
        dem=scene.dem,
        dem_datum="ellipsoidal",
        model="shift",
        residuals=tmp_path / "residuals.gpkg",
    )
    assert refined.summary()["points_by_hand"] == 1
    assert "set by hand: 1 points" in refined.lines()
    again = of_sensor_image(
        *files, tmp_path / "refined_RPC.TXT", *terrain, tmp_path / "residuals.gpkg"
    )
    assert np.flatnonzero(again.points.edited).tolist() == [3]
