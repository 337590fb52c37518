"""Attacks by content that is locked to pixels, while the ground lies elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from affine import Affine

from groundtie.rasters.grid import compose

from . import effects
from .catalogue import CONTROLS, LOCKED, Attack, Make, Setting, as_text, direction
from .overlays import OVERLAYS, Draw
from .pairs import Pair
from .scenes import elsewhere

_NEAREST_PX, _FARTHEST_PX = 8.0, 25.0


def displaced(draw: Draw) -> Make:
    """The ground lies elsewhere in the input, what is locked does not."""

    def make(pair: Pair, setting: Setting) -> Pair:
        shift = direction(setting.rng, _NEAREST_PX, _FARTHEST_PX)
        moved = pair.moved(shift, as_text(shift))
        return moved.both(draw(moved.reference.shape[1:], setting.rng).change())

    return make


def other_place(draw: Draw) -> Make:
    """The input shows another place."""

    def make(pair: Pair, setting: Setting) -> Pair:
        other = elsewhere(pair, setting.scenes, setting.rng, setting.cache)
        return other.both(draw(other.reference.shape[1:], setting.rng).change())

    return make


def placed_right(draw: Draw) -> Make:
    """The georeferencing is right, so that what is locked lies displaced on the map."""

    def make(pair: Pair, setting: Setting) -> Pair:
        shift = direction(setting.rng, _NEAREST_PX, _FARTHEST_PX)
        moved = pair.moved(shift, f"{as_text(shift)}, rightly georeferenced")
        made = moved.both(draw(moved.reference.shape[1:], setting.rng).change())
        place = compose(made.reference_transform, Affine.translation(*-shift))
        return replace(made, input_transform=place)

    return make


def on_the_map(draw: Draw) -> Make:
    """What is locked lies at the same place of the map, but not at the same pixels."""

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
    """What is locked lies elsewhere, too, but not where the ground does."""

    def make(pair: Pair, setting: Setting) -> Pair:
        rng = setting.rng
        shift, other = direction(rng, 0.0, 15.0), np.rint(direction(rng, 4.0, 15.0))
        while np.hypot(*(shift - other)) < _NEAREST_PX:
            shift, other = direction(rng, 0.0, 15.0), np.rint(direction(rng, 4.0, 15.0))
        moved = pair.moved(shift, as_text(shift))
        drawn = draw(moved.reference.shape[1:], rng)
        right, down = (int(n) for n in other)
        note = f"overlay at ({right:+d}, {down:+d})"
        return moved.changed(drawn.change(), drawn.change(right, down), note)

    return make


def aligned(draw: Draw) -> Make:
    """Ground and what is locked lie right, as in most products."""

    def make(pair: Pair, setting: Setting) -> Pair:
        return pair.both(draw(pair.reference.shape[1:], setting.rng).change())

    return make


_WAYS = {
    "displaced": displaced,
    "other place": other_place,
    "rightly placed": placed_right,
    "on the map": on_the_map,
    "at an offset": at_an_offset,
}

# What moves with the array only if it is no function of the image: see `effects`.
ATTACKS = [
    *(
        Attack(LOCKED, name, variant, way(draw))
        for name, draw in OVERLAYS.items()
        for variant, way in _WAYS.items()
        if variant != "at an offset" or name not in effects.OF_THE_ARRAY
    ),
    *(
        Attack(CONTROLS, "overlay on aligned ground", name, aligned(draw))
        for name, draw in OVERLAYS.items()
    ),
]
