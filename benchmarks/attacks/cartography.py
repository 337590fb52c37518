"""More pixel-locked content: overlays of maps, viewers and prints."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .effects import Effect, Shape, each_band, effect
from .overlays import Canvas, Overlay, overlay, smooth_noise


@overlay("building outlines")
def buildings(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Draw the outlines of houses along streets, as on a town map."""
    canvas = Canvas(shape)
    turn, step = rng.uniform(0, np.pi / 2), rng.uniform(18, 34)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    reach = int(np.hypot(*shape) / step)
    for row in range(-reach, reach):
        for column in range(-reach, reach):
            if rng.random() < 0.35:
                continue
            first = np.array([column, row]) * step + rng.uniform(-4, 4, 2)
            size = rng.uniform(0.35, 0.7, 2) * step
            corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) * size + first
            canvas.line(corners @ axes + np.array(shape[::-1]) / 2, 240, 2)
    return canvas.overlay(float(rng.uniform(0.6, 1.0)))


@overlay("tracks and pins")
def tracks(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Draw a few thick tracks of a GNSS receiver, and pins."""
    canvas = Canvas(shape)
    for _ in range(int(rng.integers(2, 6))):
        steps = smooth_noise((200, 1), 12, rng)[:, 0] * 0.25
        heading = np.cumsum(steps) + rng.uniform(0, 2 * np.pi)
        path = 5 * np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
        canvas.line(path + rng.uniform(0.1, 0.9, 2) * shape[::-1], 255, int(rng.integers(4, 9)))
    for _ in range(int(rng.integers(4, 16))):
        at = rng.uniform(0.05, 0.95, 2) * shape[::-1]
        canvas.line(np.array([at, at - [0, 12]]), 30, 4)
        canvas.box(*(tuple(int(n) for n in at + d) for d in ([-7, -24], [7, -12])), 200)
    return canvas.overlay()


@overlay("viewer's window")
def window(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Put a viewer's panels, buttons and text around and over the image."""
    canvas = Canvas(shape)
    rows, columns = shape
    side = int(rng.uniform(0.12, 0.3) * columns)
    canvas.box((0, 0), (side, rows), 235)
    canvas.box((0, 0), (columns, 22), 50)
    for line in range(36, rows - 6, 17):
        width = int(rng.uniform(0.3, 0.9) * side)
        canvas.box((8, line), (8 + width, line + 7), int(rng.integers(40, 160)))
    for button in range(4):
        top = 40 + 34 * button
        canvas.box((columns - 34, top), (columns - 8, top + 26), 250)
        canvas.text("+-ox"[button], (columns - 28, top + 19), 20, 0.6, 0)
    return canvas.overlay()


@overlay("lines of text")
def text(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Write many lines of text over a part of the image."""
    canvas = Canvas(shape)
    first, grey = int(rng.uniform(0.0, 0.4) * shape[0]), int(rng.choice([0, 255]))
    for line in range(first + 14, first + int(0.55 * shape[0]), int(rng.integers(15, 26))):
        words = " ".join(rng.choice(["orbit", "1234", "pass", "UTC", "sensor", "no. 7"], 14))
        canvas.text(words, (6, line), grey, 0.42, 0)
    return canvas.overlay(float(rng.uniform(0.6, 1.0)))


@overlay("heat map")
def heat_map(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Tint the image with stepped blobs, as a heat map does."""
    heat = smooth_noise(shape, float(rng.uniform(12, 35)), rng)
    steps = np.floor(heat * rng.uniform(1, 3))
    alpha = np.where(steps > 0, rng.uniform(0.25, 0.6), 0.0)
    return Overlay(np.clip(80 + 45 * steps, 0, 255), alpha)


@overlay("shaded relief")
def shaded_relief(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Lay the shaded relief of rugged terrain over the image, as in web maps."""
    heights = sum(size * smooth_noise(shape, size, rng) for size in (3.0, 6.0, 12.0, 24.0))
    down, right = np.gradient(np.asarray(heights) * rng.uniform(0.5, 1.0))
    azimuth, height = np.deg2rad([rng.uniform(0, 360), 45.0])
    toward = np.cos(height) * (right * np.cos(azimuth) + down * np.sin(azimuth))
    shade = (np.sin(height) + toward) / np.sqrt(1 + right**2 + down**2)
    opacity = np.full(shape, rng.uniform(0.3, 0.55))
    return Overlay(255 * np.clip(shade, 0, 1), opacity)


@overlay("areas of a map")
def areas(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Tint areas with one value each, as a choropleth map does."""
    count = int(shape[0] * shape[1] / rng.uniform(30, 70) ** 2) + 4
    towns = rng.uniform(0, 1, (count, 2)) * shape
    pixels = np.stack(np.indices(shape), axis=-1).reshape(-1, 2)
    bent = pixels + 5 * np.stack([smooth_noise(shape, 9.0, rng).ravel() for _ in "yx"], axis=-1)
    nearest = cKDTree(towns).query(bent)[1].reshape(shape)
    tint = rng.choice([40.0, 90.0, 140.0, 190.0, 240.0], count)[nearest]
    return Overlay(tint, np.full(shape, rng.uniform(0.35, 0.55)))


@overlay("screen of a print")
def halftone(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Print the image with a halftone screen."""
    rows, columns = np.indices(shape)
    period, turn = rng.uniform(3.5, 9), rng.uniform(0, np.pi / 2)
    along = rows * np.cos(turn) + columns * np.sin(turn)
    across = columns * np.cos(turn) - rows * np.sin(turn)
    wave = np.cos(2 * np.pi * along / period) + np.cos(2 * np.pi * across / period)
    return Overlay(np.zeros(shape), np.zeros(shape), 1 + rng.uniform(0.1, 0.3) * wave, 12 * wave)


@overlay("gaps between tiles")
def tile_gaps(shape: Shape, rng: np.random.Generator) -> Overlay:
    """Leave thin lines between the tiles of a web map, and blank unloaded tiles."""
    canvas = Canvas(shape)
    side, grey = int(rng.choice([64, 64, 128])), int(rng.choice([1, 200, 255]))
    origin = rng.integers(0, side, 2)
    for top in range(int(origin[0]) - side, shape[0], side):
        for left in range(int(origin[1]) - side, shape[1], side):
            if rng.random() < 0.15:
                canvas.box((left, top), (left + side, top + side), grey)
    for axis in (0, 1):
        for at in range(int(origin[axis]), shape[axis], side):
            ends = [[0, at], [shape[1], at]] if axis == 0 else [[at, 0], [at, shape[0]]]
            canvas.line(np.array(ends), grey, int(rng.integers(1, 3)))
    return canvas.overlay()


@effect("tiles of lower resolution")
def coarse_tiles(shape: Shape, rng: np.random.Generator) -> Effect:
    """Blur the same tiles in both images, as if their finer level had not been loaded."""
    side, size = int(rng.choice([32, 64])), float(rng.uniform(2, 6))
    late = rng.random((40, 40)) < rng.uniform(0.3, 0.6)
    tile = late[np.ix_(*(np.arange(n) // side for n in shape))]

    def soften(band: NDArray[np.uint8]) -> NDArray[np.uint8]:
        return np.where(tile, cv2.GaussianBlur(band, (0, 0), size), band)

    return each_band(soften)


@effect("interlaced rows")
def interlaced(shape: Shape, rng: np.random.Generator) -> Effect:
    """Darken every second to fourth row, by another gain in each block of rows."""
    period = int(rng.integers(2, 5))
    rows = (np.arange(shape[0]) % period == 0)[:, None]
    gain = np.repeat(rng.uniform(0.3, 0.8, shape[0] // 20 + 1), 20)[: shape[0], None]
    return each_band(lambda band: np.where(rows, band * gain, band).astype(np.uint8))
