"""Draw the figures of the documentation from simulated scenes with fixed seeds."""

from __future__ import annotations

import argparse
import csv
import io
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rasterio
from affine import Affine
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle
from numpy.typing import NDArray
from PIL import Image

import groundtie
from groundtie.arrays import Raster
from groundtie.context import threads
from groundtie.geometry.chance import agreement_probability, log10_chance
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.matching import belief_propagation
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.survey import Survey, survey_model
from groundtie.rasters.pair import Image as PairImage
from groundtie.rasters.pair import make_pair
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster
from groundtie.similarity.sameness import same_windows
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.sift_variants import sift_detector

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"

BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#7a7a7a"

# Colours are blended with white and black in so many steps: few colours make small files.
_GREYS, _BLENDS = 22, 6

FloatArray = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Scenes:
    """Simulated scenes in a folder, made when they are asked for first."""

    folder: Path

    def rural(self) -> Path:
        """Return the folder of a rural pair of 500 px."""
        return self._pair("rural", size=500, density="rural", looks=4, seed=1)

    def city(self) -> Path:
        """Return the folder of a dense city of 400 px."""
        return self._pair("city", size=400, density="city", looks=4, seed=3)

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


def pipeline(_: Scenes) -> Figure:
    """The stages of a registration and what flows between them."""
    stages = (
        ("inspect", "what the images are", "SceneInfo"),
        ("mask", "what takes part", "masks"),
        ("coarse", "shift or pose,\nmodel by levels", "coarse model"),
        ("match", "chips, pooled\nhistograms, keypoints", "correspondences"),
        ("fit", "model choice,\nrobust", "transform"),
        ("check", "held-out points", "check points"),
        ("rules", "one list,\neach names itself", "verdict"),
    )
    figure, (axes,) = _canvas(9.6, 2.7, 1)
    for number, (name, what, gives) in enumerate(stages):
        colour = ORANGE if name in ("check", "rules") else BLUE
        left = number * 1.4
        axes.add_patch(
            FancyBboxPatch(
                (left, 0.9), 1.05, 0.8, "round,pad=0.06", edgecolor=colour, facecolor="white"
            )
        )
        axes.text(left + 0.52, 1.5, name, ha="center", fontsize=11, weight="bold", color=colour)
        axes.text(left + 0.52, 1.17, what, ha="center", va="center", fontsize=7)
        axes.text(left + 0.52, 0.62, gives, ha="center", fontsize=7.5, style="italic")
        if number + 1 < len(stages):
            axes.annotate(
                "", (left + 1.36, 1.3), (left + 1.1, 1.3), arrowprops={"arrowstyle": "->"}
            )
    right = 6 * 1.4 + 1.05
    axes.plot((0, right), (2.0, 2.0), color=GREY, linewidth=1)
    axes.text(0, 2.08, "pair: reference, input, matching grid", fontsize=8, color=GREY)
    axes.plot((2.8, 6.65), (0.42, 0.42), color=GREY, linewidth=1)
    axes.text(
        2.8, 0.2, "held-out blocks of the reference are masked here …", fontsize=8, color=GREY
    )
    axes.plot((7.0, 8.05), (0.42, 0.42), color=ORANGE, linewidth=1)
    axes.text(7.0, 0.2, "… and used here only", fontsize=8, color=ORANGE)
    axes.set(xlim=(-0.15, right + 0.15), ylim=(0.05, 2.35))
    return figure


def similarity(scenes: Scenes) -> Figure:
    """Surfaces of one chip by four measures."""
    pair, surface = scenes.rural(), scenes.folder / "surface.tif"
    true_px = _true_shift_px(pair, 412130.5, 5333629.5)
    figure, axes = _canvas(8, 2.35, 4)
    for each, name in zip(axes, ("nmi", "orientation", "edge-strength", "fused"), strict=True):
        result = groundtie.similarity_surface(
            pair / "reference.tif", pair / "input.tif", surface, similarity=name,
            centre_x=412130.5, centre_y=5333629.5,
        )  # fmt: skip
        with rasterio.open(surface) as source:
            values = source.read(2)
        peak = result.summary()["peak"]
        _draw_surface(each, values, true_px, (peak["right_px"], peak["down_px"]))
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
    figure, axes = _canvas(8, 3.7, 2)
    _draw_surface(axes[0], values, _true_shift_px(pair, None, None))
    middle = values.shape[0] // 2
    for row, col in _highest(values, 4):
        axes[0].add_patch(Circle((col - middle, row - middle), 2.2, fill=False, color=ORANGE))
    axes[0].set_title("coarse search: the whole scene at all shifts", fontsize=9)
    _draw_displacements(axes[1], pair, points)
    return figure


