"""Figures on the pipeline, its checks, and RPCs."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from affine import Affine
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

import groundtie
from groundtie.arrays import Raster
from groundtie.context import threads
from groundtie.geometry.chance import agreement_probability, log10_chance
from groundtie.geometry.judging import LARGEST_LOG10_CHANCE
from groundtie.geometry.models import shift_model
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.parts import ELSEWHERE_PX
from groundtie.matching.survey import SURVEY_RADIUS_PX, Survey, survey_model, survey_places
from groundtie.rasters.pair import Image as PairImage
from groundtie.rasters.pair import make_pair
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster
from groundtie.similarity.sameness import Windows
from groundtie.similarity.surface import SimilaritySettings
from scripts.drawing import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    FloatArray,
    Scenes,
    canvas,
    columns,
    draw_arrows,
    framed,
    read_band,
    read_rows,
    stretched,
)


def pipeline(_: Scenes) -> Figure:
    """The stages of a registration and the data that flow between them."""
    stages = (
        ("inspect", "what the images are", "SceneInfo"),
        ("mask", "what takes part", "masks"),
        ("coarse", "shift or pose,\nmodel by levels", "coarse model"),
        ("match", "chips, pooled\nhistograms, keypoints", "correspondences"),
        ("fit", "model choice,\nrobust", "transform"),
        ("check", "held-out points", "check points"),
        ("rules", "one list,\neach names itself", "verdict"),
    )
    figure, (axes,) = canvas(9.6, 2.7, 1)
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
    rows = read_rows(table)[::2]
    position = columns(rows, "col", "row")
    figure, axes = canvas(8, 3.8, 2)
    for each, name, colour, length in (
        (axes[0], "before", ORANGE, 40.0),
        (axes[1], "after", BLUE, 0.5),
    ):
        error = columns(rows, f"{name}_col_px", f"{name}_row_px")
        arrows = draw_arrows(each, position, error, 60 / length, colour)
        each.quiverkey(
            arrows, 0.86, 1.03, 60, f"{length:g} px", labelpos="W", fontproperties={"size": 8}
        )
        rmse = float(np.sqrt((error**2).sum(axis=1).mean()))
        each.set_title(f"{name}: RMSE {rmse:.2f} px", fontsize=9, loc="left")
        each.set(xlim=(-30, 670), ylim=(670, -30))
        framed(each)
    return figure


def verdict(_: Scenes) -> Figure:
    """The layout of held-out check points, and the probability of agreement by chance."""
    figure, axes = canvas(8, 3.3, 2)
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
    limit = LARGEST_LOG10_CHANCE
    axes[1].axhline(limit, color=ORANGE, linewidth=1)
    axes[1].text(16, limit + 0.4, "refused above", color=ORANGE, fontsize=8, ha="right")
    axes[1].axis("on")
    axes[1].tick_params(labelsize=7)
    axes[1].set(ylim=(-20, 0.5), xlim=(0.5, 16.5))
    axes[1].set_xlabel("check points that agree, of 16", fontsize=8)
    axes[1].set_title("log₁₀ of the probability by chance", fontsize=9)
    axes[1].legend(title="search window", fontsize=7, title_fontsize=7, loc="lower left")
    return figure


def survey(scenes: Scenes) -> Figure:
    """Chips of an image with a displaced part, and an overlay in both images."""
    figure, axes = canvas(8, 3.6, 2)
    image = 255 * stretched(read_band(scenes.rural() / "input.tif"))
    moved = image.copy()
    moved[:, :170] = np.roll(image, (12, -9), (0, 1))[:, :170]
    found = _surveyed(image, moved)
    axes[0].imshow(moved, cmap="gray")
    confirming = np.hypot(*found.shifts_px.T) <= 2
    apart = np.hypot(*(found.shifts_px - found.parts[0].shift_px).T) <= 2
    for chosen, colour in ((confirming, BLUE), (apart, ORANGE), (~confirming & ~apart, GREY)):
        axes[0].plot(*found.centres[chosen].T, ".", color=colour, markersize=5)
        draw_arrows(axes[0], found.centres[chosen], found.shifts_px[chosen], 2, colour)
    axes[0].set_title("the left third lies 15 px off", fontsize=9)
    other = 255 * stretched(read_band(scenes.speckled() / "input.tif"))
    places = [of[:300, :300].astype(np.uint8) for of in (image, other)]
    for place in places:
        for at in (60, 150, 240):
            cv2.line(place, (0, at), (299, at - 20), 255.0, 3)
            cv2.putText(place, "ROAD", (at - 40, at + 30), cv2.FONT_HERSHEY_PLAIN, 1.6, 255.0, 2)
    patches = [Patch(place.astype(np.float32), np.ones(place.shape, bool)) for place in places]
    axes[1].imshow(np.hstack(places), cmap="gray")
    same = np.hstack([Windows.of(patches[0], patches[1]).same] * 2)
    axes[1].imshow(np.where(same, 1.0, np.nan), cmap="autumn", alpha=0.5)
    axes[1].set_title("two places, the same drawing", fontsize=9)
    return figure


def _surveyed(reference: FloatArray, input: FloatArray) -> Survey:
    """Survey two arrays of the same ground about shift 0."""
    rasters = [
        Raster(image.astype(np.float32), Affine(1, 0, 0, 0, -1, 0), "EPSG:32633")
        for image in (reference, input)
    ]
    with open_raster(rasters[0]) as one, open_raster(rasters[1]) as other, threads() as context:
        matcher = ChipMatcher(make_pair(PairImage(one), PairImage(other)), SimilaritySettings())
        places = survey_places(matcher.pair.grid)
        images = matcher.resampled(shift_model(0.0, 0.0), places.grid, SURVEY_RADIUS_PX, context)
        return survey_model(matcher, images, places, ELSEWHERE_PX, context)
