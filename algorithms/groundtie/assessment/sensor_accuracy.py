"""Errors of RPCs at check points, before and after a refinement ([Suri2010], table 5.7)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..geometry.judging import SMALLEST_PX
from ..rasters.atomic import write_csv, write_figure
from ..rasters.grid import LON_LAT, FloatArray, metres_per_unit_at, near_longitude, reproject
from ..report.figures import CHECK_COLOUR, FIT_COLOUR, round_length
from ..sensor.control_points import ControlPoints
from ..sensor.rpc import RPC
from .statistics import Statistics


@dataclass(frozen=True)
class SensorErrors:
    """Errors of RPCs at points.

    Parameters
    ----------
    error_px
        Measured image positions of the points minus those by the RPCs (col, row), (n, 2).
    error_m
        Map positions of the measured pixels by the RPCs, at the points' heights, minus those of
        the points, metres along the axes of the map, (n, 2).
    """

    error_px: FloatArray
    error_m: FloatArray

    @classmethod
    def of(cls, rpc: RPC, points: ControlPoints) -> SensorErrors:
        """Measure the errors of RPCs.

        Raises
        ------
        GeoreferencingError
            The map or the RPCs cannot place some points.
        """
        seen = rpc.localise(points.input_px, points.height_m)
        moved = reproject(seen, LON_LAT, points.crs) - points.reference_xy
        moved = near_longitude(moved, 0.0, points.crs)
        error_px = points.input_px - rpc.project(points.lon_lat, points.height_m)
        placed = np.isfinite(np.hstack([moved, error_px])).all(axis=1)
        points.require_placed(np.asarray(placed))
        return cls(error_px, moved * metres_per_unit_at(points.reference_xy, points.crs))

    def summary(self) -> dict[str, Any]:
        """Return the statistics as JSON values."""
        return {
            **Statistics.of(self.error_px).summary("px", ("col", "row")),
            **Statistics.of(self.error_m).summary("m", ("x", "y")),
            "mean_absolute_m": np.abs(self.error_m).mean(axis=0).tolist(),
        }


def table_lines(errors: dict[str, SensorErrors]) -> list[str]:
    """Return the errors of each point, and their statistics, as lines of text."""
    head = "point " + "".join(f"  {name + ' x':>10}{'y (m)':>9}" for name in errors)
    lines = [head]
    count = len(next(iter(errors.values())).error_m)

    def row(label: str, values: list[FloatArray]) -> str:
        cells = "".join(f"  {x:10.2f}{y:9.2f}" for x, y in values)
        return f"{label:<6}{cells}"

    for i in range(count):
        lines.append(row(str(i + 1), [each.error_m[i] for each in errors.values()]))
    lines.append(row("|mean|", [np.abs(e.error_m).mean(axis=0) for e in errors.values()]))
    lines.append(row("std", [e.error_m.std(axis=0) for e in errors.values()]))
    for name, each in errors.items():
        metres, px = Statistics.of(each.error_m), Statistics.of(each.error_px)
        lines.append(
            f"{name}: RMSE {metres.rmse:.2f} m ({px.rmse:.2f} px), CE90 {metres.ce90:.2f} m, "
            f"largest {metres.largest:.2f} m"
        )
    return lines


def write_table(path: Path, points: ControlPoints, errors: dict[str, SensorErrors]) -> None:
    """Write the errors of each point as CSV."""
    names = ["x", "y", "height_m", "col", "row"]
    columns = [points.reference_xy, points.height_m[:, None], points.input_px]
    for name, each in errors.items():
        names += [f"{name}_{axis}" for axis in ("x_m", "y_m", "col_px", "row_px")]
        columns += [each.error_m, each.error_px]
    rows = np.hstack(columns).tolist()
    write_csv(path, names, (dict(zip(names, row, strict=True)) for row in rows))


def draw_vectors(
    path: Path, points: ControlPoints, errors: dict[str, SensorErrors], size: tuple[int, int]
) -> None:
    """Draw the errors as arrows in the image, before and after, each at its own scale."""
    from matplotlib.figure import Figure  # heavy

    figure = Figure(figsize=(5.0 * len(errors), 5.0 * size[1] / size[0] + 0.8), layout="tight")
    for i, (name, each) in enumerate(errors.items()):
        axes = figure.add_subplot(1, len(errors), i + 1)
        length = np.hypot(*each.error_px.T)
        unit = round_length(max(float(np.median(length)), SMALLEST_PX))
        stretch = 0.1 * max(size) / unit
        col, row = points.input_px.T
        arrows = axes.quiver(
            col, row, *(each.error_px * stretch).T, angles="xy", scale_units="xy", scale=1,
            color=FIT_COLOUR if i else CHECK_COLOUR, width=0.006,
        )  # fmt: skip
        axes.quiverkey(arrows, 0.85, 1.04, unit * stretch, f"{unit:g} px", coordinates="axes")
        axes.plot(col, row, ".", color="black", markersize=3)
        rmse = Statistics.of(each.error_px).rmse
        axes.set_title(f"{name}: RMSE {rmse:.2f} px", loc="left", fontsize=10)
        axes.set_xlim(0, size[0])
        axes.set_ylim(size[1], 0)
        axes.set_aspect("equal")
    write_figure(path, figure, 130)
