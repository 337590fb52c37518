"""More pixel-locked content: gaps, lattices of compression and display, sensor artefacts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .overlays import OVERLAYS, Canvas, Overlay, overlay, smooth_noise
from .pairs import NODATA, Change


@dataclass(frozen=True)
class Effect:
    """A change that depends on the image content, on a lattice of the array."""

    function: Change

    def change(self) -> Change:
        """Return the change."""
        return self.function


# Effects that cannot be moved within an image.
OF_THE_ARRAY: list[str] = []

Shape = tuple[int, int]


def effect(name: str) -> Callable[[Callable[[Shape, np.random.Generator], Effect]], object]:
    """Register an effect by its name."""

    def listed(draw: Callable[[Shape, np.random.Generator], Effect]) -> object:
        OVERLAYS[name] = draw  # type: ignore[assignment]
        OF_THE_ARRAY.append(name)
        return draw

    return listed


def each_band(change: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]) -> Effect:
    """Return the effect that changes each band by itself."""
    return Effect(lambda image: np.maximum(np.stack([change(band) for band in image]), 1))


def compressed(quality: int) -> Effect:
    """Return the effect of JPEG compression at a quality."""

    def compress(band: NDArray[np.uint8]) -> NDArray[np.uint8]:
        _, code = cv2.imencode(".jpg", band, [cv2.IMWRITE_JPEG_QUALITY, quality])
        return np.asarray(cv2.imdecode(code, cv2.IMREAD_GRAYSCALE))

    return each_band(compress)


@effect("JPEG blocks")
def jpeg(shape: Shape, rng: np.random.Generator) -> Effect:
    """Compress strongly, on the same lattice of 8 by 8 pixels in both images."""
    return compressed(int(rng.integers(3, 18)))


@effect("nearest-neighbour upsampling")
def upsampled(shape: Shape, rng: np.random.Generator) -> Effect:
    """Enlarge coarse pixels by repeating them."""
    factor = float(rng.uniform(1.6, 6.0))
    coarse = tuple(round(side / factor) for side in shape[::-1])

    def enlarge(band: NDArray[np.uint8]) -> NDArray[np.uint8]:
        small = cv2.resize(band, coarse, interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.resize(small, shape[::-1], interpolation=cv2.INTER_NEAREST))

    return each_band(enlarge)


@effect("linear interpolation at a lattice")
def interpolated(shape: Shape, rng: np.random.Generator) -> Effect:
    """Blur between sharp pixels, as resampling by a factor near a whole number does."""
    period = float(rng.uniform(5, 40))
    phase = [np.cos(np.pi * np.arange(side) / period) ** 2 for side in shape]
    weight = np.maximum.outer(phase[0], phase[1])

    def soften(band: NDArray[np.uint8]) -> NDArray[np.uint8]:
        soft = cv2.GaussianBlur(band, (0, 0), 1.5)
        return np.asarray(band * weight + soft * (1 - weight)).astype(np.uint8)

    return each_band(soften)


@effect("local contrast by tiles")
def local_contrast(shape: Shape, rng: np.random.Generator) -> Effect:
    """Stretch the contrast of each tile by itself, as viewers do."""
    tiles = tuple(int(n) for n in rng.integers(2, 9, 2))

    def stretch(band: NDArray[np.uint8]) -> NDArray[np.uint8]:
        made = band.copy()
        for rows in np.array_split(np.arange(shape[0]), tiles[0]):
            for columns in np.array_split(np.arange(shape[1]), tiles[1]):
                tile = np.ix_(rows, columns)
                low, high = np.percentile(band[tile], (2, 98))
                scaled = (band[tile].astype(float) - low) / max(high - low, 1)
                made[tile] = np.clip(1 + 254 * scaled, 1, 255)
        return made

    return each_band(stretch)


@effect("posterised")
def posterised(shape: Shape, rng: np.random.Generator) -> Effect:
    """Keep a few grey levels that are equally frequent."""
    levels = int(rng.integers(2, 6))

    def reduce(band: NDArray[np.uint8]) -> NDArray[np.uint8]:
        edges = np.quantile(band, np.arange(1, levels) / levels)
        return np.asarray(1 + np.digitize(band, edges) * (254 // (levels - 1))).astype(np.uint8)

    return each_band(reduce)


def _gaps(holes: NDArray[np.bool_], value: int) -> Effect:
    return Effect(lambda image: np.where(holes, value, image).astype(np.uint8))


@effect("nodata frame or wedge")
def nodata_wedge(shape: Shape, rng: np.random.Generator) -> Effect:
    """Cut the same wedges or frames out of both images, as nodata, black or white."""
    rows, columns = np.indices(shape)
    holes = np.zeros(shape, bool)
    for _ in range(int(rng.integers(1, 5))):
        angle = rng.uniform(0, 2 * np.pi)
        across = (columns / shape[1] - 0.5) * np.cos(angle) + (rows / shape[0] - 0.5) * np.sin(
            angle
        )
        holes |= across > rng.uniform(0.2, 0.4)
    return _gaps(holes, int(rng.choice([NODATA, 1, 255])))


@effect("irregular nodata")
def irregular_nodata(shape: Shape, rng: np.random.Generator) -> Effect:
    """Cut the same irregular holes out of both images, like those of a cloud mask."""
    noise = smooth_noise(shape, float(rng.uniform(5, 25)), rng)
    holes = noise > np.quantile(noise, rng.uniform(0.5, 0.85))
    return _gaps(holes, int(rng.choice([NODATA, NODATA, 1, 255])))


@effect("gaps between scans")
def scan_gaps(shape: Shape, rng: np.random.Generator) -> Effect:
    """Leave wedge-shaped gaps between scans, as Landsat 7 does."""
    rows, columns = np.indices(shape)
    period, slope = rng.uniform(14, 40), rng.uniform(-0.3, 0.3)
    width = 0.55 * np.abs(columns / shape[1] - rng.uniform(0, 1))
    holes = ((rows + slope * columns) / period) % 1 < width
    return _gaps(holes, int(rng.choice([NODATA, 1])))


@overlay("vignetting")
def vignetting(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Darken towards the corners."""
    rows, columns = np.indices(shape)
    centre = np.array(shape) * rng.uniform(0.4, 0.6, 2)
    away = np.hypot(rows - centre[0], columns - centre[1]) / max(shape)
    return Overlay(np.zeros(shape), np.zeros(shape), np.clip(1 - 1.6 * away**2, 0.1, 1))