def propagation(_: Scenes) -> Figure:
    """Surfaces of chips alone and after belief propagation."""
    rng = np.random.default_rng(5)
    side, radius, true = 7, 10, (3, -2)
    rows, cols = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    noise = rng.standard_normal((side * side, 2 * radius + 1, 2 * radius + 1))
    smooth = np.stack([cv2.GaussianBlur(one, (0, 0), 0.8) for one in noise])
    bump = np.exp(-((cols - true[0]) ** 2 + (rows - true[1]) ** 2) / 3)
    surfaces = smooth / smooth.std() + rng.uniform(1.4, 3.2, (side * side, 1, 1)) * bump
    centres = np.array([(50 * c, 50 * r) for r in range(side) for c in range(side)])
    after = belief_propagation.propagate(surfaces.astype(np.float32), centres, 75.0)
    figure, axes = _canvas(8, 4.3, 8, rows=2)
    for column, chip in enumerate((8, 16, 24, 31)):
        for line, stack in enumerate((surfaces, after)):
            row, col = np.unravel_index(int(stack[chip].argmax()), stack[chip].shape)
            each = axes[line * 4 + column]
            _draw_surface(each, stack[chip], true, (int(col) - radius, int(row) - radius))
    axes[0].set_title("alone", fontsize=9, loc="left")
    axes[4].set_title("with neighbours", fontsize=9, loc="left")
    return figure


def features(scenes: Scenes) -> Figure:
    """Keypoints of SIFT on a radar image, by octave."""
    values = _band(scenes.speckled() / "reference.tif")[20:110, 60:180]
    window = Patch(values.astype(np.float32), np.ones(values.shape, bool))
    figure, axes = _canvas(5.8, 2.5, 2)
    for each, name in zip(axes, ("sift", "sift-oct"), strict=True):
        found = sift_detector(name).detect(window)
        first = found.octave < 0
        each.imshow(_stretched(np.log(values + 1.0)), cmap="gray")
        for chosen, colour in ((first, ORANGE), (~first, BLUE)):
            for (col, row), scale in zip(
                found.position_px[chosen], found.scale_px[chosen], strict=True
            ):
                each.add_patch(Circle((col, row), 2 * scale, fill=False, color=colour, lw=0.9))
        each.set_title(f"{name}: {len(first)} keypoints", fontsize=9)
    return figure


def hog(scenes: Scenes) -> Figure:
    """One patch in red and near infrared, and the histograms of their directions."""
    row, col = 88, 76
    patches = [
        _band(scenes.rural() / "input.tif", number)[row - 20 : row + 21, col - 20 : col + 21]
        for number in (3, 4)
    ]
    figure, axes = _canvas(8, 2.3, 4)
    for number, (patch, name) in enumerate(zip(patches, ("red", "near infrared"), strict=True)):
        axes[2 * number].imshow(_stretched(patch), cmap="gray")
        axes[2 * number].set_title(name, fontsize=9)
        _draw_histograms(axes[2 * number + 1], _histograms(patch.astype(np.float64)))
    return figure


