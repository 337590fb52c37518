"""Attacks by ground that changed between the images and is displaced in the input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..accuracy import FloatArray
from ..cases import SAR_OPTICAL, SAR_SAR
from ..series_scenes import aged
from .catalogue import CONTROLS, GROUND, Attack, Make, Setting, direction, resampled
from .effects import snow_cover
from .overlays import Overlay, bump, cloud_deck, smooth_noise
from .pairs import Change, Image, Pair, Source, to_bytes
from .scenes import Scene

Shape = tuple[int, int]

# Positions for drawing are in sixteenths of pixels, with so many bits of fractions.
_FRACTION_BITS = 4
_SIXTEENTHS = 2**_FRACTION_BITS

Range = tuple[float, float]

Draw = Callable[[Shape, np.random.Generator], Change]


def _area(shape: Shape, rng: np.random.Generator, low: float, high: float) -> NDArray[np.bool_]:
    noise = smooth_noise(shape, float(rng.uniform(10, 40)), rng)
    return np.asarray(noise > np.quantile(noise, 1 - rng.uniform(low, high)))


def rebuilt(shape: Shape, rng: np.random.Generator) -> Change:
    """Replace 20 to 40 % of the image by blocks from elsewhere in it."""
    share, side = rng.uniform(0.2, 0.4), int(rng.integers(20, 60))

    def build(image: Image) -> Image:
        made, rebuilt = image.copy(), np.zeros(shape, bool)
        while rebuilt.mean() < share:
            to, of = (rng.integers(0, np.array(shape) - side) for _ in range(2))
            made[:, to[0] : to[0] + side, to[1] : to[1] + side] = image[
                :, of[0] : of[0] + side, of[1] : of[1] + side
            ]
            rebuilt[to[0] : to[0] + side, to[1] : to[1] + side] = True
        return made

    return build


def flooded(shape: Shape, rng: np.random.Generator) -> Change:
    """Flood 30 to 70 % of the image."""
    water = _area(shape, rng, 0.3, 0.7)
    return lambda image: np.where(water, to_bytes(25 + 6 * rng.normal(size=shape)), image)


def burnt(shape: Shape, rng: np.random.Generator) -> Change:
    """Darken burnt areas and weaken their texture."""
    area = _area(shape, rng, 0.3, 0.6)
    return lambda image: np.where(area, to_bytes(30 + 0.2 * image), image)


def snow(shape: Shape, rng: np.random.Generator) -> Change:
    """Cover 30 to 60 % of the image with snow."""
    return snow_cover(shape, rng).change()


def seasons(shape: Shape, rng: np.random.Generator) -> Change:
    """Invert the contrast of some areas, as crops do."""
    area = _area(shape, rng, 0.3, 0.7)
    return lambda image: np.where(area, to_bytes(256.0 - image), image)


def night(shape: Shape, rng: np.random.Generator) -> Change:
    """Leave only lights, with noise."""
    share, noise = rng.uniform(0.97, 0.995), rng.uniform(2, 10)

    def darken(image: Image) -> Image:
        grey = image.mean(axis=0)
        lights = cv2.GaussianBlur(250.0 * (grey > np.quantile(grey, share)), (0, 0), 1.5)
        return to_bytes(np.broadcast_to(15 + lights + noise * rng.normal(size=shape), image.shape))

    return darken


def glint(shape: Shape, rng: np.random.Generator) -> Change:
    """Add sun glint with fine sparkle to a part of the image."""
    centre, reach = rng.uniform(0.2, 0.8, 2) * shape, rng.uniform(0.2, 0.45) * max(shape)
    bright = bump(shape, centre, reach)
    sparkle = bright * rng.gamma(0.7, 1 / 0.7, shape)
    return lambda image: to_bytes(image * (1 - 0.5 * bright) + 160 * sparkle)


def clouds(shape: Shape, rng: np.random.Generator) -> Change:
    """Cover a part of the image with clouds and their shadows."""
    return cloud_deck(shape, rng).change()


_INPUT_ONLY: dict[str, Draw] = {
    "construction": rebuilt,
    "flooded": flooded,
    "burnt": burnt,
    "snow on one date": snow,
    "seasons": seasons,
    "night": night,
    "sun glint": glint,
}


def changed(draw: Draw) -> Make:
    """Return an attack that changes the input's ground and displaces it."""

    def make(pair: Pair, setting: Setting) -> Pair:
        shift = direction(setting.rng, 0.0, 20.0)
        moved = pair.moved(shift)
        return moved.changed(None, draw(pair.input.shape[1:], setting.rng))

    return make