@overlay("stripes")
def stripes(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Add detector stripes, regular or irregular, along columns or rows."""
    period = float(rng.uniform(3, 20))
    at = np.arange(shape[1])
    regular = np.sign(np.sin(2 * np.pi * at / period))
    irregular = np.repeat(rng.normal(size=shape[1]), int(rng.integers(1, 6)))[: shape[1]]
    stripe = rng.uniform(10, 50) * (regular if rng.random() < 0.5 else irregular)
    layer = np.broadcast_to(stripe, shape).copy()
    if rng.random() < 0.5:
        layer = np.broadcast_to(np.resize(stripe, shape[0])[:, None], shape).copy()
    return Overlay(np.zeros(shape), np.zeros(shape), 1.0, layer)


@overlay("compass, scale bar and legend")
def furniture(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Add a compass, a scale bar and a legend."""
    canvas = Canvas(shape)
    rows, columns = shape
    at = np.array([columns - 45, 45])
    for turn in np.arange(0, 2 * np.pi, np.pi / 4):
        reach = 36 if (turn / (np.pi / 4)) % 2 == 0 else 20
        canvas.line(np.array([at, at + reach * np.array([np.sin(turn), np.cos(turn)])]), 255, 3)
    canvas.text("N", (columns - 52, 20), 0, 0.7, 1)
    for part in range(6):
        canvas.box((12 + 25 * part, rows - 20), (37 + 25 * part, rows - 10), 255 * (part % 2))
    canvas.text("0   50  100 m", (12, rows - 26), 255, 0.45, 1)
    canvas.box((8, 8), (108, int(rng.integers(60, 180))), 250)
    for line in range(int(rng.integers(3, 9))):
        canvas.box((14, 16 + 17 * line), (30, 26 + 17 * line), int(rng.integers(0, 200)))
        canvas.text("class", (36, 26 + 17 * line), 0, 0.4, 0)
    return canvas.overlay()


@overlay("dust on the lens")
def dust(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Add dark rings and spots with soft edges."""
    rows, columns = np.indices(shape)
    gain = np.ones(shape)
    for _ in range(int(rng.integers(15, 60))):
        centre, radius = rng.uniform(0, shape), rng.uniform(3, 18)
        away = np.hypot(rows - centre[0], columns - centre[1])
        gain *= 1 - rng.uniform(0.2, 0.8) * np.exp(-0.5 * ((away - radius / 2) / (radius / 3)) ** 2)
    return Overlay(np.zeros(shape), np.zeros(shape), gain)


@overlay("snow of one shape")
def snow_cover(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Cover a part with snow of one shape with sharp edges."""
    noise = smooth_noise(shape, float(rng.uniform(8, 30)), rng) + 0.4 * smooth_noise(shape, 3, rng)
    cover = noise > np.quantile(noise, 1 - rng.uniform(0.3, 0.6))
    return Overlay(230 + 8 * rng.normal(size=shape), cover * rng.uniform(0.7, 1.0))


@overlay("parcel boundaries")
def parcels(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Draw a cadastre: irregular polygons over the whole image."""
    seeds = rng.uniform(0, shape, (int(rng.integers(40, 200)), 2))
    _, nearest = cKDTree(seeds).query(np.moveaxis(np.indices(shape), 0, -1))
    cell = nearest.astype(np.float32)
    edge = cv2.dilate(cell, np.ones((2, 2))) != cv2.erode(cell, np.ones((2, 2)))
    return Overlay(np.full(shape, float(rng.choice([0, 255]))), edge * rng.uniform(0.6, 1.0))


@overlay("contour lines")
def contours(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Draw contour lines of hills that do not belong to the scene."""
    hills = 6 * smooth_noise(shape, float(rng.uniform(20, 50)), rng)
    steps = np.floor(hills).astype(np.float32)
    edge = cv2.dilate(steps, np.ones((2, 2))) != steps
    return Overlay(np.full(shape, float(rng.choice([10, 250]))), edge * rng.uniform(0.6, 1.0))


@overlay("crosses and dots")
def crosses(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Draw the crosses of a réseau plate, or scattered measured points."""
    canvas = Canvas(shape)
    regular, step = rng.random() < 0.5, int(rng.integers(35, 80))
    lattice = np.stack(np.meshgrid(*(np.arange(step // 2, s, step) for s in shape[::-1])), -1)
    places = lattice.reshape(-1, 2) + (
        0 if regular else rng.integers(-20, 21, (lattice.size // 2, 2))
    )
    grey = int(rng.choice([0, 255]))
    for at in places:
        for reach in ((6, 0), (0, 6)):
            canvas.line(np.array([at - reach, at + reach]), grey, 1 + int(not regular))
    return canvas.overlay()


@overlay("dead columns and pixels")
def dead_pixels(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Set single columns, pixels and clusters of pixels to the largest or least value."""
    alpha = (rng.random(shape) < rng.uniform(0.002, 0.03)).astype(float)
    alpha = np.maximum(
        alpha, cv2.dilate((rng.random(shape) < 0.0005).astype(float), np.ones((4, 4)))
    )
    alpha[:, rng.random(shape[1]) < 0.03] = 1
    return Overlay(255.0 * (rng.random(shape) < 0.5), alpha)


@overlay("hatched areas")
def hatched(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Hatch or tint polygons, as planning maps do."""
    rows, columns = np.indices(shape)
    areas = smooth_noise(shape, float(rng.uniform(18, 45)), rng) > 0.3
    period = float(rng.uniform(5, 14))
    hatch = ((rows + columns) / period) % 1 < 0.3
    edge = cv2.dilate(areas.astype(np.uint8), np.ones((3, 3))) != areas
    tint = rng.uniform(0.1, 0.5)
    alpha = np.maximum(areas * np.where(hatch, 0.9, tint), edge)
    return Overlay(np.full(shape, float(rng.choice([20, 240]))), alpha)
