"""The report on a series: shifts by date, loops, flickering thumbnails, the worst dates first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..geometry.transform import Transform
from ..report import figures, pictures
from ..report.page import Page, made
from .series import Series, SeriesDate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Longer side of a thumbnail, and the largest number of dates shown: 100 take 3 MB.
_THUMBNAIL_PX = 360
_MOST_SHOWN = 100


@dataclass(frozen=True)
class SeriesReport(Page):
    """The report on a series, registered or refused.

    Parameters
    ----------
    series
        The series; its rasters are open.
    """

    series: Series
    template: ClassVar[str] = "series.html.j2"

    @classmethod
    def of(cls, series: Series) -> SeriesReport:
        """Return the report on a series."""
        title = f"Series of {len(series.dates)} dates, registered {series.datum}"
        return cls(series, title=title, parameters=series.parameters, seconds=series.seconds)

    def numbers(self) -> dict[str, Any]:
        """Return the measured values by name."""
        left_out = {*made(self.parameters, self.seconds), "files"}
        return {k: v for k, v in self.series.summary().items() if k not in left_out}

    def values(self) -> dict[str, Any]:
        """Return the values that the template shows."""
        series = self.series
        rows = sorted(series.rows(), key=_badness)
        placed = [one for one in series.dates if one.transform is not None]
        return {
            "rows": rows,
            "registered": len(series.registered),
            "left_out": [row for row in rows if row["state"] == "left out"],
            "count": len(series.registered) + len(series.left_out),
            "loops": series.loops(),
            "beyond": series.beyond_line(),
            "rejected": [" – ".join(names) for names in series.rejected],
            "shifts": figures.svg_uri(shift_figure(series)) if len(placed) > 1 else None,
            "closures": figures.svg_uri(closure_figure(series))
            if series.loops()["count"]
            else None,
            "thumbnails": self._thumbnails(placed[:_MOST_SHOWN]),
            "ratio": series.map_grid.width / series.map_grid.height,
        }

    def _thumbnails(self, dates: list[SeriesDate]) -> list[dict[str, str]]:
        """Return each date's nominal and registered image as data URIs."""
        grid = pictures.overview_grid(self.series.map_grid, _THUMBNAIL_PX)
        found = []
        for one in dates:
            assert one.date is not None and one.transform is not None
            image = one.date.matched
            nominal = Transform.nominal(one.transform.crs, one.transform.input_grid)
            to_px = [transform.of_map(grid.crs) for transform in (nominal, one.transform)]
            uris = [
                pictures.jpeg_uri(pictures.grey_picture(image.read_onto(grid, positions)))
                for positions in to_px
            ]
            time = one.listed.time
            day = "" if time is None else f"{time:%Y-%m-%d}"
            found.append({"name": one.name, "time": day, "nominal": uris[0], "registered": uris[1]})
        return found


def _badness(row: dict[str, Any]) -> tuple[bool, float, float]:
    """Return the sort key of rows: dates that are left out first, then the largest loop errors."""
    stays = row["state"] != "left out"
    return stays, -(row["worst_loop_px"] or 0.0), -(row["sigma_px"] or 0.0)


def shift_figure(series: Series) -> Figure:
    """Draw the displacement of each date along both axes with three standard deviations."""
    from matplotlib.figure import Figure

    placed = [one for one in series.dates if one.verdict.displacement is not None]
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    axes = figure.subplots()
    times = [one.listed.time for one in placed]
    at: list[Any] = list(times) if all(times) else list(range(len(placed)))
    displacements = np.array([one.verdict.displacement for one in placed])
    covariances = np.array([one.verdict.covariance for one in placed])
    axes.axhline(0, color="#bbbbbb", lw=0.8, zorder=0)
    for axis, colour, label in (
        (0, figures.FIT_COLOUR, "to the right"),
        (1, figures.CHECK_COLOUR, "downwards"),
    ):
        sigma = np.sqrt(covariances[:, axis, axis])
        axes.errorbar(
            at, displacements[:, axis], 3 * sigma, fmt="o-", color=colour, ms=4, lw=1, capsize=2,
            label=label,
        )  # fmt: skip
    axes.set_ylabel("displacement (px)")
    if not all(times):
        axes.set_xlabel("date, in the order of the inputs")
        axes.set_xticks(at)
    axes.legend(fontsize=8, edgecolor="white")
    figures.without_frame(axes)
    return figure


def closure_figure(series: Series) -> Figure:
    """Draw the errors of loops against those expected from covariances."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.8, 3.4), layout="constrained")
    axes = figure.subplots()
    settled = series.settled
    for closures, mark, colour, label in (
        (settled.closures, "o", figures.FIT_COLOUR, "of dates that stay"),
        (settled.open_closures, "x", figures.CHECK_COLOUR, "that do not close"),
    ):
        if closures:
            places = [one.expected_px for one in closures], [one.error_px for one in closures]
            axes.plot(*places, mark, color=colour, ms=5, label=label)
    # The axes begin at 0; the margin keeps the mark of the largest value inside.
    reach = 1.1 * max(*axes.get_xlim(), 1e-6)
    axes.plot([0, reach], [0, reach], color="#bbbbbb", lw=0.8, zorder=0)
    axes.set(xlim=(0, reach), ylim=(0, None), xlabel="expected (px)", ylabel="error of loop (px)")
    axes.legend(fontsize=8, edgecolor="white")
    figures.without_frame(axes)
    return figure
