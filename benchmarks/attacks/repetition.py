"""Attacks by repetitive scenes whose truth may lie beyond the search radius."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..accuracy import FloatArray
from ..cases import SAR_OPTICAL
from .catalogue import REPETITION, Attack, Make, Setting, as_text, direction
from .overlays import smooth_noise
from .pairs import Image, Pair, join, pixels, render, to_bytes
from .scenes import SAR_SAR

# Takes positions along and across the rows, in periods; returns the brightness, from 0 to 1.
Pattern = Callable[[FloatArray, FloatArray], FloatArray]

# Range of the period in pixels.
_PERIODS = {"orchard": (10, 18), "vineyard": (4, 9), "blocks": (28, 48), "panels": (9, 16)}

# The least search radius of any tool.
_LEAST_RADIUS_PX = 3.0


def orchard(along: FloatArray, across: FloatArray) -> FloatArray:
    """Trees at the nodes of a lattice."""
    away = np.hypot(along - np.rint(along), across - np.rint(across))
    return np.clip((0.33 - away) / 0.1, 0, 1)


def vineyard(along: FloatArray, across: FloatArray) -> FloatArray:
    """Rows."""
    return 0.5 + 0.5 * np.sin(2 * np.pi * across)


def blocks(along: FloatArray, across: FloatArray) -> FloatArray:
    """Identical blocks of a town between streets."""
    u, v = along % 1, across % 1
    street = (u < 0.15) | (v < 0.15)
    house = (u > 0.25) & (u < 0.9) & (v > 0.3) & (v < 0.55)
    return np.where(street, 0.45, np.where(house, 1.0, 0.1))


def panels(along: FloatArray, across: FloatArray) -> FloatArray:
    """Rows of solar panels, with gaps."""
    return np.where((across % 1 < 0.55) & ((along / 3) % 1 < 0.9), 0.1, 0.8)


_PATTERNS: dict[str, Pattern] = {
    "orchard": orchard,
    "vineyard": vineyard,
    "blocks": blocks,
    "panels": panels,
}


def repeating(name: str) -> Make:
    """Cover all or most of the scene with a pattern; the search radius may be too small."""

    def make(pair: Pair, setting: Setting) -> Pair:
        rng = setting.rng
        shift = direction(rng, 5.0, 20.0)
        period, turn = rng.uniform(*_PERIODS[name]), rng.uniform(0, np.pi)
        moved = pair.moved(shift, as_text(shift))
        shape = pair.reference.shape[1:]
        cover = np.ones(shape)
        if rng.random() < 0.5:
            noise = smooth_noise(shape, 40, rng)
            cover = np.clip((noise - np.quantile(noise, rng.uniform(0.05, 0.3))) * 4, 0, 1)
        strength = rng.uniform(0.7, 0.95)

        def covered(image: Image, shown: FloatArray, radar: bool) -> Image:
            at = np.nan_to_num(shown, nan=-1e4) / period
            along = at[..., 0] * np.cos(turn) + at[..., 1] * np.sin(turn)
            across = at[..., 1] * np.cos(turn) - at[..., 0] * np.sin(turn)
            near = np.clip(np.rint(np.nan_to_num(shown)), 0, np.array(shape[::-1]) - 1).astype(int)
            alpha = strength * cover[near[..., 1], near[..., 0]]
            values = 40 + 150 * _PATTERNS[name](along, across)
            if radar:
                values = values * rng.gamma(4.0, 1 / 4.0, values.shape)
            else:
                values = values + 5 * rng.normal(size=values.shape)
            return np.where(image.any(axis=0), to_bytes(image * (1 - alpha) + values * alpha), 0)

        radar = [pair.kind in (SAR_OPTICAL, SAR_SAR), pair.kind == SAR_SAR]
        images = (
            covered(image, shown, one)
            for image, shown, one in zip(
                (moved.reference, moved.input),
                (pixels(shape[::-1]), moved.shown),
                radar,
                strict=True,
            )
        )
        reference, image = images
        length = float(np.hypot(*shift))
        radius = max(
            float(rng.choice([5.0, period, 0.6 * length, 0.9 * length, 1.5 * length])),
            _LEAST_RADIUS_PX,
        )
        note = f"{name} of {period:.1f} px"
        made = replace(moved, reference=reference, input=image, note=join(moved.note, note))
        return made.within(radius)

    return make


def repeated_patch(pair: Pair, setting: Setting) -> Pair:
    """Repeat one piece of ground in both images, sometimes within a frame of other ground."""
    rng = setting.rng
    shift, side = direction(rng, 5.0, 20.0), int(rng.integers(24, 70))
    moved = pair.moved(shift, as_text(shift))
    shape = np.array(pair.reference.shape[:0:-1])
    first, frame = rng.integers(30, shape - side - 30), int(rng.choice([0, 0, 30]))

    def patch(px: FloatArray) -> FloatArray:
        inner = ((px >= frame) & (px < shape - frame)).all(axis=-1)
        return np.where(inner[..., None], first + (px - first) % side, px)

    corner = np.array(pair.corner)
    at = patch(pixels(tuple(shape))).astype(int)
    reference = pair.reference[:, at[..., 1], at[..., 0]]
    image, known = render(pair.source, patch(pixels(pair.size) - shift) + corner)
    shown = np.where(known[..., None], moved.shown, np.nan)
    made = replace(moved, reference=reference, input=image, shown=shown)
    radii = [5.0, side, 0.6 * np.hypot(*shift), 1.5 * np.hypot(*shift)]
    made = replace(made, note=join(made.note, f"every {side} px"))
    return made.within(max(float(rng.choice(radii)), _LEAST_RADIUS_PX))


ATTACKS = [
    *(Attack(REPETITION, name, "", repeating(name)) for name in _PATTERNS),
    Attack(REPETITION, "the same patch all over", "", repeated_patch),
]
