"""Attacks by repetitive scenes whose truth may lie beyond the search radius."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from affine import Affine

from groundtie.rasters.grid import compose

from ..accuracy import FloatArray
from ..cases import REFERENCE_TRANSFORM, SAR_OPTICAL, SAR_SAR
from .catalogue import REPETITION, Attack, Make, Setting, direction
from .overlays import smooth_noise
from .pairs import Change, Image, Pair, join, pixels, render, to_bytes

# Takes positions along and across the rows, in periods; returns the brightness, from 0 to 1.
Pattern = Callable[[FloatArray, FloatArray], FloatArray]

# Range of the period in pixels.
_PERIODS = {"orchard": (10, 18), "vineyard": (4, 9), "blocks": (28, 48), "panels": (9, 16)}

# Half a mile, the side of a quarter section; and the number of different ones in a row.
_QUARTER_M, _QUARTERS = 804.67, 64

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
        moved = pair.moved(shift)
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
    moved = pair.moved(shift)
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


def survey_grid(
    px: FloatArray, quarter_px: float, grids: np.random.Generator, crops: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return fields of a land survey's grid and the opacity of its roads, at positions (col, row).

    Quarter sections of half a mile hold fields of centre pivots, or strips; roads follow the
    sections' borders, every other line.

    Parameters
    ----------
    px
        Positions, shape (rows, columns, 2).
    quarter_px
        Side of a quarter section.
    grids, crops
        What belongs to the place, and to the date.
    """
    turn = np.deg2rad(grids.uniform(-0.6, 0.6))
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    at = px @ axes / quarter_px + grids.uniform(0, 2, 2)
    quarter, inside = np.floor(at), at % 1 - 0.5
    column, row = np.moveaxis(quarter.astype(int) % _QUARTERS, -1, 0)
    table = _QUARTERS, _QUARTERS
    use, radius, start = (
        grids.uniform(*limits, table)[row, column]
        for limits in ((0, 1), (0.43, 0.49), (-np.pi, np.pi))
    )
    first, second, corners = (
        crops.uniform(*limits, table)[row, column] for limits in ((60, 190), (60, 190), (100, 170))
    )
    angle = np.arctan2(inside[..., 1], inside[..., 0])
    sown = np.where((use > 0.6) & (np.cos(angle - start) > 0), second, first)
    strips = np.where(np.floor(4 * inside[..., 0]) % 2 == 0, first, second)
    pivot = np.where(np.hypot(*np.moveaxis(inside, -1, 0)) < radius, sown, corners)
    away_px = (quarter_px * np.abs(at - 2 * np.rint(at / 2))).min(axis=-1)
    road = 0.7 * np.exp(-0.5 * (away_px / 0.7) ** 2)
    return np.where(use < 0.2, strips, pivot), road


def fields(is_elsewhere: bool, is_far: bool = False) -> Make:
    """Cover the scene with the fields of a land survey's grid, sown anew between the dates.

    The ground is displaced by up to 20 px, or by up to about a quarter section.
    """

    def make(pair: Pair, setting: Setting) -> Pair:
        rng = setting.rng
        metres = float(rng.choice([10.0, 15.0, 20.0, 30.0]))
        quarter_px = _QUARTER_M / metres
        low, high = (0.5 * quarter_px, 1.1 * quarter_px) if is_far else (0.0, 20.0)
        shift = direction(rng, low, high)
        place = compose(REFERENCE_TRANSFORM, Affine.scale(metres))
        made = setting.elsewhere(pair) if is_elsewhere else pair.moved(shift)
        seeds = rng.integers(2**31, size=2)
        where = (pixels(pair.size), pixels(pair.size) if is_elsewhere else made.shown)
        radar = pair.kind in (SAR_OPTICAL, SAR_SAR), pair.kind == SAR_SAR

        def covered(number: int) -> Change:
            grids = np.random.default_rng(seeds[number if is_elsewhere else 0])
            at = np.nan_to_num(where[number], nan=-1e4)
            sown, road = survey_grid(at, quarter_px, grids, rng)
            sown = (1 - road) * sown + road * (50 if radar[number] else 215)
            looks = rng.gamma(4.0, 1 / 4.0, sown.shape)
            speckle = np.sqrt(looks) if radar[number] else 1.0
            # A quarter of the contrast of the ground below remains.
            return lambda image: to_bytes(sown * speckle + (image - image.mean()) / 4)

        note = f"quarter sections of {quarter_px:.0f} px"
        made = replace(made, reference_transform=place, input_transform=place)
        return made.changed(covered(0), covered(1), note)

    return make


ATTACKS = [
    *(Attack(REPETITION, name, "", repeating(name)) for name in _PATTERNS),
    Attack(REPETITION, "the same patch all over", "", repeated_patch),
    Attack(REPETITION, "fields of a survey grid", "", fields(False)),
    Attack(REPETITION, "fields of a survey grid", "half a mile off", fields(False, is_far=True)),
    Attack(REPETITION, "fields of a survey grid", "other place", fields(True)),
]
