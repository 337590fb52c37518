"""The figure on series: a network of registrations and its adjustment."""

from __future__ import annotations

import numpy as np
from affine import Affine
from matplotlib.figure import Figure
from rasterio.crs import CRS

from groundtie.rasters.grid import Grid
from groundtie.series.frame import SeriesFrame
from groundtie.series.network import Link, adjust
from scripts.drawing import BLUE, GREEN, GREY, ORANGE, Scenes, canvas

_DATES, _SIGMA_PX, _WRONG = 9, 0.08, (0, 5)


def series(_: Scenes) -> Figure:
    """A network with one wrong link, and the displacements before and after its adjustment."""
    rng = np.random.default_rng(4)
    grid = Grid(Affine(10, 0, 0, 0, -10, 0), CRS.from_epsg(32633), 1000, 1000)
    frame = SeriesFrame.around(grid, [grid] * _DATES)
    truth = np.concatenate([[0.0], np.cumsum(rng.normal(0, 0.5, _DATES - 1))])
    star = [(0, date) for date in range(1, _DATES)]
    chain = [(date, date + 1) for date in range(1, _DATES - 1)]
    links = []
    for first, second in star + chain:
        shift = np.zeros(6)
        shift[0] = truth[second] - truth[first] + rng.normal(0, _SIGMA_PX)
        shift[0] += 1.2 * ((first, second) == _WRONG)
        links.append(Link(first, second, shift, _SIGMA_PX**2 * np.eye(6)))
    found = adjust(frame, links, _DATES, 0, is_free=False)
    figure, axes = canvas(8, 3.0, 2)
    angle = np.linspace(0.15 * np.pi, 0.85 * np.pi, _DATES - 1)
    places = np.array([(0.0, 0.0), *zip(-np.cos(angle), np.sin(angle), strict=True)])
    for link, kept in zip(links, found.kept, strict=True):
        ends = places[[link.first, link.second]].T
        axes[0].plot(*ends, color=BLUE if kept else ORANGE, lw=1.2, zorder=1)
    axes[0].plot(*places[1:].T, "o", color=BLUE, ms=6)
    axes[0].plot(*places[:1].T, "s", color=GREEN, ms=8)
    axes[0].set_aspect("equal")
    at = np.arange(1, _DATES)
    sigma = np.sqrt(found.covariances[1:, 0, 0])
    axes[1].plot(at, truth[1:], color=GREY, lw=1, label="truth")
    measured = [link.displacement[0] for link in links[: _DATES - 1]]
    axes[1].plot(at, measured, "x", color=ORANGE, label="from the reference alone")
    axes[1].errorbar(
        at, found.displacements[1:, 0], 3 * sigma, fmt="o", color=BLUE, ms=4, capsize=2,
        label="adjusted",
    )  # fmt: skip
    axes[1].axis("on")
    axes[1].tick_params(labelsize=7)
    axes[1].set_xlabel("date", fontsize=8)
    axes[1].set_ylabel("displacement (px)", fontsize=8)
    axes[1].legend(fontsize=7)
    return figure
