"""Figures on the search: similarity surfaces, coarse search, neighbours, rotation."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import rasterio
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

import groundtie
from groundtie.matching import belief_propagation
from groundtie.rasters.grid import apply_affine
from scripts.drawing import (
    BLUE,
    ORANGE,
    FloatArray,
    Scenes,
    canvas,
    columns,
    draw_arrows,
    draw_surface,
    framed,
    read_band,
    read_rows,
    stretched,
)


def similarity(scenes: Scenes) -> Figure:
    """Similarity surfaces of one chip by four measures."""
    pair, surface = scenes.rural(), scenes.folder / "surface.tif"
    true_px = _true_shift_px(pair, 500130.5, 5333629.5)
    figure, axes = canvas(8, 2.35, 4)
    for each, name in zip(axes, ("nmi", "orientation", "edge-strength", "fused"), strict=True):
        result = groundtie.similarity_surface(
            pair / "reference.tif", pair / "input.tif", surface, similarity=name,
            centre_x=500130.5, centre_y=5333629.5,
        )  # fmt: skip
        with rasterio.open(surface) as source:
            values = source.read(2)
        peak = result.summary()["peak"]
        draw_surface(each, values, true_px, (peak["right_px"], peak["down_px"]))
        each.set_title(f"{name}: {values.max():.1f} σ", fontsize=9)
    return figure


def search(scenes: Scenes) -> Figure:
    """The coarse surface of a scene, and the tie points of the model."""
    pair, points = scenes.rural(), scenes.folder / "points.csv"
    surface = scenes.folder / "coarse.tif"
    groundtie.similarity_surface(
        pair / "reference.tif", pair / "input.tif", surface, chip_size=401, search_radius=30
    )
    groundtie.coregister(
        pair / "reference.tif", pair / "input.tif", scenes.folder / "out.tif", tie_points=points
    )
    with rasterio.open(surface) as source:
        values = source.read(2)
    figure, axes = canvas(8, 3.7, 2)
    draw_surface(axes[0], values, _true_shift_px(pair, None, None))
    middle = values.shape[0] // 2
    for row, col in _highest(values, 4):
        axes[0].add_patch(Circle((col - middle, row - middle), 2.2, fill=False, color=ORANGE))
    axes[0].set_title("coarse search: the whole scene at all shifts", fontsize=9)
    _draw_displacements(axes[1], pair, points)
    return figure


def propagation(_: Scenes) -> Figure:
    """Similarity surfaces of chips, alone and after belief propagation."""
    rng = np.random.default_rng(5)
    side, radius, true = 7, 10, (3, -2)
    rows, cols = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    noise = rng.standard_normal((side * side, 2 * radius + 1, 2 * radius + 1))
    smooth = np.stack([cv2.GaussianBlur(one, (0, 0), 0.8) for one in noise])
    bump = np.exp(-((cols - true[0]) ** 2 + (rows - true[1]) ** 2) / 3)
    surfaces = smooth / smooth.std() + rng.uniform(1.4, 3.2, (side * side, 1, 1)) * bump
    centres = np.array([(50 * c, 50 * r) for r in range(side) for c in range(side)])
    after = belief_propagation.propagate(surfaces.astype(np.float32), centres, 75.0)
    figure, axes = canvas(8, 4.3, 8, rows=2)
    for column, chip in enumerate((8, 16, 24, 31)):
        for line, stack in enumerate((surfaces, after)):
            row, col = np.unravel_index(int(stack[chip].argmax()), stack[chip].shape)
            each = axes[line * 4 + column]
            draw_surface(each, stack[chip], true, (int(col) - radius, int(row) - radius))
    axes[0].set_title("alone", fontsize=9, loc="left")
    axes[4].set_title("with neighbours", fontsize=9, loc="left")
    return figure


def rotation(scenes: Scenes) -> Figure:
    """Peak height of the best shift over rotation, and the images under the pose found."""
    angle_deg = 40.0
    reference = _reduced(np.log(read_band(scenes.rural() / "reference.tif") + 1.0))
    upright = _reduced(read_band(scenes.rural() / "input.tif", 3)[:500, :500])
    rotated = _rotated(upright, angle_deg)
    steps = np.arange(-180.0, 180.0, 2.0)
    heights = [_best_height(reference, _rotated(rotated, -step)) for step in steps]
    figure, axes = canvas(8, 2.9, 3)
    found = float(steps[int(np.argmax(heights))])
    axes[0].plot(steps, heights, color=BLUE, linewidth=1)
    axes[0].axvline(angle_deg, color=ORANGE, linestyle=":", linewidth=1)
    axes[0].axis("on")
    axes[0].tick_params(labelsize=7)
    axes[0].set(xticks=(-180, -90, 0, 90, 180))
    axes[0].set_xlabel("rotation (°)", fontsize=8)
    axes[0].set_title("height of the best shift (σ)", fontsize=9)
    axes[1].imshow(stretched(rotated), cmap="gray")
    axes[1].set_title(f"input, rotated by {angle_deg:.0f}°", fontsize=9)
    back = _rotated(rotated, -found)
    square = (np.indices(reference.shape) // 40).sum(axis=0) % 2 == 0
    axes[2].imshow(np.where(square, stretched(reference), stretched(back)), cmap="gray")
    axes[2].set_title(f"in squares, rotated back by {found:.0f}°", fontsize=9)
    return figure


def _draw_displacements(axes: Axes, pair: Path, points: Path) -> None:
    """Draw the displacements of tie points and check points, five times as long."""
    rows = [row for row in read_rows(points) if row["state"] == "used"]
    with rasterio.open(pair / "reference.tif") as source:
        to_pixel, bounds = ~source.transform, (source.width, source.height)
    with rasterio.open(pair / "input.tif") as source:
        nominal = source.transform
    for role, colour, name in (("fit", BLUE, "tie points"), ("check", ORANGE, "check points")):
        chosen = [row for row in rows if row["role"] == role]
        position = apply_affine(to_pixel, columns(chosen, "reference_x", "reference_y"))
        pixels = columns(chosen, "input_col", "input_row") + 0.5
        found = apply_affine(to_pixel, apply_affine(nominal, pixels))
        draw_arrows(axes, position, found - position, 5.0, colour)
        axes.plot([], [], color=colour, label=name)
    axes.set(xlim=(0, bounds[0]), ylim=(bounds[1], 0))
    framed(axes)
    axes.legend(fontsize=7, loc="upper right")
    axes.set_title("displacements, five times as long", fontsize=9)


def _true_shift_px(pair: Path, x: float | None, y: float | None) -> tuple[float, float]:
    """Return the shift (right, down) of a place's nominal position in the input."""
    with rasterio.open(pair / "reference.tif") as source:
        pixel_m = source.transform.a
        middle = apply_affine(source.transform, [source.width / 2, source.height / 2])[0]
    with rasterio.open(pair / "input.tif") as source:
        nominal = source.transform
    xy = middle if x is None or y is None else (x, y)
    truth = groundtie.load_transform(pair / "truth.json")
    found = apply_affine(nominal, truth(np.array([xy])) + 0.5)[0]
    return (found[0] - xy[0]) / pixel_m, (xy[1] - found[1]) / pixel_m