def moving_clouds(pair: Pair, setting: Setting) -> Pair:
    """Put the same clouds, moved by the wind, over ground that is displaced by another shift."""
    rng = setting.rng
    shift, wind = direction(rng, 0.0, 15.0), np.rint(direction(rng, 5.0, 20.0)).astype(int)
    moved = pair.moved(shift)
    deck = cloud_deck(pair.input.shape[1:], rng)
    note = f"clouds moved by ({wind[0]:+d}, {wind[1]:+d}) px"
    return moved.changed(deck.change(), deck.change(*(int(n) for n in wind)), note)


def water_moved(pair: Pair, setting: Setting) -> Pair:
    """Move a river or water area by another shift than the ground."""
    rng, shape = setting.rng, pair.input.shape[1:]
    shift, by = direction(rng, 0.0, 10.0), np.rint(direction(rng, 8.0, 20.0)).astype(int)
    moved = pair.moved(shift)
    noise = smooth_noise(shape, float(rng.uniform(18, 45)), rng)
    water = np.abs(noise) < rng.uniform(0.15, 0.5) if rng.random() < 0.5 else noise > 0.4
    grey = float(rng.choice([20, 45]))
    drawn = Overlay(grey + 5 * rng.normal(size=shape), water.astype(float))
    right, down = (int(n) for n in np.rint(shift + by))
    note = f"water moved by ({by[0]:+d}, {by[1]:+d}) px against the ground"
    return moved.changed(drawn.change(), drawn.change(right, down), note)


def shadows_moved(pair: Pair, setting: Setting) -> Pair:
    """Scatter trees, whose shadows fall to another side in the input, over displaced dry ground."""
    return _sides_moved(pair, setting, (0.65, 0.9), (0.15, 0.35))


def bright_sides_moved(pair: Pair, setting: Setting) -> Pair:
    """Scatter roofs, whose sunlit walls are seen on another side in the input."""
    return _sides_moved(pair, setting, (1.1, 1.3), (1.5, 1.9))


def _sides_moved(pair: Pair, setting: Setting, top: Range, side: Range) -> Pair:
    """Scatter round objects by the ranges of the brightness of their tops and sides."""
    rng, shape = setting.rng, np.array(pair.reference.shape[1:])
    shift, apart = direction(rng, 0.0, 12.0), rng.uniform(9.0, 20.0)
    moved = pair.moved(shift)
    number = int(np.prod(shape) / apart**2)
    trunks, radii = rng.uniform(0, 1, (number, 2)) * shape[::-1], rng.uniform(1.3, 3.0, number)
    crown, shadow = rng.uniform(*top), rng.uniform(*side)
    length, contrast = rng.uniform(2.0, 3.5), rng.uniform(0.25, 0.7)
    azimuth = rng.uniform(0, 2 * np.pi)
    turn = np.deg2rad(rng.uniform(60, 120)) * rng.choice([-1, 1])

    def gains(sun: float) -> FloatArray:
        to = trunks + (length * radii)[:, None] * np.array([np.cos(sun), np.sin(sun)])
        gain = np.ones(shape, np.float32)
        for first, last, radius in zip(_SIXTEENTHS * trunks, _SIXTEENTHS * to, radii, strict=True):
            ends = (tuple(int(x) for x in np.rint(one)) for one in (first, last))
            width = max(1, round(1.6 * radius))
            cv2.line(gain, *ends, shadow, width, cv2.LINE_8, _FRACTION_BITS)
        for at, radius in zip(_SIXTEENTHS * trunks, radii, strict=True):
            centre, wide = tuple(int(x) for x in np.rint(at)), round(_SIXTEENTHS * radius)
            cv2.circle(gain, centre, wide, crown, -1, cv2.LINE_8, _FRACTION_BITS)
        return np.asarray(cv2.GaussianBlur(gain, (0, 0), 0.6))

    def over(gain: FloatArray) -> Change:
        return lambda image: to_bytes(
            (60 + 0.6 * (image.mean() + contrast * (image - image.mean()))) * gain
        )

    at = np.nan_to_num(moved.shown, nan=-1.0).astype(np.float32)
    later = cv2.remap(gains(azimuth + turn), at[..., 0], at[..., 1], cv2.INTER_LINEAR, None)
    note = f"trees {apart:.0f} px apart, shadows of {length * radii.mean():.1f} px"
    note += f" turned by {np.rad2deg(turn):.0f}°"
    return moved.changed(over(gains(azimuth)), over(later), note)


def two_dates(pair: Pair, setting: Setting) -> Pair:
    """Replace both images by the reference's ground as one camera sees it on two dates."""
    rng, grey = setting.rng, pair.reference.mean(axis=0, keepdims=True).astype(np.uint8)
    seen = replace(pair, reference=grey, source=Source(grey, grey, np.copy), corner=(0, 0))
    shift = direction(rng, 0.0, 12.0)

    def on_a_date(image: Image) -> Image:
        return to_bytes(20 + 200 * aged(image[0] / 255.0, rng))[None]

    return seen.moved(shift).changed(on_a_date, on_a_date)


