"""The figures of a report: overviews, residuals on the map, errors and similarity surfaces.

matplotlib takes half a second to import, so only the functions that draw with it import it. They
use its `Figure` alone, never pyplot, whose state is global: QGIS runs tools in threads.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..rasters.grid import Grid
from ..rasters.patch import Patch
from ..similarity.surface import Surface
from .verdict import TOLERANCE_PX, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]
Picture = NDArray[np.uint8]
ToPixel = Callable[[FloatArray], FloatArray]

# Longer side of the overviews, and of the faint one under the residuals.
OVERVIEW_PX = 900
BACKDROP_PX = 600

# Three overviews and a backdrop of this size in base64, and some figures, stay below 2 MB.
LARGEST_JPEG_BYTES = 330_000

# Told apart by people with any colour vision (Okabe & Ito 2008).
FIT_COLOUR = "#0072b2"
CHECK_COLOUR = "#d55e00"
REJECTED_COLOUR = "#7a7a7a"

_JPEG_QUALITIES = (85, 75, 60, 45, 30, 15)
_NO_DATA_GREY = 226
_BACKDROP_STRENGTH = 0.4

# A side of the lattice on which an overview follows a transform.
_NODES = 33

_ROUND_NUMBERS = (1.0, 2.0, 5.0)


@dataclass(frozen=True)
class Residuals:
    """By how much tie points disagree with a transform, as the verdict counts it.

    Parameters
    ----------
    position_px
        The points in the matching grid (col, row), shape (n, 2).
    residual_px
        Found minus predicted position of the input's content, matching pixels, shape (n, 2).
    is_check
        Which points were held out of the fit, shape (n,).
    used
        Which points were not rejected and have a residual, shape (n,).
    """

    position_px: FloatArray
    residual_px: FloatArray
    is_check: Mask
    used: Mask

    @classmethod
    def of(cls, points: TiePoints, transform: Transform, grid: Grid) -> Residuals:
        """Measure the residuals of points in pixels of the matching grid."""
        claimed = transform.claimed_xy(points.input_px)
        predicted = transform.model(points.reference_xy)
        residual = grid.map_to_pixel(claimed) - grid.map_to_pixel(predicted)
        return cls(
            grid.map_to_pixel(points.reference_xy),
            residual,
            points.is_check,
            points.used & np.isfinite(residual).all(axis=1),
        )

    @property
    def length_px(self) -> FloatArray:
        """Lengths of the residuals, shape (n,)."""
        return np.asarray(np.hypot(*self.residual_px.T))

    @property
    def fit(self) -> Mask:
        """Which points the fit used, shape (n,)."""
        return self.used & ~self.is_check

    @property
    def check(self) -> Mask:
        """Which points the verdict measured, shape (n,)."""
        return self.used & self.is_check

    @property
    def agreeing(self) -> Mask:
        """Which check points agree with the transform, shape (n,)."""
        return self.check & (self.length_px <= TOLERANCE_PX)


@dataclass(frozen=True)
class Arrows:
    """Residuals as arrows on the map.

    Parameters
    ----------
    start_px, vector_px
        Where the arrows begin in the matching grid, and what they span there, shape (n, 2).
    exaggeration
        How many times longer than the residuals they are.
    scale_px
        Residual that the scale's arrow stands for.
    """

    start_px: FloatArray
    vector_px: FloatArray
    exaggeration: float
    scale_px: float


def residual_arrows(residuals: Residuals, grid: Grid) -> Arrows:
    """Exaggerate residuals by a round factor so that the typical one is well visible."""
    side = max(grid.width, grid.height)
    # A flexible model leaves next to nothing at the points of its own fit.
    believed = residuals.agreeing if residuals.agreeing.any() else residuals.used
    typical = float(np.median(residuals.length_px[believed])) if believed.any() else 0.0
    factor = max(_round_down(0.04 * side / typical), 1.0) if typical > 0 else 1.0
    return Arrows(
        residuals.position_px,
        residuals.residual_px * factor,
        factor,
        _round_down(0.12 * side / factor),
    )


def error_reach_px(residuals: Residuals, verdict: Verdict) -> float:
    """Return up to which error the figures of errors reach, in matching pixels.

    As far as needed to see the errors of right matches; without such, to the largest error.
    """
    if math.isfinite(verdict.check_ce90_px):
        return max(1.6 * verdict.check_ce90_px, 1.5 * TOLERANCE_PX)
    return float(max(residuals.length_px[residuals.check].max(initial=0.0), TOLERANCE_PX) * 1.05)


def rayleigh_counts(at_px: FloatArray, width_px: float, verdict: Verdict) -> FloatArray:
    """Return how many check points per bin the verdict's error explains, at errors, shape (n,).

    Lengths of circular normal errors have a Rayleigh distribution; it is scaled to the number of
    check points that agree.
    """
    variance = verdict.check_rmse_px**2 / 2
    share_agreeing = 1 - math.exp(-(TOLERANCE_PX**2) / (2 * variance))
    density = at_px / variance * np.exp(-(at_px**2) / (2 * variance))
    return np.asarray(density * width_px * verdict.check_points_agreeing / share_agreeing)


def overview_grid(grid: Grid, longest_px: int = OVERVIEW_PX) -> Grid:
    """Return a grid with larger pixels, if need be, so that no side is longer than this."""
    factor = max(grid.width, grid.height) / longest_px
    return grid.scaled(factor) if factor > 1 else grid


def overview_positions(to_input_px: ToPixel, grid: Grid) -> ToPixel:
    """Return a fast stand-in for a transform, good to a fraction of an overview's pixel.

    A spline with hundreds of knots would take longer than all the rest of the report.
    """
    cols, rows = (np.linspace(-0.5, side - 0.5, _NODES) for side in (grid.width, grid.height))
    nodes = np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)
    px = to_input_px(grid.pixel_to_map(nodes))
    if not np.isfinite(px).all():
        return to_input_px
    splines = [
        RectBivariateSpline(rows, cols, axis.reshape(_NODES, _NODES), s=0) for axis in px.T
    ]

    def positions(xy: FloatArray) -> FloatArray:
        at = grid.map_to_pixel(xy)
        return np.column_stack([spline.ev(at[:, 1], at[:, 0]) for spline in splines])

    return positions


def grey_picture(patch: Patch) -> Picture:
    """Stretch the grey values between the 2nd and 98th percentile; no data becomes light grey."""
    picture = np.full(patch.values.shape, _NO_DATA_GREY, np.uint8)
    values = patch.values[patch.valid]
    if values.size:
        low, high = np.percentile(values, (2, 98))
        if low == high:
            low, high = low - 0.5, high + 0.5
        picture[patch.valid] = np.clip((values - low) / (high - low) * 255, 0, 255)
    return picture


def backdrop(picture: Picture) -> Picture:
    """Return a picture small and faint enough to draw on."""
    factor = min(BACKDROP_PX / max(picture.shape), 1.0)
    size = [max(round(side * factor), 1) for side in picture.shape[::-1]]
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return np.asarray(255 - (255 - small.astype(np.float32)) * _BACKDROP_STRENGTH, np.uint8)


def jpeg_uri(picture: Picture) -> str:
    """Return a grey picture as a data URI, in the best quality that is not too large."""
    for quality in _JPEG_QUALITIES:
        data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(data) <= LARGEST_JPEG_BYTES:
            break
    return _data_uri("image/jpeg", data)


def surface_uri(surface: Surface) -> str:
    """Return a similarity surface as the data URI of a PNG, one pixel a shift."""
    levels = cv2.normalize(surface, None, 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)
    colours = cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS)
    return _data_uri("image/png", cv2.imencode(".png", colours)[1].tobytes())


def svg_uri(figure: Figure) -> str:
    """Return a figure as the data URI of an SVG without background."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    return _data_uri("image/svg+xml", buffer.getvalue())


