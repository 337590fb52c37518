"""Shared parts of the documentation's figures: scenes, colours, axes and output."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray
from PIL import Image

import groundtie

BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#7a7a7a"

# Grey levels, and steps in blends of colours with white and black: few colours make small files.
_GREYS, _BLENDS = 22, 6

FloatArray = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Scenes:
    """Simulated scenes in a folder, made on first use."""

    folder: Path

    def rural(self) -> Path:
        """Return the folder of a rural pair of 500 px."""
        return self._pair("rural", size=500, density="rural", looks=4, seed=1)

    def city(self) -> Path:
        """Return the folder of a dense city of 400 px."""
        return self._pair("city", size=400, density="city", looks=4, seed=3)

    def large_city(self) -> Path:
        """Return the folder of a city of 1000 px, as ground masks depend on the whole scene."""
        return self._pair("large-city", size=1000, density="city", seed=225)

    def speckled(self) -> Path:
        """Return the folder of a rural pair with one look."""
        return self._pair("speckled", size=300, density="rural", looks=1, seed=4)

    def sensor(self) -> Path:
        """Return the folder of an image in sensor geometry with wrong RPCs."""
        folder = self.folder / "sensor"
        groundtie.simulate_sensor(
            folder, size=600, density="rural", relief=60, shift=40, drift=8, seed=2
        )
        return folder

    def _pair(self, name: str, **options: Any) -> Path:
        folder = self.folder / name
        if not folder.exists():
            groundtie.simulate(folder, **options)
        return folder


def canvas(width: float, height: float, count: int, rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure and its axes, without ticks, row by row."""
    figure = Figure(figsize=(width, height), dpi=100, layout="tight")
    axes = [figure.add_subplot(rows, count // rows, k + 1) for k in range(count)]
    for each in axes:
        each.axis("off")
    return figure, axes


def framed(axes: Axes) -> None:
    """Give axes a frame without ticks, and square pixels."""
    axes.axis("on")
    axes.set(xticks=[], yticks=[])
    axes.set_aspect("equal")


def draw_surface(
    axes: Axes,
    values: FloatArray,
    true_px: tuple[float, float],
    peak_px: tuple[float, float] | None = None,
) -> None:
    """Draw a surface over shifts, with the true shift as a cross and the peak as a circle."""
    radius = values.shape[0] // 2
    extent = (-radius - 0.5, radius + 0.5, radius + 0.5, -radius - 0.5)
    low, high = np.quantile(values, 0.02), values.max()
    axes.imshow(values, cmap="gray", extent=extent, vmin=float(low), vmax=float(high))
    axes.plot(*true_px, "+", color=BLUE, markersize=14, markeredgewidth=1.5)
    if peak_px is not None:
        axes.add_patch(Circle(peak_px, 0.09 * radius, fill=False, color=ORANGE, linewidth=1.5))
    axes.set(xlim=extent[:2], ylim=extent[2:])


def draw_arrows(
    axes: Axes, position: FloatArray, vector: FloatArray, stretch: float, colour: str
) -> Any:
    """Draw vectors at positions, both of shape (n, 2), lengthened by a factor."""
    return axes.quiver(
        *position.T, *(vector * stretch).T, angles="xy", scale_units="xy", scale=1, color=colour,
        width=0.005,
    )  # fmt: skip


def read_band(path: Path, number: int = 1) -> FloatArray:
    """Return the values of a band of a raster."""
    with rasterio.open(path) as source:
        return np.asarray(source.read(number), np.float64)


def stretched(image: FloatArray) -> FloatArray:
    """Return an image stretched to 0–1, with its darkest and brightest 2 % saturated."""
    low, high = np.quantile(image, (0.02, 0.98))
    return np.asarray(np.clip((image - low) / (high - low), 0, 1))


def read_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV table, each by column names."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def columns(rows: list[dict[str, str]], *names: str) -> FloatArray:
    """Return some columns of a table as numbers, of shape (rows, columns)."""
    return np.array([[float(row[name]) for name in names] for row in rows])


def write(figure: Figure, path: Path) -> None:
    """Write a figure with few colours, which keeps the file small."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", facecolor="white", bbox_inches="tight", pad_inches=0.05)
    image = Image.open(buffer).convert("RGB")
    image.quantize(palette=_palette(), dither=Image.Dither.NONE).save(path, optimize=True)


def _palette() -> Image.Image:
    """Return a palette image of greys and of the figures' colours from dark to pale."""
    colours = [[level] * 3 for level in np.linspace(0, 255, _GREYS)]
    for name in (BLUE, ORANGE, GREEN):
        pure = np.array([int(name[k : k + 2], 16) for k in (1, 3, 5)])
        for share in np.linspace(0.25, 1, _BLENDS):
            colours += [list(share * pure), list(255 - share * (255 - pure))]
    image = Image.new("P", (1, 1))
    image.putpalette(np.rint(np.array(colours)).astype(np.uint8).tobytes())
    return image
