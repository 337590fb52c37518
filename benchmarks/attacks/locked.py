"""Attacks by pixel-locked content over ground that is displaced."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from affine import Affine

from groundtie.rasters.grid import apply_affine, compose

from . import cartography, effects
from .catalogue import CONTROLS, LOCKED, Attack, Make, Setting, direction, resampled
from .overlays import OVERLAYS, Draw
from .pairs import Pair, as_text, pixels

_NEAREST_PX, _FARTHEST_PX = 8.0, 25.0

# Rotations and scales of ground beneath locked content.
_ROTATIONS_DEG, _SCALES = (6.0, 40.0), (1.12, 1.35)

# How often blurred content has the opposite contrast in the input.
_OPPOSITE = 0.3

# How far off a screenshot is placed by hand.
_OFF_BY_HAND_PX = 2.0, 10.0


def _moved(pair: Pair, setting: Setting) -> Pair:
    shift = direction(setting.rng, _NEAREST_PX, _FARTHEST_PX)
    return pair.moved(shift)


def _elsewhere(pair: Pair, setting: Setting) -> Pair:
    return setting.elsewhere(pair)


def _in_place(pair: Pair, setting: Setting) -> Pair:
    return pair


def alike(ground: Make) -> Callable[[Draw], Make]:
    """The locked content is the same in both images, over ground that is changed or not."""

    def way(draw: Draw) -> Make:
        def make(pair: Pair, setting: Setting) -> Pair:
            seen = ground(pair, setting)
            return seen.both(draw(seen.reference.shape[1:], setting.rng).change())

        return make

    return way


displaced, other_place, aligned = alike(_moved), alike(_elsewhere), alike(_in_place)


def placed_right(draw: Draw) -> Make:
    """The georeferencing is correct, so the locked content is displaced on the map."""

    def make(pair: Pair, setting: Setting) -> Pair:
        shift = direction(setting.rng, _NEAREST_PX, _FARTHEST_PX)
        moved = pair.moved(shift, f"{as_text(shift)}, rightly georeferenced")
        made = moved.both(draw(moved.reference.shape[1:], setting.rng).change())
        place = compose(made.reference_transform, Affine.translation(*-shift))
        return replace(made, input_transform=place)

    return make


def on_the_map(draw: Draw) -> Make:
    """The locked content coincides on the map, but not in array coordinates."""

    def make(pair: Pair, setting: Setting) -> Pair:
        made = displaced(draw)(pair, setting)
        right, down = (int(n) for n in setting.rng.integers(5, 40, 2))
        place = compose(made.input_transform, Affine.translation(right, down))
        return replace(
            made,
            input=made.input[:, down:, right:],
            shown=made.shown[down:, right:],
            input_transform=place,
            note=f"{made.note}, cut by ({right}, {down}) px",
        )

    return make


def at_an_offset(draw: Draw) -> Make:
    """The locked content is displaced, too, but by another offset than the ground."""

    def make(pair: Pair, setting: Setting) -> Pair:
        rng = setting.rng
        shift, other = direction(rng, 0.0, 20.0), np.rint(direction(rng, 1.0, 15.0))
        while np.hypot(*(shift - other)) < _NEAREST_PX:
            shift, other = direction(rng, 0.0, 20.0), np.rint(direction(rng, 1.0, 15.0))
        moved = pair.moved(shift)
        drawn = draw(moved.reference.shape[1:], rng)
        right, down = (int(n) for n in other)
        note = f"overlay at ({right:+d}, {down:+d})"
        return moved.changed(drawn.change(), drawn.change(right, down), note)

    return make


def rotated(draw: Draw) -> Make:
    """The ground is rotated or of another scale in the input; the locked content is not."""

    def make(pair: Pair, setting: Setting) -> Pair:
        rng = setting.rng
        angle = float(rng.uniform(*_ROTATIONS_DEG) * rng.choice([-1, 1]))
        scale = float(rng.uniform(*_SCALES) ** rng.choice([-1, 1]))
        angle, scale = (angle, 1.0) if rng.random() < 0.6 else (0.0, scale)
        about = compose(Affine.rotation(angle), Affine.scale(scale))
        at, middle = pixels(pair.size), np.array(pair.size) / 2
        shown = apply_affine(about, (at - middle).reshape(-1, 2)).reshape(at.shape) + middle
        note = f"ground rotated by {angle:.0f}°, {scale:.2f} times as coarse"
        made = pair.moved(at - shown + direction(rng, 0.0, 10.0), note)
        return made.both(draw(made.reference.shape[1:], rng).change())

    return make


def of_wrong_scale(draw: Draw) -> Make:
    """The locked content coincides in the arrays; the input's geotransform has a wrong scale."""

    def make(pair: Pair, setting: Setting) -> Pair:
        made = displaced(draw)(pair, setting)
        scale = float(setting.rng.choice([0.98, 1.02]))
        middle = np.array(made.size) / 2
        about = Affine.translation(*middle), Affine.scale(scale), Affine.translation(*-middle)
        place = compose(made.input_transform, *about)
        return replace(made, input_transform=place, note=f"{made.note}, {scale:g} of pixel size")

    return make


