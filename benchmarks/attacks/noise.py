"""Attacks by noise and other loss of detail, over displaced ground."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from .catalogue import CITIES, CONTROLS, NOISE, Attack, Make, Setting, direction, resampled
from .effects import Effect, each_band, jpeg
from .pairs import Change, Image, Pair, to_bytes
from .scenes import Scene

# Draws a change, separately for each image.
Draw = Callable[[Image, np.random.Generator], Change]


def gaussian(image: Image, rng: np.random.Generator) -> Change:
    """Add noise of 40 to 90 grey levels."""
    size = rng.uniform(40, 90)
    return lambda image: to_bytes(image + size * rng.normal(size=image.shape))


def salt_and_pepper(image: Image, rng: np.random.Generator) -> Change:
    """Replace a third to two thirds of all pixels by black and white."""
    share = rng.uniform(0.3, 0.65)
    lost = rng.random(image.shape[1:]) < share
    values = rng.choice([1, 255], image.shape[1:])
    return lambda image: np.where(lost, values, image).astype(np.uint8)


def speckle(image: Image, rng: np.random.Generator) -> Change:
    """Multiply by speckle of one look."""
    return lambda image: to_bytes(image * rng.rayleigh(size=image.shape[1:]) / 1.25)


def blur(image: Image, rng: np.random.Generator) -> Change:
    """Remove all detail below 8 to 20 px."""
    size = float(rng.uniform(3, 8))
    return each_band(lambda band: cv2.GaussianBlur(band, (0, 0), size)).change()


def haze(image: Image, rng: np.random.Generator) -> Change:
    """Reduce the contrast to a few grey levels, and add noise."""
    contrast, noise = rng.uniform(0.04, 0.15), rng.uniform(1, 6)
    return lambda image: to_bytes(
        170 + contrast * (image - image.mean()) + noise * rng.normal(size=image.shape)
    )


def coarse(image: Image, rng: np.random.Generator) -> Change:
    """Add noise, then compress strongly."""
    size = rng.uniform(20, 50)
    block: Effect = jpeg(image.shape[1:], rng)
    return lambda image: block.change()(to_bytes(image + size * rng.normal(size=image.shape)))


_NOISES: dict[str, Draw] = {
    "40 to 90 grey levels": gaussian,
    "salt and pepper": salt_and_pepper,
    "speckle on both": speckle,
    "strong blur": blur,
    "haze": haze,
    "noise and compression": coarse,
}


def noisy(draw: Draw) -> Make:
    """Both images have independent noise; the ground is displaced by 0 to 20 px."""

    def make(pair: Pair, setting: Setting) -> Pair:
        moved = plain(pair, setting)
        changes = (draw(image, setting.rng) for image in (moved.reference, moved.input))
        return moved.changed(*changes)

    return make


def noisy_input(pair: Pair, setting: Setting) -> Pair:
    """Only the input has noise of 40 to 90 grey levels."""
    moved = plain(pair, setting)
    return moved.changed(None, gaussian(moved.input, setting.rng))


def exchanged(pair: Pair, setting: Setting) -> Pair:
    """The camera image becomes the reference."""
    return plain(pair, setting).swapped()


def built_up(scene: Scene) -> bool:
    """Whether walls and roofs remain visible under noise."""
    return scene.density in ("suburban", "urban") or scene.name in (
        "so-rosenheim",
        "so-dense-urban",
        "oo-beijing-a",
        "oo-stadium",
    )


def plain(pair: Pair, setting: Setting) -> Pair:
    """The ground is displaced by up to 20 px."""
    shift = direction(setting.rng, 0.0, 20.0)
    return pair.moved(shift)


def untouched(pair: Pair, setting: Setting) -> Pair:
    """The pair is unchanged: ground and georeferencing agree."""
    return pair


def is_city(scene: Scene) -> bool:
    """Whether a scene is a dense city."""
    return scene.density == "city" or scene.name == "so-dense-urban"


def no_city(scene: Scene) -> bool:
    """Whether a scene is not a dense city."""
    return not is_city(scene)


ATTACKS = [
    *(
        Attack(NOISE, "40 to 90 grey levels over a town", f"{n}", noisy(gaussian), built_up)
        for n in range(3)
    ),
    *(Attack(NOISE, name, "", noisy(draw)) for name, draw in _NOISES.items()),
    Attack(NOISE, "40 to 90 grey levels on the input", "", noisy_input),
    Attack(CITIES, "dense city", "", plain, is_city),
    Attack(CITIES, "dense city", "exchanged", exchanged, is_city),
    Attack(CITIES, "dense city", "haze", noisy(haze), is_city),
    Attack(CITIES, "dense city", "rightly placed", untouched, is_city),
    *(Attack(CONTROLS, "ground elsewhere", f"{n}", plain, no_city) for n in range(4)),
    *(Attack(CONTROLS, "images exchanged", f"{n}", exchanged, no_city) for n in range(2)),
    *(Attack(CONTROLS, "aligned ground", f"{n}", untouched, no_city) for n in range(4)),
    Attack(CONTROLS, "ground elsewhere", "resampled", resampled(plain), no_city),
    Attack(CONTROLS, "aligned ground", "resampled", resampled(untouched), no_city),
]
