"""Figures on the image content that is matched: keypoints, gradient directions, masks."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

import groundtie
from groundtie.features.scale_space import FIRST_SCALE_PX
from groundtie.masks.open_ground import OpenGround
from groundtie.masks.scene import Scene
from groundtie.masks.surface_model import Reason
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster
from groundtie.studies.sift_variants import sift_detector
from scripts.drawing import BLUE, GREY, ORANGE, FloatArray, Scenes, canvas, read_band, stretched


def features(scenes: Scenes) -> Figure:
    """SIFT keypoints on a radar image, by octave."""
    values = read_band(scenes.speckled() / "reference.tif")[20:110, 60:180]
    window = Patch(values.astype(np.float32), np.ones(values.shape, bool))
    figure, axes = canvas(5.8, 2.5, 2)
    for each, name in zip(axes, ("sift", "sift-oct"), strict=True):
        found = sift_detector(name).detect(window)
        # The first octave ends half a layer below the first layer at the original image size.
        first = found.scale_px < FIRST_SCALE_PX * 2 ** (1 / 6)
        each.imshow(stretched(np.log(values + 1.0)), cmap="gray")
        for chosen, colour in ((first, ORANGE), (~first, BLUE)):
            for (col, row), scale in zip(
                found.position_px[chosen], found.scale_px[chosen], strict=True
            ):
                each.add_patch(Circle((col, row), 2 * scale, fill=False, color=colour, lw=0.9))
        each.set_title(f"{name}: {len(first)} keypoints", fontsize=9)
    return figure


def hog(scenes: Scenes) -> Figure:
    """One patch in red and near infrared, and its histograms of gradient directions."""
    row, col = 88, 76
    patches = [
        read_band(scenes.rural() / "input.tif", number)[row - 20 : row + 21, col - 20 : col + 21]
        for number in (3, 4)
    ]
    figure, axes = canvas(8, 2.3, 4)
    for number, (patch, name) in enumerate(zip(patches, ("red", "near infrared"), strict=True)):
        axes[2 * number].imshow(stretched(patch), cmap="gray")
        axes[2 * number].set_title(name, fontsize=9)
        _draw_histograms(axes[2 * number + 1], _histograms(patch.astype(np.float64)))
    return figure


def masks(scenes: Scenes) -> Figure:
    """A radar image of a city, two masks of it, and open ground in a rural scene."""
    radar = scenes.large_city() / "reference.tif"
    figure, axes = canvas(8, 2.3, 4)
    window = np.s_[120:420:2, 200:500:2]
    grey = _radar_grey(radar)[window]
    axes[0].imshow(grey, cmap="gray")
    axes[0].set_title("radar image", fontsize=9)
    for each, tool, name in (
        (axes[1], groundtie.mask_threshold, "threshold"),
        (axes[2], groundtie.mask_ground, "ground"),
    ):
        path = scenes.folder / f"{name}.tif"
        tool(radar, path)
        taken = read_band(path) > 0
        _draw_mask(each, grey, taken[window], f"{name}: {taken.mean():.0%}")
    country = scenes.rural() / "reference.tif"
    with open_raster(country) as source:
        ground = OpenGround.of(Scene.of(source))
        taken = ground.select(ground.scene.whole).part
    third = np.s_[::3, ::3]
    _draw_mask(
        axes[3], _radar_grey(country)[third], taken[third], f"open ground: {taken.mean():.0%}"
    )
    return figure


def _radar_grey(path: Path) -> FloatArray:
    return stretched(np.log(cv2.blur(read_band(path) ** 2, (3, 3)) + 1.0))


def _draw_mask(axes: Axes, grey: FloatArray, taken: NDArray[np.bool_], title: str) -> None:
    colours = np.repeat(grey[:, :, None], 3, axis=2) * 0.75
    colours[~taken] = (0.84, 0.37, 0.0)
    axes.imshow(colours)
    axes.set_title(title, fontsize=9)


def surface_model(scenes: Scenes) -> Figure:
    """Parts of a city's ground that radar and camera do not show, by its surface model."""
    folder, window = scenes.city(), np.s_[90:310:2, 90:310:2]
    files = [scenes.folder / f"{name}.tif" for name in ("surface", "reasons", "aligned")]
    radar, camera = folder / "reference.tif", folder / "input.tif"
    groundtie.mask_surface(
        radar,
        folder / "dsm.tif",
        files[0],
        reasons=files[1],
        views=f"; {folder / 'input.json'}",
    )
    groundtie.warp(camera, files[2], transform=folder / "truth.json", reference=radar)
    taken, why, seen = (read_band(path)[window] for path in files)
    power = cv2.blur(read_band(radar) ** 2, (3, 3))
    greys = stretched(np.log(power + 1.0))[window], stretched(seen)
    shown = greys[0], greys[0], greys[1], greys[1] * taken
    tints = (
        (),
        ((Reason.RADAR_SHADOW, (0.0, 0.45, 0.7)), (Reason.LAYOVER, (0.84, 0.37, 0.0))),
        ((Reason.CAST_SHADOW, (0.0, 0.45, 0.7)), (Reason.HIDDEN, (0.84, 0.37, 0.0))),
        (),
    )
    titles = (
        "radar image",
        "layover, radar shadow",
        "hidden, cast shadow",
        f"{np.mean(taken > 0):.0%} take part",
    )
    figure, axes = canvas(8, 2.3, 4)
    for each, grey, tint, title in zip(axes, shown, tints, titles, strict=True):
        colours = np.repeat(grey[:, :, None], 3, axis=2)
        for reason, colour in tint:
            chosen = (why.astype(int) & reason) > 0
            colours[chosen] = 0.4 * colours[chosen] + 0.6 * np.array(colour)
        each.imshow(colours)
        each.set_title(title, fontsize=9)
    return figure


def _draw_histograms(axes: Axes, histograms: FloatArray) -> None:
    """Draw the directions of 3 × 3 cells as bars through the cell centres."""
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
    """Return histograms of unsigned directions in 3 × 3 cells, shape (3, 3, 9)."""
    smooth = cv2.GaussianBlur(patch, (0, 0), 2.0)
    down, right = np.gradient(smooth)
    number = ((np.rad2deg(np.arctan2(down, right)) % 180) // 20).astype(int)
    strength = np.hypot(right, down)
    cell = np.minimum(np.indices(patch.shape) * 3 // len(patch), 2)
    histograms = np.zeros((3, 3, 9))
    np.add.at(histograms, (cell[0], cell[1], number % 9), strength)
    return histograms
