"""The figures of a report: residuals on the map, and errors at check points.

matplotlib takes half a second to import, so only the functions that draw with it import it. They
use its `Figure` alone, never pyplot, whose state is global: QGIS runs tools in threads.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..assessment.point_errors import PointErrors
from ..geometry.judging import FEWEST_CHECK_POINTS, SMALLEST_PX, ce90_of_rmse
from ..rasters.grid import FloatArray, Grid
from ..registration.verdict import Verdict
from .pictures import data_uri

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# Distinguishable with any colour vision [Okabe2008].
FIT_COLOUR = "#0072b2"
CHECK_COLOUR = "#d55e00"
REJECTED_COLOUR = "#7a7a7a"

_ROUND_NUMBERS = (1.0, 2.0, 5.0)


@dataclass(frozen=True)
class Arrows:
    """Residuals as arrows on the map.

    Parameters
    ----------
    vector_px
        Vectors of the arrows in the matching grid, shape (n, 2).
    exaggeration
        Ratio of the arrows' length to the residuals'.
    scale_px
        Residual that the scale's arrow represents.
    """

    vector_px: FloatArray
    exaggeration: float
    scale_px: float


def residual_arrows(errors: PointErrors, grid: Grid) -> Arrows:
    """Exaggerate residuals so that the typical one is well visible."""
    # A flexible model has next to no residuals at the points of its own fit.
    enough = errors.agreeing.sum() >= FEWEST_CHECK_POINTS
    which = errors.agreeing if enough else errors.used
    # Without points, as if residuals were as long as the grid: nothing is exaggerated.
    typical_px = float(np.median(errors.length_px[which])) if which.any() else max(grid.size)
    return scaled_arrows(errors.error_px, typical_px, 0.04, grid)


def scaled_arrows(by_px: FloatArray, length_px: float, share: float, grid: Grid) -> Arrows:
    """Exaggerate by a round factor so that a length is no more than a share of the grid's side."""
    side = max(grid.size)
    factor = max(round_length(share * side / max(length_px, SMALLEST_PX)), 1.0)
    return Arrows(by_px * factor, factor, round_length(0.12 * side / factor))


def error_reach_px(errors: PointErrors, verdict: Verdict) -> float:
    """Return the largest error within the figures of errors, in matching pixels.

    It encloses the errors of inliers or, if these are unknown, the largest error.
    """
    radius = ce90_of_rmse(verdict.check_rmse_px)
    if math.isfinite(radius):
        return max(1.6 * radius, 1.5 * errors.tolerance_px)
    return float(max(errors.length_px[errors.check].max(initial=0.0), errors.tolerance_px) * 1.05)


def rayleigh_counts(
    at_px: FloatArray, width_px: float, verdict: Verdict, tolerance_px: float
) -> FloatArray:
    """Return the check points per bin expected by the verdict's error, at errors, shape (n,).

    Lengths of circular normal errors have a Rayleigh distribution; it is scaled to the number of
    check points that agree.
    """
    variance = verdict.check_rmse_px**2 / 2
    share_agreeing = 1 - math.exp(-(tolerance_px**2) / (2 * variance))
    density = at_px / variance * np.exp(-(at_px**2) / (2 * variance))
    return np.asarray(density * width_px * verdict.check_points_agreeing / share_agreeing)


def svg_uri(figure: Figure) -> str:
    """Return a figure as the data URI of an SVG without background."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    return data_uri("image/svg+xml", buffer.getvalue())


def shown_residuals(errors: PointErrors, grid: Grid) -> dict[str, Any]:
    """Return the template's values for residuals: their map, and the arrows' exaggeration."""
    arrows = residual_arrows(errors, grid)
    return {
        "map": svg_uri(residual_map(errors, arrows, grid)),
        "exaggeration": arrows.exaggeration,
    }


def shown_errors(
    errors: PointErrors, verdict: Verdict, metres_per_px: float | None
) -> dict[str, str]:
    """Return the template's values for errors at check points; see `error_histogram`."""
    return {
        "histogram": svg_uri(error_histogram(errors, verdict, metres_per_px)),
        "scatter": svg_uri(error_scatter(errors, verdict)),
    }


def residual_map(errors: PointErrors, arrows: Arrows, grid: Grid) -> Figure:
    """Draw the points and their exaggerated residuals; the figure's edges are the grid's."""
    axes = map_axes(grid)
    disagreeing = errors.check & ~errors.agreeing
    axes.plot(*errors.position_px[~errors.used].T, ".", color=REJECTED_COLOUR, ms=3.5)
    axes.plot(*errors.position_px[errors.fit].T, ".", color=FIT_COLOUR, ms=4)
    axes.plot(*errors.position_px[errors.agreeing].T, "o", color=CHECK_COLOUR, mfc="none", ms=7)
    axes.plot(*errors.position_px[disagreeing].T, "x", color=CHECK_COLOUR, ms=6)
    for which, colour, strength in (
        (errors.fit, FIT_COLOUR, 1.0),
        (disagreeing, CHECK_COLOUR, 0.35),
        (errors.agreeing, CHECK_COLOUR, 1.0),
    ):
        draw_arrows(axes, errors.position_px[which], arrows.vector_px[which], colour, strength)
    draw_scale(axes, arrows, grid, errors.position_px)
    return axes.figure