def _highest(values: FloatArray, count: int) -> list[tuple[int, int]]:
    """Return the rows and columns of the highest separate peaks."""
    left, peaks = values.copy(), []
    for _ in range(count):
        row, col = (int(k) for k in np.unravel_index(int(left.argmax()), left.shape))
        peaks.append((row, col))
        left[max(row - 4, 0) : row + 5, max(col - 4, 0) : col + 5] = -np.inf
    return peaks


def _best_height(reference: FloatArray, other: FloatArray) -> float:
    """Return the robust peak height of the best shift of two squared orientation fields."""
    spectra = [np.fft.fft2(_orientation(image)) for image in (reference, other)]
    surface = np.real(np.fft.ifft2(spectra[0].conj() * spectra[1]))
    spread = 1.4826 * np.median(np.abs(surface - np.median(surface)))
    return float((surface.max() - np.median(surface)) / spread)


def _orientation(image: FloatArray) -> NDArray[np.complex128]:
    down, right = np.gradient(cv2.GaussianBlur(image, (0, 0), 1.5))
    gradient = right + 1j * down
    inside = np.hypot(*(np.indices(image.shape) - len(image) / 2)) < 0.46 * len(image)
    squared = gradient**2 / (np.abs(gradient) ** 2 + np.median(np.abs(gradient) ** 2))
    return np.asarray(np.where(inside, squared, 0))


def _rotated(image: FloatArray, angle_deg: float) -> FloatArray:
    middle = (image.shape[1] / 2 - 0.5, image.shape[0] / 2 - 0.5)
    matrix = cv2.getRotationMatrix2D(middle, angle_deg, 1.0)
    border = float(np.median(image))
    return np.asarray(cv2.warpAffine(image, matrix, image.shape[::-1], borderValue=border), float)


def _reduced(image: FloatArray) -> FloatArray:
    small = cv2.resize(image.astype(np.float64), (240, 240), interpolation=cv2.INTER_AREA)
    return np.asarray(small, float)
