"""Figures show what was measured: arrows, circle and curve are compared with their definitions."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from affine import Affine
from html_pages import decoded
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.quiver import Quiver
from rasterio.crs import CRS

from groundtie.assessment.point_errors import PointErrors
from groundtie.geometry.judging import TOLERANCE_PX
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.registration.verdict import Verdict
from groundtie.report import figures

UTM = CRS.from_epsg(32633)
GRID = Grid(Affine(2.0, 0, 400_000, 0, -2.0, 5_300_000), UTM, 300, 200)
# Pixels of the input are twice as large as those of the matching grid.
TRANSFORM = Transform(
    PolynomialModel("translation", Frame(Affine.identity()), np.array([[14.0, -6.0]])),
    UTM,
    GRID.scaled(2),
)
VERDICT = Verdict(True, "check points confirm", 6, 5, 4, 3, 1.0, 2.0, 1.52, 3.04, -8.5, 0.2, 0.1)

AT_PX = np.array([[10.0, 20], [250, 30], [40, 150], [280, 190], [60, 60], [150, 100], [160, 40]])
ERROR_PX = np.array([[1.0, 0], [0, -1.5], [0.5, 0.5], [-1, 1], [9, -3], [0, 0], [1.5, 1.5]])
IS_CHECK = np.array([False, False, False, True, True, True, True])


def mapped(errors: PointErrors) -> Figure:
    """Return the map of residuals."""
    return figures.residual_map(errors, figures.residual_arrows(errors, GRID), GRID)


def tie_points(
    at_px: np.ndarray = AT_PX, error_px: np.ndarray = ERROR_PX, is_check: np.ndarray = IS_CHECK
) -> TiePoints:
    """Return points that miss the transform by an error in matching pixels; the third is bad."""
    xy = GRID.pixel_to_map(at_px)
    count = len(at_px)
    points = TiePoints(
        reference_xy=xy,
        input_px=TRANSFORM(xy) + error_px / 2,
        score=np.full(count, 8.0),
        covariance_px2=np.tile(np.eye(2) / 10, (count, 1, 1)),
        forward_backward_error_px=np.zeros(count),
        is_check=is_check,
        state=np.full(count, "used"),
    )
    return points.reject(np.arange(count) == 2, "disagrees with the model")


def measured() -> PointErrors:
    return PointErrors.on_grid(tie_points(), TRANSFORM, GRID)


def test_residuals_are_the_injected_errors_in_matching_pixels() -> None:
    residuals = measured()
    np.testing.assert_allclose(residuals.position_px, AT_PX, atol=1e-6)
    np.testing.assert_allclose(residuals.error_px, ERROR_PX, atol=1e-6)
    np.testing.assert_allclose(residuals.length_px, np.hypot(*ERROR_PX.T), atol=1e-6)


def test_points_fall_into_groups() -> None:
    residuals = measured()
    assert np.flatnonzero(residuals.fit).tolist() == [0, 1]
    assert np.flatnonzero(residuals.check).tolist() == [3, 4, 5, 6]
    # (9, -3) and (1.5, 1.5) are further away than the tolerance of 2 px.
    assert np.flatnonzero(residuals.agreeing).tolist() == [3, 5]


def test_points_that_cannot_be_projected_are_no_residuals() -> None:
    points = tie_points()
    nowhere = points.input_px.copy()
    nowhere[3] = np.inf
    residuals = PointErrors.on_grid(replace(points, input_px=nowhere), TRANSFORM, GRID)
    assert not residuals.check[3]
    assert residuals.check[5]


def test_arrows_are_the_residuals_times_their_stated_factor() -> None:
    arrows = figures.residual_arrows(measured(), GRID)
    np.testing.assert_allclose(arrows.vector_px / arrows.exaggeration, ERROR_PX, atol=1e-6)
    # 4 % of 300 px over the median of all that are used, 1.457 px, is 8.2.
    assert arrows.exaggeration == 5
    # 12 % of 300 px over 5 is 7.2.
    assert arrows.scale_px == 5


def test_arrows_of_check_points_set_the_factor_where_there_are_some() -> None:
    """A flexible model fits its own points better than it is."""
    error_px = np.array([[0.001, 0], [0, 0.001], [0, 0], [0.6, 0], [0, 0.7], [0.8, 0], [9, 9]])
    residuals = PointErrors.on_grid(tie_points(error_px=error_px), TRANSFORM, GRID)
    # 4 % of 300 px over 0.7 px is 17.
    assert figures.residual_arrows(residuals, GRID).exaggeration == 10


def test_arrows_are_never_shortened() -> None:
    residuals = PointErrors.on_grid(tie_points(error_px=ERROR_PX * 30), TRANSFORM, GRID)
    assert figures.residual_arrows(residuals, GRID).exaggeration == 1


def test_arrows_of_points_without_error() -> None:
    """What rounding leaves is not blown up to arrows."""
    residuals = PointErrors.on_grid(tie_points(error_px=ERROR_PX * 1e-9), TRANSFORM, GRID)
    assert np.abs(figures.residual_arrows(residuals, GRID).vector_px).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("only_fit", [True, False])
def test_arrows_without_check_points_or_any_point(only_fit: bool) -> None:
    points = tie_points().take(slice(0, 2 if only_fit else 0))
    residuals = PointErrors.on_grid(points, TRANSFORM, GRID)
    arrows = figures.residual_arrows(residuals, GRID)
    # 4 % of 300 px over the median of 1 and 1.5 px is 9.6.
    assert arrows.exaggeration == (5 if only_fit else 1)
    figures.svg_uri(mapped(residuals))


@pytest.mark.parametrize(
    ("value", "rounded"),
    [(1.0, 1), (1.99, 1), (2, 2), (4.9, 2), (5, 5), (9.99, 5), (10, 10), (730, 500), (0.03, 0.02)],
)
def test_round_numbers(value: float, rounded: float) -> None:
    assert figures.round_length(value) == pytest.approx(rounded, rel=1e-12)


def test_the_map_draws_these_arrows_and_its_scale() -> None:
    figure = mapped(measured())
    (axes,) = figure.axes
    quivers = [artist for artist in axes.collections if isinstance(artist, Quiver)]
    drawn = {
        (x, y): (u, v)
        for quiver in quivers[:-1]
        for (x, y), u, v in zip(
            np.round(quiver.get_offsets(), 6).tolist(), quiver.U, quiver.V, strict=True
        )
    }
    shown = [0, 1, 3, 4, 5, 6]
    assert set(drawn) == {tuple(at) for at in AT_PX[shown]}
    for point in shown:
        np.testing.assert_allclose(drawn[tuple(AT_PX[point])], ERROR_PX[point] * 5, atol=1e-5)
    scale = quivers[-1]
    assert (scale.U[0], scale.V[0]) == (25, 0)
    assert [text.get_text() for text in axes.texts] == ["5 px"]
    # Arrows are in the axes' units, and these fill the figure.
    assert {(q.angles, q.scale_units, q.scale) for q in quivers} == {("xy", "xy", 1)}
    assert axes.get_position().bounds == (0, 0, 1, 1)


@pytest.mark.parametrize("free", range(4))
def test_the_scale_hides_no_points(free: int) -> None:
    arrows = figures.residual_arrows(measured(), GRID)
    width, height = GRID.size
    corners = np.array([(x, y) for y in (0.93, 0.07) for x in (0.04, 0.96)]) * (width, height)
    axes = figures.map_axes(GRID)
    figures.draw_scale(axes, arrows, GRID, np.delete(corners, free, axis=0))
    (box,) = axes.patches
    assert [box.get_bbox().contains(*corner) for corner in corners] == [k == free for k in range(4)]


def test_the_map_has_the_shape_and_the_limits_of_the_grid() -> None:
    figure = mapped(measured())
    width, height = figure.get_size_inches()
    assert width / height == pytest.approx(300 / 200)
    assert figure.axes[0].get_xlim() == (-0.5, 299.5)
    assert figure.axes[0].get_ylim() == (199.5, -0.5)


def test_check_points_look_different_from_points_of_the_fit() -> None:
    lines = mapped(measured()).axes[0].lines
    looks = [(line.get_marker(), line.get_color()) for line in lines]
    assert len(set(looks)) == len(looks) == 4
    assert [len(line.get_xdata()) for line in lines] == [1, 2, 2, 2]


def test_the_circle_holds_ninety_percent_of_the_residuals() -> None:
    axes = figures.error_scatter(measured(), VERDICT).axes[0]
    (circle,) = [patch for patch in axes.patches if isinstance(patch, Circle)]
    # √ln 10 times the RMSE of 1 px, for circular normal errors.
    assert circle.get_radius() == pytest.approx(1.5174, abs=1e-4)
    assert circle.center == (0, 0)
    assert axes.get_aspect() == 1


def test_the_scatter_shows_check_points_only() -> None:
    axes = figures.error_scatter(measured(), VERDICT).axes[0]
    drawn = [line.get_xydata() for line in axes.lines if line.get_marker() == "o"]
    # (9, -3) is beyond the figure's reach of 3 px.
    np.testing.assert_allclose(drawn[0], ERROR_PX[[3, 5, 6]], atol=1e-6)


def test_without_a_measured_error_there_is_no_circle_and_no_curve() -> None:
    verdict = Verdict(False, "too few points")
    axes = figures.error_scatter(measured(), verdict).axes[0]
    assert len(axes.patches) == 0
    assert np.hypot(9, -3) < axes.get_xlim()[1]
    assert not figures.error_histogram(measured(), verdict, None).axes[0].lines


def test_the_histogram_counts_check_points() -> None:
    axes = figures.error_histogram(measured(), VERDICT, None).axes[0]
    assert sum(bar.get_height() for bar in axes.patches) == 3
    assert axes.get_xlim() == (0, 3)
    (radius,) = [line for line in axes.lines if line.get_label() == "90 % of the residuals"]
    assert list(radius.get_xdata()) == pytest.approx([1.5174, 1.5174], abs=1e-4)


def test_the_histogram_has_metres_only_if_there_are_any() -> None:
    with_metres = figures.error_histogram(measured(), VERDICT, 2.0).axes[0]
    (top,) = with_metres.child_axes
    figures.svg_uri(with_metres.figure)  # scales the second axis
    assert top.get_xlim() == (0, 6)
    assert not figures.error_histogram(measured(), VERDICT, None).axes[0].child_axes


def test_the_rayleigh_curve_is_the_distribution_of_the_rmse() -> None:
    # RMSE √2 σ; the curve counts as many agreeing points as the verdict does.
    verdict = replace(VERDICT, check_rmse_px=1.3, check_points_agreeing=40)
    expected = scipy.stats.rayleigh(scale=1.3 / np.sqrt(2))
    at = np.linspace(0, 10, 1001)
    counts = figures.rayleigh_counts(at, 0.01, verdict, TOLERANCE_PX)
    np.testing.assert_allclose(
        counts, 40 / expected.cdf(TOLERANCE_PX) * expected.pdf(at) * 0.01, rtol=1e-9
    )
    assert counts[at <= TOLERANCE_PX].sum() == pytest.approx(40, rel=0.01)


def test_figures_are_svg() -> None:
    root = ElementTree.fromstring(decoded(figures.svg_uri(mapped(measured())), "image/svg+xml"))
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    left, top, width, height = (float(part) for part in root.attrib["viewBox"].split())
    assert (left, top) == (0, 0)
    assert width / height == pytest.approx(1.5, rel=1e-3)