def residual_map(residuals: Residuals, grid: Grid) -> Figure:
    """Draw the points and their exaggerated residuals; the figure's edges are the grid's."""
    arrows = residual_arrows(residuals, grid)
    axes = _map_axes(grid)
    disagreeing = residuals.check & ~residuals.agreeing
    axes.plot(*residuals.position_px[~residuals.used].T, ".", color=REJECTED_COLOUR, ms=3.5)
    axes.plot(*residuals.position_px[residuals.fit].T, ".", color=FIT_COLOUR, ms=4)
    axes.plot(
        *residuals.position_px[residuals.agreeing].T, "o", color=CHECK_COLOUR, mfc="none", ms=7
    )
    axes.plot(*residuals.position_px[disagreeing].T, "x", color=CHECK_COLOUR, ms=6)
    for which, colour, strength in (
        (residuals.fit, FIT_COLOUR, 1.0),
        (disagreeing, CHECK_COLOUR, 0.35),
        (residuals.agreeing, CHECK_COLOUR, 1.0),
    ):
        _draw_arrows(axes, arrows.start_px[which], arrows.vector_px[which], colour, strength)
    _draw_scale(axes, arrows, grid)
    return axes.figure


def point_map(points: TiePoints, grid: Grid) -> Figure:
    """Draw where points lie when there is no transform to disagree with."""
    axes = _map_axes(grid)
    px = grid.map_to_pixel(points.reference_xy)
    axes.plot(*px[~points.used].T, ".", color=REJECTED_COLOUR, ms=3.5)
    axes.plot(*px[points.used & ~points.is_check].T, ".", color=FIT_COLOUR, ms=4)
    axes.plot(*px[points.used & points.is_check].T, "o", color=CHECK_COLOUR, mfc="none", ms=7)
    return axes.figure