def restyled(draw: Draw) -> Make:
    """The locked content has other colours in the input, and both images are compressed."""

    def make(pair: Pair, setting: Setting) -> Pair:
        rng, moved = setting.rng, _moved(pair, setting)
        drawn = draw(moved.reference.shape[1:], rng)
        other = replace(drawn, values=np.clip(rng.choice([0, 255]) - drawn.values, 0, 255))
        other = replace(other, alpha=drawn.alpha * rng.uniform(0.6, 1.0))
        made = moved.changed(drawn.change(), other.change(), "other colours, compressed")
        qualities = (int(rng.integers(30, 85)) for _ in range(2))
        return made.changed(*(effects.compressed(each).change() for each in qualities))

    return make


def wider(ground: Make) -> Callable[[Draw], Make]:
    """The overlay is a pixel or two wider in the input, whose ground does not match."""

    def way(draw: Draw) -> Make:
        def make(pair: Pair, setting: Setting) -> Pair:
            rng, other = setting.rng, ground(pair, setting)
            drawn, px = draw(other.reference.shape[1:], rng), int(rng.integers(1, 3))
            return other.changed(drawn.change(), drawn.wider(px).change(), f"{px} px wider")

        return make

    return way


def softer(ground: Make) -> Callable[[Draw], Make]:
    """The locked content is blurred in both images; its contrast may be inverted in the input."""

    def way(draw: Draw) -> Make:
        def make(pair: Pair, setting: Setting) -> Pair:
            rng, other = setting.rng, ground(pair, setting)
            px = float(rng.uniform(0.6, 2.2))
            drawn = draw(other.reference.shape[1:], rng).softer(px)
            is_opposite = rng.random() < _OPPOSITE
            in_input = replace(drawn, values=255 - drawn.values) if is_opposite else drawn
            note = f"blurred by {px:.1f} px" + ", of opposite contrast" * is_opposite
            return other.changed(drawn.change(), in_input.change(), note)

        return make

    return way


def on_another_grid(way: Callable[[Draw], Make]) -> Callable[[Draw], Make]:
    """The same attack with the input resampled to another pixel size."""
    return lambda draw: resampled(way(draw))


def placed_by_hand(way: Callable[[Draw], Make]) -> Callable[[Draw], Make]:
    """The same attack with a resampled input whose georeferencing is some pixels off."""

    def other_way(draw: Draw) -> Make:
        make = resampled(way(draw))

        def made(pair: Pair, setting: Setting) -> Pair:
            other, off = make(pair, setting), direction(setting.rng, *_OFF_BY_HAND_PX)
            place = compose(other.input_transform, Affine.translation(*off))
            note = f"{other.note}, placed {np.hypot(*off):.1f} px off"
            return replace(other, input_transform=place, note=note)

        return made

    return other_way


_WAYS = {
    "displaced": displaced,
    "other place": other_place,
    "rightly placed": placed_right,
    "on the map": on_the_map,
    "resampled": on_another_grid(displaced),
    "ground rotated": rotated,
    "other pixel size": of_wrong_scale,
    "at an offset": at_an_offset,
    "at an offset, resampled": on_another_grid(at_an_offset),
    "restyled": restyled,
    "restyled, resampled": on_another_grid(restyled),
    "wider": wider(_moved),
    "wider, other place": wider(_elsewhere),
    "wider, resampled": on_another_grid(wider(_moved)),
    "softer": softer(_moved),
    "softer, other place": softer(_elsewhere),
    "softer, resampled": on_another_grid(softer(_moved)),
    "softer, placed by hand": placed_by_hand(softer(_elsewhere)),
}

# Variants that need an overlay: effects are functions of the whole array.
_OVERLAYS_ONLY = (
    "at an offset",
    "at an offset, resampled",
    "restyled",
    "restyled, resampled",
    "wider",
    "wider, other place",
    "wider, resampled",
    "softer",
    "softer, other place",
    "softer, resampled",
    "softer, placed by hand",
)

# Modules that register further overlays.
_DRAWN_IN = (effects, cartography)

# Effects in `effects.OF_THE_ARRAY` cannot be moved within the array.
ATTACKS = [
    *(
        Attack(LOCKED, name, variant, way(draw))
        for name, draw in OVERLAYS.items()
        for variant, way in _WAYS.items()
        if variant not in _OVERLAYS_ONLY or name not in effects.OF_THE_ARRAY
    ),
    *(
        Attack(CONTROLS, "overlay on aligned ground", name, aligned(draw))
        for name, draw in OVERLAYS.items()
    ),
]
