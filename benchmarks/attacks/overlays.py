"""Pixel-locked content: drawn once, and the same in every image that it is put on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..accuracy import FloatArray
from .pairs import Change, Image, to_bytes

# Draws an overlay for arrays of (rows, columns).
Draw = Callable[[tuple[int, int], np.random.Generator], "Overlay"]

OVERLAYS: dict[str, Draw] = {}

_WORDS = ("Riverside", "Old Town", "Station", "B12", "Lake Park", "PL58", "Airport", "North", "A 7")
_CAPTIONS = ("Satellite image 2021-03-04", "Lat 47.123 Lon 12.104", "(c) Agency, all rights res.")


@dataclass(frozen=True)
class Overlay:
    """An overlay on an image: image · gain · (1 − alpha) + values · alpha + offset.

    Parameters
    ----------
    values, alpha
        Grey values and their opacity, shape (rows, columns).
    gain, offset
        Applied to the image below; scalars or arrays of the same shape.
    """

    values: FloatArray
    alpha: FloatArray
    gain: FloatArray | float = 1.0
    offset: FloatArray | float = 0.0

    def change(self, right: int = 0, down: int = 0) -> Change:
        """Return the change that puts the overlay on an image, moved by whole pixels."""

        def changed(image: Image) -> Image:
            layers = (self.values, self.alpha, self.gain, self.offset)
            values, alpha, gain, offset = (
                _moved(layer, image.shape[1:], right, down) for layer in layers
            )
            return to_bytes(image * gain * (1 - alpha) + values * alpha + offset)

        return changed

    def wider(self, px: int) -> Overlay:
        """Return the overlay with all covered areas wider by a number of pixels on every side."""
        side = np.ones((2 * px + 1,) * 2, np.uint8)
        values, alpha = (cv2.dilate(layer, side) for layer in (self.values, self.alpha))
        return replace(self, values=values, alpha=alpha)

    def softer(self, px: float) -> Overlay:
        """Return the overlay blurred by a Gaussian of a standard deviation."""
        alpha, covering = (
            cv2.GaussianBlur(layer, (0, 0), px) for layer in (self.alpha, self.alpha * self.values)
        )
        return replace(self, values=covering / np.maximum(alpha, 1e-6), alpha=alpha)


def _moved(
    layer: FloatArray | float, shape: tuple[int, int], right: int, down: int
) -> FloatArray | float:
    if np.isscalar(layer):
        return layer
    whole = np.asarray(layer)
    rows, columns = (np.arange(side) for side in shape)
    return whole[np.ix_((rows - down) % len(whole), (columns - right) % whole.shape[1])]


def overlay(name: str) -> Callable[[Draw], Draw]:
    """Register an overlay by its name."""

    def listed(draw: Draw) -> Draw:
        OVERLAYS[name] = draw
        return draw

    return listed


class Canvas:
    """Grey values and opacity to draw on."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.values = np.zeros(shape, np.uint8)
        self.alpha = np.zeros(shape, np.uint8)

    def line(self, points: np.ndarray, grey: int, width: int) -> None:
        """Draw a line through points (col, row)."""
        at = np.rint(points).astype(np.int32).reshape(1, -1, 2)
        cv2.polylines(self.values, at, False, grey, width, cv2.LINE_8)
        cv2.polylines(self.alpha, at, False, 255, width, cv2.LINE_8)

    def text(self, words: str, at: tuple[int, int], grey: int, scale: float, halo: int) -> None:
        """Write words, with a halo of a width in pixels."""
        font = cv2.FONT_HERSHEY_SIMPLEX
        for width, value in ((2 + 2 * halo, 255 - grey), (2, grey))[0 if halo else 1 :]:
            cv2.putText(self.values, words, at, font, scale, value, width, cv2.LINE_AA)
            cv2.putText(self.alpha, words, at, font, scale, 255, width, cv2.LINE_AA)

    def box(self, first: tuple[int, int], last: tuple[int, int], grey: int) -> None:
        """Fill a box."""
        cv2.rectangle(self.values, first, last, grey, -1)
        cv2.rectangle(self.alpha, first, last, 255, -1)

    def overlay(self, opacity: float = 1.0) -> Overlay:
        """Return the drawing as an overlay."""
        alpha = self.alpha.astype(float) / 255 * opacity
        values = np.where(self.alpha > 0, self.values * 255.0 / np.maximum(self.alpha, 1), 0)
        return Overlay(np.minimum(values, 255.0), alpha)