def error_histogram(residuals: Residuals, verdict: Verdict, metres_per_px: float | None) -> Figure:
    """Draw how many check points have which error, and the curve that the verdict's error means.

    `metres_per_px` adds a scale in metres; None: there are no metres.
    """
    axes = _figure(4.6, 3.6).add_subplot()
    reach = error_reach_px(residuals, verdict)
    edges = np.linspace(0, reach, 13)
    lengths = residuals.length_px[residuals.check]
    axes.hist(lengths, edges, color=CHECK_COLOUR, alpha=0.45, edgecolor="white")
    if math.isfinite(verdict.check_rmse_px):
        at = np.linspace(0, reach, 100)
        expected = rayleigh_counts(at, float(edges[1]), verdict)
        axes.plot(at, expected, color="black", lw=1.5, label="Rayleigh curve of the RMSE")
        axes.axvline(verdict.check_ce90_px, color=FIT_COLOUR, ls="--", lw=1.5, label="CE90")
        axes.set_ylim(top=1.35 * axes.get_ylim()[1])
        axes.legend(frameon=False, fontsize=8, loc="upper right")
    axes.set(xlim=(0, reach), xlabel="error (px)", ylabel="check points")
    axes.yaxis.get_major_locator().set_params(integer=True)
    if metres_per_px is not None:
        scale = metres_per_px
        top = axes.secondary_xaxis("top", functions=(lambda x: x * scale, lambda x: x / scale))
        top.set_xlabel("error (m)")
    _without_frame(axes)
    return axes.figure


def error_scatter(residuals: Residuals, verdict: Verdict) -> Figure:
    """Draw the check points' residuals around zero and the circle that holds 90 % of them."""
    from matplotlib.patches import Circle

    axes = _figure(3.9, 3.6).add_subplot()
    reach = error_reach_px(residuals, verdict)
    shown = residuals.check & (residuals.length_px <= reach)
    axes.axhline(0, color="#bbbbbb", lw=0.8, zorder=0)
    axes.axvline(0, color="#bbbbbb", lw=0.8, zorder=0)
    axes.plot(*residuals.residual_px[shown].T, "o", color=CHECK_COLOUR, alpha=0.75, ms=5, mew=0)
    if math.isfinite(verdict.check_ce90_px):
        circle = Circle((0, 0), verdict.check_ce90_px, fill=False, ec=FIT_COLOUR, ls="--", lw=1.5)
        axes.add_patch(circle)
    # Rows run downwards, as on the map.
    axes.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")
    axes.set(xlabel="to the right (px)", ylabel="downwards (px)")
    _without_frame(axes)
    return axes.figure


def _figure(width_in: float, height_in: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def _map_axes(grid: Grid) -> Any:
    from matplotlib.figure import Figure

    inches = 8 / max(grid.width, grid.height)
    axes = Figure(figsize=(grid.width * inches, grid.height * inches)).add_axes((0, 0, 1, 1))
    axes.set(xlim=(-0.5, grid.width - 0.5), ylim=(grid.height - 0.5, -0.5))
    axes.set_axis_off()
    return axes


def _draw_arrows(
    axes: Any, start_px: FloatArray, vector_px: FloatArray, colour: str, strength: float = 1.0
) -> None:
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
    )


def _draw_scale(axes: Any, arrows: Arrows, grid: Grid) -> None:
    from matplotlib.patches import Rectangle

    unit = max(grid.width, grid.height) / 100
    length = arrows.scale_px * arrows.exaggeration
    left, low = 2 * unit, grid.height - 2 * unit
    box = Rectangle((left, low), length + 3 * unit, -6 * unit, fc="white", ec="#999999", lw=0.8)
    axes.add_patch(box)
    start = np.array([[left + 1.5 * unit, low - 1.5 * unit]])
    _draw_arrows(axes, start, np.array([[length, 0.0]]), "black")
    text = f"{arrows.scale_px:g} px"
    axes.text(left + 1.5 * unit + length / 2, low - 3 * unit, text, ha="center", fontsize=10)


def _without_frame(axes: Any) -> None:
    axes.spines[["top", "right"]].set_visible(False)


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, … (0.1, 0.2, …) that is not above a value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return float(max(n for n in _ROUND_NUMBERS if n * decade <= value * (1 + 1e-9)) * decade)


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