def self_copy(pair: Pair, setting: Setting) -> Pair:
    """Insert the reference as one band of the input; the other bands show displaced ground."""
    rng = setting.rng
    shift = direction(rng, 8.0, 25.0)
    moved = pair.moved(shift)
    bands = list(np.resize(moved.input, (2, *moved.input.shape[1:])))
    bands.insert(int(rng.integers(3)), moved.reference[0])
    return replace(moved, input=np.stack(bands))


def half_transparent_copy(is_resampled: bool) -> Make:
    """Return an attack that blends the reference into the displaced input."""

    def make(pair: Pair, setting: Setting) -> Pair:
        rng = setting.rng
        shift = direction(rng, 8.0, 25.0)
        moved = pair.moved(shift)
        share, copy = rng.uniform(0.3, 0.7), pair.reference.mean(axis=0)
        if is_resampled:
            copy = ndimage.shift(copy, rng.uniform(-0.5, 0.5, 2), mode="mirror")
        return moved.changed(None, lambda image: to_bytes((1 - share) * image + share * copy))

    return make


def filtered_stack(pair: Pair, setting: Setting) -> Pair:
    """Both images come from one multitemporal speckle filter; the stack was not coregistered.

    The filter [Quegan2001] multiplies the local mean of each image by the mean of all images'
    ratios to their local means. All dates but the input lie at the reference's place.
    """
    rng = setting.rng
    shift = direction(rng, 5.0, 12.0)
    moved = pair.moved(shift)
    number, window = int(rng.integers(4, 13)), int(rng.choice([5, 7, 9, 11]))
    looks = rng.uniform(1.0, 4.0)

    def local_mean(power: FloatArray) -> FloatArray:
        return np.asarray(cv2.blur(power, (window, window)))

    reference, image = ((one.mean(axis=0) / 255.0) ** 2 for one in (moved.reference, moved.input))
    ground = cv2.GaussianBlur(reference, (0, 0), 1.0)
    others = (ground * rng.gamma(looks, 1 / looks, ground.shape) for _ in range(number - 2))
    ratio = np.mean([power / local_mean(power) for power in (reference, image, *others)], axis=0)

    def filtered(power: FloatArray) -> Image:
        return to_bytes(255.0 * np.sqrt(local_mean(power) * ratio))[None]

    made = filtered(reference), filtered(image)
    note = f"{number} dates, window of {window} px"
    return moved.changed(lambda _: made[0], lambda _: made[1], note)


def alpha_band(pair: Pair, setting: Setting) -> Pair:
    """Append the same opacity band to both images; the ground is displaced."""
    rng, shape = setting.rng, pair.input.shape[1:]
    shift = direction(rng, 8.0, 25.0)
    moved = pair.moved(shift)
    opaque = to_bytes(255.0 * _area(shape, rng, 0.4, 0.8))[None]
    images = (np.concatenate([image, opaque]) for image in (moved.reference, moved.input))
    reference, image = images
    return replace(moved, reference=reference, input=image)


def no_radar_input(scene: Scene) -> bool:
    """Whether the input is a camera image."""
    return scene.kind != SAR_SAR


def radar_only(scene: Scene) -> bool:
    """Whether both images are radar images."""
    return scene.kind == SAR_SAR


def camera_only(scene: Scene) -> bool:
    """Whether both images are camera images."""
    return scene.kind not in (SAR_OPTICAL, SAR_SAR)


ATTACKS = [
    *(
        Attack(GROUND, name, "", changed(draw), no_radar_input)
        for name, draw in _INPUT_ONLY.items()
    ),
    Attack(GROUND, "water moved", "", water_moved),
    Attack(GROUND, "moving clouds", "", moving_clouds, camera_only),
    Attack(GROUND, "shadows at another hour", "", shadows_moved, camera_only),
    Attack(GROUND, "bright walls on another side", "", bright_sides_moved, camera_only),
    Attack(GROUND, "reference in one band", "", self_copy),
    Attack(GROUND, "reference in one band", "resampled", resampled(self_copy)),
    Attack(GROUND, "reference shines through", "", half_transparent_copy(False)),
    Attack(GROUND, "reference shines through", "resampled", half_transparent_copy(True)),
    Attack(GROUND, "speckle filter of a stack", "", filtered_stack, radar_only),
    Attack(GROUND, "speckle filter of a stack", "resampled", resampled(filtered_stack), radar_only),
    Attack(GROUND, "band of opacity", "", alpha_band),
    Attack(CONTROLS, "two dates of one camera", "", two_dates, camera_only),
    Attack(CONTROLS, "two dates of one camera", "resampled", resampled(two_dates), camera_only),
]