def error_histogram(errors: PointErrors, verdict: Verdict, metres_per_px: float | None) -> Figure:
    """Draw a histogram of check points' errors, and the curve expected by the verdict's error.

    `metres_per_px` adds a scale in metres; None: there are no metres.
    """
    axes = _plot_axes(4.8)
    reach = error_reach_px(errors, verdict)
    edges = np.linspace(0, reach, 13)
    lengths = errors.length_px[errors.check]
    axes.hist(lengths, edges, color=CHECK_COLOUR, alpha=0.45, edgecolor="white")
    if math.isfinite(verdict.check_rmse_px):
        at = np.linspace(0, reach, 100)
        expected = rayleigh_counts(at, float(edges[1]), verdict, errors.tolerance_px)
        axes.plot(at, expected, color="black", lw=1.5, label="Rayleigh curve of the RMSE")
        radius = ce90_of_rmse(verdict.check_rmse_px)
        axes.axvline(radius, color=FIT_COLOUR, ls="--", lw=1.5, label="90 % of the residuals")
        axes.set_ylim(top=1.35 * axes.get_ylim()[1])
        axes.legend(edgecolor="white", framealpha=1, fontsize=8, loc="upper right")
    axes.set(xlim=(0, reach), xlabel="error (px)", ylabel="check points")
    axes.yaxis.get_major_locator().set_params(integer=True)
    if metres_per_px is not None:
        scale = metres_per_px
        top = axes.secondary_xaxis("top", functions=(lambda x: x * scale, lambda x: x / scale))
        top.set_xlabel("error (m)")
    without_frame(axes)
    return axes.figure


def error_scatter(errors: PointErrors, verdict: Verdict) -> Figure:
    """Draw the check points' residuals around zero and the circle that holds 90 % of them."""
    from matplotlib.patches import Circle

    axes = _plot_axes(3.9)
    reach = error_reach_px(errors, verdict)
    shown = errors.check & (errors.length_px <= reach)
    axes.axhline(0, color="#bbbbbb", lw=0.8, zorder=0)
    axes.axvline(0, color="#bbbbbb", lw=0.8, zorder=0)
    axes.plot(*errors.error_px[shown].T, "o", color=CHECK_COLOUR, alpha=0.75, ms=5, mew=0)
    radius = ce90_of_rmse(verdict.check_rmse_px)
    if math.isfinite(radius):
        circle = Circle((0, 0), radius, fill=False, ec=FIT_COLOUR, ls="--", lw=1.5)
        axes.add_patch(circle)
    # Rows run downwards, as on the map.
    axes.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")
    axes.set(xlabel="to the right (px)", ylabel="downwards (px)")
    without_frame(axes)
    return axes.figure


def _plot_axes(width_in: float) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, 3.7))
    # Fixed margins: a layout engine would draw everything twice.
    figure.subplots_adjust(left=0.65 / width_in, right=1 - 0.15 / width_in, bottom=0.14, top=0.86)
    return figure.add_subplot()


def map_axes(grid: Grid) -> Any:
    """Return axes whose edges are the grid's, rows downwards."""
    from matplotlib.figure import Figure

    inches = 8 / max(grid.size)
    axes = Figure(figsize=(grid.width * inches, grid.height * inches)).add_axes((0, 0, 1, 1))
    axes.set(xlim=(-0.5, grid.width - 0.5), ylim=(grid.height - 0.5, -0.5))
    axes.set_axis_off()
    return axes


def draw_arrows(
    axes: Any,
    start_px: FloatArray,
    vector_px: FloatArray,
    colour: str,
    strength: float = 1.0,
    order: int = 2,
) -> None:
    """Draw arrows from positions of the grid, shape (n, 2), along vectors, shape (n, 2)."""
    axes.quiver(
        *start_px.T,
        *vector_px.T,
        angles="xy",
        scale_units="xy",
        scale=1,
        units="inches",
        width=0.022,
        headwidth=4,
        headlength=4.5,
        headaxislength=4.2,
        minlength=0,
        color=colour,
        alpha=strength,
        zorder=order,
    )


def draw_scale(axes: Any, arrows: Arrows, grid: Grid, shown_px: FloatArray) -> None:
    """Draw the arrow of a round residual, in the corner with the fewest points, (n, 2)."""
    from matplotlib.patches import Rectangle

    unit = max(grid.size) / 100
    length = arrows.scale_px * arrows.exaggeration
    size = np.array([length + 3 * unit, 6 * unit])
    corners = np.array(
        [
            (x, y)
            for y in (grid.height - 8 * unit, 2 * unit)
            for x in (2 * unit, grid.width - 2 * unit - size[0])
        ]
    )
    # A point is drawn about as large as a unit.
    beside = np.abs(shown_px - (corners + size / 2)[:, None]) <= size / 2 + unit
    left, top = corners[beside.all(axis=2).sum(axis=1).argmin()]
    axes.add_patch(Rectangle((left, top), *size, fc="white", ec="#999999", lw=0.8, zorder=3))
    start = np.array([[left + 1.5 * unit, top + 4.5 * unit]])
    draw_arrows(axes, start, np.array([[length, 0.0]]), "black", order=4)
    middle, text = left + size[0] / 2, f"{arrows.scale_px:g} px"
    axes.text(middle, top + 3 * unit, text, ha="center", fontsize=10, zorder=4)


def without_frame(axes: Any) -> None:
    """Omit the lines at the top and at the right of a plot."""
    axes.spines[["top", "right"]].set_visible(False)


def round_length(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, … (0.1, 0.2, …) that is not above a value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return float(max(n for n in _ROUND_NUMBERS if n * decade <= value * (1 + 1e-9)) * decade)