def smooth_noise(shape: tuple[int, int], length_px: float, rng: np.random.Generator) -> FloatArray:
    """Return noise of a correlation length, with mean 0 and standard deviation 1."""
    noise = cv2.GaussianBlur(rng.normal(size=shape), (0, 0), length_px)
    return np.asarray((noise - noise.mean()) / noise.std())


def bump(shape: tuple[int, int], centre: FloatArray, reach: float) -> FloatArray:
    """Return a bell of height 1 about a centre (row, column)."""
    rows, columns = np.indices(shape)
    return np.exp(-((rows - centre[0]) ** 2 + (columns - centre[1]) ** 2) / (2 * reach**2))


def _points(shape: tuple[int, int], number: int, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-0.1, 1.1, (number, 2)) * np.array(shape[::-1])


@overlay("labels and roads")
def labels_and_roads(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Draw the roads of a street map, winding or straight, with names."""
    canvas = Canvas(shape)
    winding = rng.random() < 0.6
    for _ in range(int(rng.integers(10, 35))):
        ends = _points(shape, 2, rng)
        along = np.linspace(0, 1, 12)[:, None]
        path = ends[0] * (1 - along) + ends[1] * along
        if winding:
            path = path + np.cumsum(rng.normal(0, 5, path.shape), axis=0)
        width = int(rng.integers(2, 6))
        if rng.random() < 0.5:
            canvas.line(path, 60, width + 2)
        canvas.line(path, int(rng.integers(200, 256)), width)
    return _labelled(canvas, int(rng.integers(8, 25)), rng)


def _labelled(canvas: Canvas, number: int, rng: np.random.Generator) -> Overlay:
    rows, columns = canvas.values.shape
    for _ in range(number):
        at = int(rng.integers(0, columns - 30)), int(rng.integers(10, rows))
        words = f"{rng.choice(_WORDS)} {rng.integers(1, 99)}"
        grey = int(rng.choice([0, 255]))
        canvas.text(words, at, grey, float(rng.uniform(0.35, 0.6)), int(rng.integers(0, 2)))
    return canvas.overlay()


@overlay("labels")
def labels(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Write place names only."""
    return _labelled(Canvas(shape), int(rng.integers(20, 60)), rng)


@overlay("watermark")
def watermark(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Repeat a slanted, half-transparent text."""
    large = int(np.hypot(*shape)) + 20
    canvas = Canvas((large, large))
    across, down = rng.integers(140, 220), rng.integers(45, 110)
    for row, top in enumerate(range(20, large, int(down))):
        for left in range(-100 + 60 * (row % 2), large, int(across)):
            canvas.text("(C) SAMPLE", (left, top), 255, float(rng.uniform(0.68, 0.72)), 0)
    turn = cv2.getRotationMatrix2D((large / 2, large / 2), float(rng.uniform(15, 45)), 1.0)
    first = (large - shape[0]) // 2, (large - shape[1]) // 2
    alpha = cv2.warpAffine(canvas.alpha, turn, (large, large), flags=cv2.INTER_LINEAR)
    alpha = alpha[first[0] : first[0] + shape[0], first[1] : first[1] + shape[1]]
    opacity = rng.uniform(0.35, 0.8)
    return Overlay(np.full(shape, 255.0), alpha / 255.0 * opacity)


@overlay("irregular graticule")
def graticule(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Draw a graticule of curved, unevenly spaced lines, with figures."""
    canvas = Canvas(shape)
    grey = int(rng.choice([0, 255]))
    bend, width = rng.uniform(-20, 20), int(rng.integers(1, 3))
    for axis in (0, 1):
        side, other = shape[1 - axis], shape[axis]
        at = rng.uniform(10, 40)
        while at < side:
            along = np.linspace(0, other, 30)
            across = at + bend * np.sin(along / other * np.pi)
            both = (across, along) if axis == 0 else (along, across)
            canvas.line(np.column_stack(both), grey, width)
            place = (int(at) + 2, 12) if axis == 0 else (2, int(at) - 2)
            canvas.text(f"{at / 7:.1f}'", place, grey, 0.35, 0)
            at += rng.uniform(25, 75)
    return canvas.overlay()


@overlay("caption strip")
def caption_strip(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Put a caption below the image, and sometimes the bar of another program above."""
    canvas = Canvas(shape)
    rows, columns = shape
    height = int(rng.integers(35, 80))
    ground = int(rng.choice([1, 20, 255]))
    canvas.box((0, rows - height), (columns, rows), ground)
    for line, words in enumerate(_CAPTIONS):
        at = (8, rows - height + 16 + 19 * line)
        canvas.text(words, at, 20 if ground > 128 else 230, 0.55, 0)
    if rng.random() < 0.5:
        canvas.box((0, 0), (columns, 26), 60)
        for left in range(6, columns - 20, 28):
            canvas.box((left, 5), (left + 16, 21), int(rng.integers(100, 256)))
    return canvas.overlay()


@overlay("mosaic steps")
def mosaic_steps(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Add steps of brightness and contrast between irregular tiles."""
    steps = [np.sort(rng.uniform(0, side, int(rng.integers(3, 9)))) for side in shape]
    tile = [np.searchsorted(step, np.arange(side)) for step, side in zip(steps, shape, strict=True)]
    gains = rng.uniform(0.5, 1.2, (20, 20))[np.ix_(*tile)]
    offsets = rng.uniform(-20, 70, (20, 20))[np.ix_(*tile)]
    return Overlay(np.zeros(shape), np.zeros(shape), gains, offsets)


@overlay("cloud deck")
def cloud_deck(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Cover a part with clouds and their shadows, the same in both images."""
    noise = smooth_noise(shape, float(rng.uniform(7, 22)), rng)
    noise += 0.35 * smooth_noise(shape, 2.5, rng)
    cover = np.quantile(noise, 1 - rng.uniform(0.25, 0.7))
    alpha = np.clip((noise - cover) / rng.uniform(0.15, 0.6), 0, 1)
    dark = 1 - 0.55 * np.roll(alpha, (14, 10), axis=(0, 1))
    return Overlay(215 + 25 * smooth_noise(shape, 4, rng), alpha, dark)


@overlay("soft clouds")
def soft_clouds(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Cover a part with clouds that become thin towards their edges, without shadows."""
    side = float(rng.uniform(15, 45))
    noise = smooth_noise(shape, side, rng)
    noise += 0.35 * smooth_noise(shape, side / 4, rng) + 0.15 * smooth_noise(shape, side / 12, rng)
    cover = np.quantile(noise, 1 - rng.uniform(0.2, 0.5))
    alpha = np.clip((noise - cover) / rng.uniform(0.7, 1.6), 0, 1)
    return Overlay(np.full(shape, 225.0), alpha)


@overlay("soft pattern noise")
def soft_pattern(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Add the same noise, correlated over some pixels as by interpolation."""
    noise = smooth_noise(shape, float(rng.uniform(1.5, 4.0)), rng)
    return Overlay(np.zeros(shape), np.zeros(shape), 1.0, float(rng.uniform(20, 60)) * noise)


@overlay("fixed pattern noise")
def fixed_pattern(shape: tuple[int, int], rng: np.random.Generator) -> Overlay:
    """Add the same noise of pixels, rows or columns, as of an uncalibrated sensor."""
    size = rng.uniform(15, 60)
    kind = int(rng.integers(4))
    noise = rng.normal(size=shape)
    if kind == 1:
        noise = smooth_noise(shape, 1.0, rng)
    elif kind == 2:
        noise = 0.4 * noise + np.repeat(rng.normal(size=(1, shape[1])), shape[0], axis=0)
    elif kind == 3:
        lines = rng.normal(size=(shape[0], 1)) + rng.normal(size=(1, shape[1]))
        noise = 0.4 * noise + lines
    return Overlay(np.zeros(shape), np.zeros(shape), 1.0, size * noise)