def masks(scenes: Scenes) -> Figure:
    """A radar image of a city, and two masks of it."""
    radar = scenes.city() / "reference.tif"
    figure, axes = _canvas(8, 2.85, 3)
    window = np.s_[90:310:2, 90:310:2]
    power = cv2.blur(_band(radar) ** 2, (3, 3))
    grey = _stretched(np.log(power + 1.0))[window]
    axes[0].imshow(grey, cmap="gray")
    axes[0].set_title("radar image", fontsize=9)
    for each, tool, name in (
        (axes[1], groundtie.mask_threshold, "threshold"),
        (axes[2], groundtie.mask_regions, "regions"),
    ):
        path = scenes.folder / f"{name}.tif"
        tool(radar, path)
        taken = _band(path)
        colours = np.repeat(grey[:, :, None], 3, axis=2) * 0.75
        colours[taken[window] == 0] = (0.84, 0.37, 0.0)
        each.imshow(colours)
        each.set_title(f"{name}: {np.mean(taken > 0):.0%} take part", fontsize=9)
    return figure


def rotation(scenes: Scenes) -> Figure:
    """Height of the best shift over rotation, and the images under the pose found."""
    angle_deg = 40.0
    reference = _reduced(np.log(_band(scenes.rural() / "reference.tif") + 1.0))
    upright = _reduced(_band(scenes.rural() / "input.tif", 3)[:500, :500])
    rotated = _rotated(upright, angle_deg)
    steps = np.arange(-180.0, 180.0, 2.0)
    heights = [_best_height(reference, _rotated(rotated, -step)) for step in steps]
    figure, axes = _canvas(8, 2.9, 3)
    found = float(steps[int(np.argmax(heights))])
    axes[0].plot(steps, heights, color=BLUE, linewidth=1)
    axes[0].axvline(angle_deg, color=ORANGE, linestyle=":", linewidth=1)
    axes[0].axis("on")
    axes[0].tick_params(labelsize=7)
    axes[0].set(xticks=(-180, -90, 0, 90, 180))
    axes[0].set_xlabel("rotation (°)", fontsize=8)
    axes[0].set_title("height of the best shift (σ)", fontsize=9)
    axes[1].imshow(_stretched(rotated), cmap="gray")
    axes[1].set_title(f"input, rotated by {angle_deg:.0f}°", fontsize=9)
    back = _rotated(rotated, -found)
    square = (np.indices(reference.shape) // 40).sum(axis=0) % 2 == 0
    axes[2].imshow(np.where(square, _stretched(reference), _stretched(back)), cmap="gray")
    axes[2].set_title(f"in squares, rotated back by {found:.0f}°", fontsize=9)
    return figure


def rpc(scenes: Scenes) -> Figure:
    """Errors at check points before and after the refinement of RPCs."""
    folder, refined = scenes.sensor(), scenes.folder / "refined_RPC.TXT"
    table = scenes.folder / "errors.csv"
    heights: dict[str, Any] = {"dem": folder / "dem.tif", "dem_datum": "ellipsoidal"}
    groundtie.refine_rpc(
        folder / "sensor.tif", refined, reference=folder / "reference.tif", search_radius=50,
        **heights,
    )  # fmt: skip
    groundtie.assess_sensor(
        folder / "sensor.tif", folder / "check_points.csv", refined=refined, table=table, **heights
    )
    rows = _rows(table)[::2]
    position = _columns(rows, "col", "row")
    figure, axes = _canvas(8, 3.8, 2)
    for each, name, colour, length in (
        (axes[0], "before", ORANGE, 40.0),
        (axes[1], "after", BLUE, 0.5),
    ):
        error = _columns(rows, f"{name}_col_px", f"{name}_row_px")
        arrows = _arrows(each, position, error, 60 / length, colour)
        each.quiverkey(
            arrows, 0.86, 1.03, 60, f"{length:g} px", labelpos="W", fontproperties={"size": 8}
        )
        rmse = float(np.sqrt((error**2).sum(axis=1).mean()))
        each.set_title(f"{name}: RMSE {rmse:.2f} px", fontsize=9, loc="left")
        each.set(xlim=(-30, 670), ylim=(670, -30))
        _framed(each)
    return figure


def verdict(_: Scenes) -> Figure:
    """The held-out layout, and how likely agreement by chance is."""
    figure, axes = _canvas(8, 3.3, 2)
    share, chip, check = 0.6, 0.38, 0.54
    for col, row in np.ndindex(4, 4):
        for side, colour, filled in ((share, "#fbe3d2", True), (check, ORANGE, False)):
            corner = (col + (1 - side) / 2, row + (1 - side) / 2)
            axes[0].add_patch(Rectangle(corner, side, side, color=colour, fill=filled))
        axes[0].plot(col + 0.5, row + 0.5, "s", color=ORANGE, markersize=3)
    lines = np.arange(17) / 4
    fit = np.array([(x, y) for x in lines for y in lines if x % 1 == 0 or y % 1 == 0])
    axes[0].plot(*fit.T, ".", color=BLUE, markersize=4)
    for x, y in ((1, 1.5), (2.25, 3)):
        axes[0].add_patch(
            Rectangle((x - chip / 2, y - chip / 2), chip, chip, fill=False, color=BLUE)
        )
    axes[0].set(xlim=(-0.3, 4.3), ylim=(4.3, -0.3))
    axes[0].set_aspect("equal")
    axes[0].set_title("held-out blocks, check chips, chips of the fit", fontsize=9)
    count = np.arange(1, 17)
    for radius, colour in ((12, BLUE), (24, GREEN)):
        probability = agreement_probability(2.0, radius)
        log10 = [log10_chance(int(k), 16, probability) for k in count]
        axes[1].plot(count, log10, "o-", color=colour, markersize=3, label=f"± {radius} px")
    axes[1].axhline(-3, color=ORANGE, linewidth=1)
    axes[1].text(16, -2.6, "refused above", color=ORANGE, fontsize=8, ha="right")
    axes[1].axis("on")
    axes[1].tick_params(labelsize=7)
    axes[1].set(ylim=(-20, 0.5), xlim=(0.5, 16.5))
    axes[1].set_xlabel("check points that agree, of 16", fontsize=8)
    axes[1].set_title("log₁₀ of the probability by chance", fontsize=9)
    axes[1].legend(title="search window", fontsize=7, title_fontsize=7, loc="lower left")
    return figure


def survey(scenes: Scenes) -> Figure:
    """Chips of an image of which a part lies off, and content that two images share."""
    figure, axes = _canvas(8, 3.6, 2)
    image = 255 * _stretched(_band(scenes.rural() / "input.tif"))
    moved = image.copy()
    moved[:, :170] = np.roll(image, (12, -9), (0, 1))[:, :170]
    found = _surveyed(image, moved)
    axes[0].imshow(moved, cmap="gray")
    confirming = np.hypot(*found.shifts_px.T) <= 2
    apart = np.hypot(*(found.shifts_px - found.parts[0].shift_px).T) <= 2
    for chosen, colour in ((confirming, BLUE), (apart, ORANGE), (~confirming & ~apart, GREY)):
        axes[0].plot(*found.centres[chosen].T, ".", color=colour, markersize=5)
        _arrows(axes[0], found.centres[chosen], found.shifts_px[chosen], 2, colour)
    axes[0].set_title("the left third lies 15 px off", fontsize=9)
    other = 255 * _stretched(_band(scenes.speckled() / "input.tif"))
    places = [of[:300, :300].astype(np.uint8) for of in (image, other)]
    for place in places:
        for at in (60, 150, 240):
            cv2.line(place, (0, at), (299, at - 20), 255.0, 3)
            cv2.putText(place, "ROAD", (at - 40, at + 30), cv2.FONT_HERSHEY_PLAIN, 1.6, 255.0, 2)
    patches = [Patch(place.astype(np.float32), np.ones(place.shape, bool)) for place in places]
    axes[1].imshow(np.hstack(places), cmap="gray")
    same = np.hstack([same_windows(patches[0], patches[1])] * 2)
    axes[1].imshow(np.where(same, 1.0, np.nan), cmap="autumn", alpha=0.5)
    axes[1].set_title("two places, the same drawing", fontsize=9)
    return figure


def _surveyed(reference: FloatArray, input: FloatArray) -> Survey:
    """Survey two arrays of one place around no shift at all."""
    rasters = [
        Raster(image.astype(np.float32), Affine(1, 0, 0, 0, -1, 0), "EPSG:32633")
        for image in (reference, input)
    ]
    with open_raster(rasters[0]) as one, open_raster(rasters[1]) as other, threads() as context:
        matcher = ChipMatcher(make_pair(PairImage(one), PairImage(other)), SimilaritySettings())
        none = PolynomialModel("translation", Frame(Affine.identity()), np.zeros((1, 2)))
        return survey_model(matcher, none, context)


DRAWN: Mapping[str, Callable[[Scenes], Figure]] = {
    "architecture": pipeline,
    "method-similarity": similarity,
    "method-search": search,
    "method-belief-propagation": propagation,
    "method-features": features,
    "method-hog": hog,
    "method-masks": masks,
    "method-rotation": rotation,
    "method-rpc": rpc,
    "method-survey": survey,
    "method-verdict": verdict,
}


def _canvas(width: float, height: float, count: int, rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure and its axes, without ticks, row by row."""
    figure = Figure(figsize=(width, height), dpi=100, layout="tight")
    axes = [figure.add_subplot(rows, count // rows, k + 1) for k in range(count)]
    for each in axes:
        each.axis("off")
    return figure, axes


def _framed(axes: Axes) -> None:
    axes.axis("on")
    axes.set(xticks=[], yticks=[])
    axes.set_aspect("equal")


def _draw_surface(
    axes: Axes,
    values: FloatArray,
    true_px: tuple[float, float],
    peak_px: tuple[float, float] | None = None,
) -> None:
    """Draw a surface over shifts; the true shift as a cross, the peak as a circle."""
    radius = values.shape[0] // 2
    extent = (-radius - 0.5, radius + 0.5, radius + 0.5, -radius - 0.5)
    low, high = np.quantile(values, 0.02), values.max()
    axes.imshow(values, cmap="gray", extent=extent, vmin=float(low), vmax=float(high))
    axes.plot(*true_px, "+", color=BLUE, markersize=14, markeredgewidth=1.5)
    if peak_px is not None:
        axes.add_patch(Circle(peak_px, 0.09 * radius, fill=False, color=ORANGE, linewidth=1.5))
    axes.set(xlim=extent[:2], ylim=extent[2:])


def _draw_displacements(axes: Axes, pair: Path, points: Path) -> None:
    """Draw by how much tie points and check points are displaced, five times as long."""
    rows = [row for row in _rows(points) if row["state"] == "used"]
    with rasterio.open(pair / "reference.tif") as source:
        to_pixel, bounds = ~source.transform, (source.width, source.height)
    with rasterio.open(pair / "input.tif") as source:
        nominal = source.transform
    for role, colour, name in (("fit", BLUE, "tie points"), ("check", ORANGE, "check points")):
        chosen = [row for row in rows if row["role"] == role]
        position = np.array(
            [to_pixel @ xy for xy in _columns(chosen, "reference_x", "reference_y")]
        )
        pixels = _columns(chosen, "input_col", "input_row") + 0.5
        found = np.array([to_pixel @ (nominal @ xy) for xy in pixels])
        _arrows(axes, position, found - position, 5.0, colour)
        axes.plot([], [], color=colour, label=name)
    axes.set(xlim=(0, bounds[0]), ylim=(bounds[1], 0))
    _framed(axes)
    axes.legend(fontsize=7, loc="upper right")
    axes.set_title("displacements, five times as long", fontsize=9)


def _arrows(
    axes: Axes, position: FloatArray, vector: FloatArray, stretch: float, colour: str
) -> Any:
    return axes.quiver(
        *position.T, *(vector * stretch).T, angles="xy", scale_units="xy", scale=1, color=colour,
        width=0.005,
    )  # fmt: skip


def _draw_histograms(axes: Axes, histograms: FloatArray) -> None:
    """Draw the directions of 3 × 3 cells as bars through the cells' middles."""
    for row in range(3):
        for col in range(3):
            for number, value in enumerate(histograms[row, col]):
                angle = np.deg2rad((number + 0.5) * 20)
                reach = 0.46 * value / histograms.max()
                dx, dy = reach * np.cos(angle), reach * np.sin(angle)
                axes.plot((col - dx, col + dx), (row - dy, row + dy), color=BLUE, linewidth=1.6)
            axes.add_patch(Rectangle((col - 0.5, row - 0.5), 1, 1, fill=False, color=GREY, lw=0.6))
    axes.set(xlim=(-0.55, 2.55), ylim=(2.55, -0.55))
    axes.set_aspect("equal")
    axes.set_title("its directions", fontsize=9)


def _histograms(patch: FloatArray) -> FloatArray:
    """Return directions without sign in 3 × 3 cells, shape (3, 3, 9)."""
    smooth = cv2.GaussianBlur(patch, (0, 0), 2.0)
    down, right = np.gradient(smooth)
    number = ((np.rad2deg(np.arctan2(down, right)) % 180) // 20).astype(int)
    strength = np.hypot(right, down)
    cell = np.minimum(np.indices(patch.shape) * 3 // len(patch), 2)
    histograms = np.zeros((3, 3, 9))
    np.add.at(histograms, (cell[0], cell[1], number % 9), strength)
    return histograms


def _best_height(reference: FloatArray, other: FloatArray) -> float:
    """Return how high the best shift of two squared orientation fields is."""
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


def _true_shift_px(pair: Path, x: float | None, y: float | None) -> tuple[float, float]:
    """Return how far right and down the input's nominal position of a place is."""
    with rasterio.open(pair / "reference.tif") as source:
        pixel_m = source.transform.a
        middle = source.transform @ (source.width / 2, source.height / 2)
    with rasterio.open(pair / "input.tif") as source:
        nominal = source.transform
    xy = middle if x is None or y is None else (x, y)
    truth = groundtie.load_transform(pair / "truth.json")
    found = nominal @ (truth(np.array([xy]))[0] + 0.5)
    return (found[0] - xy[0]) / pixel_m, (xy[1] - found[1]) / pixel_m


def _highest(values: FloatArray, count: int) -> list[tuple[int, int]]:
    """Return the rows and columns of the highest separate peaks."""
    left, peaks = values.copy(), []
    for _ in range(count):
        row, col = (int(k) for k in np.unravel_index(int(left.argmax()), left.shape))
        peaks.append((row, col))
        left[max(row - 4, 0) : row + 5, max(col - 4, 0) : col + 5] = -np.inf
    return peaks


def _band(path: Path, number: int = 1) -> FloatArray:
    with rasterio.open(path) as source:
        return np.asarray(source.read(number), np.float64)


def _stretched(image: FloatArray) -> FloatArray:
    low, high = np.quantile(image, (0.02, 0.98))
    return np.asarray(np.clip((image - low) / (high - low), 0, 1))


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _columns(rows: list[dict[str, str]], *names: str) -> FloatArray:
    return np.array([[float(row[name]) for name in names] for row in rows])


def write(figure: Figure, path: Path) -> None:
    """Write a figure with few colours, which keeps it small."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", facecolor="white", bbox_inches="tight", pad_inches=0.05)
    image = Image.open(buffer).convert("RGB")
    image.quantize(palette=_palette(), dither=Image.Dither.NONE).save(path, optimize=True)


def _palette() -> Image.Image:
    """Return greys, and the colours of the figures from dark to pale, as an image's palette."""
    colours = [[level] * 3 for level in np.linspace(0, 255, _GREYS)]
    for name in (BLUE, ORANGE, GREEN):
        pure = np.array([int(name[k : k + 2], 16) for k in (1, 3, 5)])
        for share in np.linspace(0.25, 1, _BLENDS):
            colours += [list(share * pure), list(255 - share * (255 - pure))]
    image = Image.new("P", (1, 1))
    image.putpalette(np.rint(np.array(colours)).astype(np.uint8).tobytes())
    return image


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figures", type=Path, default=FIGURES, help="folder of the figures")
    parser.add_argument("names", nargs="*", help=f"of {', '.join(DRAWN)}; none: all")
    options = parser.parse_args()
    options.figures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        scenes = Scenes(Path(folder))
        for name in options.names or DRAWN:
            path = options.figures / f"{name}.png"
            write(DRAWN[name](scenes), path)
            print(f"{path}: {path.stat().st_size / 1000:.0f} kB", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
