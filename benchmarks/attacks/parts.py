"""Attacks by images of which parts moved differently."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..accuracy import FloatArray
from .catalogue import PARTS, Attack, Make, Setting, direction
from .overlays import bump, smooth_noise
from .pairs import Pair, join

# How far off parts lie, in pixels: within the radius of the survey, and beyond.
_NEAR, _FAR = (6.0, 20.0), (20.0, 70.0)

# The whole input may be displaced, too, by up to this.
_WHOLE_PX = 8.0

Shape = tuple[int, int]
Part = Callable[[Shape, np.random.Generator], NDArray[np.bool_]]


def _along(shape: Shape, angle: float) -> FloatArray:
    """Return how far each pixel lies along a direction, in sides of the image."""
    rows, columns = np.indices(shape)
    return np.cos(angle) * columns / shape[1] + np.sin(angle) * rows / shape[0]


def beyond_line(shape: Shape, share: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return a share of an image's pixels that lies beyond a straight seam line."""
    angle = rng.choice([0, 1, 2, 3]) * np.pi / 2 + rng.uniform(-0.5, 0.5) * rng.integers(0, 2)
    along = _along(shape, angle)
    return np.asarray(along > np.quantile(along, 1 - share))


def half(shape: Shape, rng: np.random.Generator) -> NDArray[np.bool_]:
    return beyond_line(shape, 1 / 2, rng)


def third(shape: Shape, rng: np.random.Generator) -> NDArray[np.bool_]:
    return beyond_line(shape, 1 / 3, rng)


def quarter(shape: Shape, rng: np.random.Generator) -> NDArray[np.bool_]:
    return beyond_line(shape, 1 / 4, rng)


def corner(shape: Shape, rng: np.random.Generator) -> NDArray[np.bool_]:
    """A corner, a quarter of the image or more."""
    rows, columns = (np.arange(side) / side for side in shape)
    reach = rng.uniform(0.5, 0.65, 2)
    flips = rng.integers(0, 2, 2)
    down = (rows if flips[0] else 1 - rows) < reach[0]
    right = (columns if flips[1] else 1 - columns) < reach[1]
    return np.asarray(np.logical_and.outer(down, right))


def strip(shape: Shape, rng: np.random.Generator) -> NDArray[np.bool_]:
    """A strip across the image."""
    along = _along(shape, rng.uniform(0, np.pi))
    first = rng.uniform(0.1, 0.5)
    low, high = np.quantile(along, (first, first + rng.uniform(0.25, 0.4)))
    return np.asarray((along > low) & (along < high))


def blob(shape: Shape, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Irregular parts, as in a mosaic of two dates."""
    noise = smooth_noise(shape, float(rng.uniform(25, 60)), rng)
    return np.asarray(noise > np.quantile(noise, 1 - rng.uniform(0.25, 0.5)))


def tiles(shape: Shape, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Tiles of a web map, some of them of another date."""
    side = int(rng.choice([64, 128, 256]))
    origin = rng.integers(0, side, 2)
    late = rng.random((20, 20)) < rng.uniform(0.25, 0.5)
    index = [(np.arange(n) + o) // side for n, o in zip(shape, origin, strict=True)]
    part = late[np.ix_(*index)]
    # Tiles of both dates must remain; otherwise a half moves.
    return part if 0.15 < part.mean() < 0.85 else half(shape, rng)


_PARTS: dict[str, Part] = {
    "half": half,
    "third": third,
    "quarter": quarter,
    "corner": corner,
    "strip": strip,
    "two dates": blob,
    "map tiles": tiles,
}


def seam(part: Part, between_px: tuple[float, float] = _NEAR) -> Make:
    """A part is displaced against the rest; the rest is in place or displaced, too."""

    def make(pair: Pair, setting: Setting) -> Pair:
        rng = setting.rng
        whole = direction(rng, 0.0, _WHOLE_PX) * rng.integers(0, 2)
        nearest_px, farthest_px = between_px
        low = max(nearest_px, 2 * pair.sigma_px + 4)
        off = direction(rng, low, farthest_px)
        moved = part(pair.input.shape[1:], rng)
        note = f"{moved.mean():.0%} off by ({off[0]:+.1f}, {off[1]:+.1f}) px against the rest"
        return pair.moved(whole + moved[..., None] * off, note)

    return make


def in_the_reference(make: Make) -> Make:
    """Return an attack that moves parts of the reference instead of the input."""
    return lambda pair, setting: make(pair, setting).swapped()


def own_strips(pair: Pair, setting: Setting) -> Pair:
    """Several strips are displaced, each by its own shift."""
    rng, shape = setting.rng, pair.input.shape[1:]
    number, axis = int(rng.integers(3, 6)), int(rng.integers(2))
    offs = np.stack([direction(rng, 0.0, 16.0) for _ in range(number)])
    index = np.arange(shape[axis]) * number // shape[axis]
    shift = np.expand_dims(offs[index], 1 - axis)
    return pair.moved(np.broadcast_to(shift, (*shape, 2)).copy(), f"{number} strips")


def half_of_another_place(pair: Pair, setting: Setting) -> Pair:
    """About half of the input shows another place; the rest is displaced by 5 to 20 px."""
    rng = setting.rng
    shift = direction(rng, 5.0, 20.0)
    moved = pair.moved(shift)
    other = setting.elsewhere(pair)
    part = beyond_line(pair.input.shape[1:], rng.uniform(0.3, 0.6), rng)
    bands = min(len(moved.input), len(other.input))
    return replace(
        moved,
        input=np.where(part, other.input[:bands], moved.input[:bands]),
        shown=np.where(part[..., None], np.nan, moved.shown),
        note=join(f"{part.mean():.0%} of another place", other.note),
    )


def _along_rows(shift: FloatArray, shape: Shape) -> FloatArray:
    return np.broadcast_to(shift[:, None, :], (*shape, 2)).copy()


def jitter(pair: Pair, setting: Setting) -> Pair:
    """Rows are displaced by slow or fast vibrations of the camera."""
    rows = pair.input.shape[1]
    size, period = setting.rng.uniform(5, 12), setting.rng.uniform(60, 1.5 * rows)
    along = size * np.sin(2 * np.pi * np.arange(rows) / period + setting.rng.uniform(0, 6))
    shift = np.column_stack([along, np.zeros(rows)])
    note = f"rows by ± {size:.0f} px, period {period:.0f} px"
    return pair.moved(_along_rows(shift, pair.input.shape[1:]), note)


def stripes(pair: Pair, setting: Setting) -> Pair:
    """Narrow stripes all over are filled from another date, or are swaths of another pass."""
    rng, shape = setting.rng, pair.input.shape[1:]
    rows, columns = np.indices(shape)
    angle = rng.choice([0.0, np.pi / 2]) + rng.choice([0.0, rng.uniform(-0.3, 0.3)])
    period, share = rng.uniform(20, 90), rng.uniform(0.15, 0.4)
    across = np.cos(angle) * rows + np.sin(angle) * columns
    moved = across % period < share * period
    off = direction(rng, 2 * pair.sigma_px + 5, 25.0)
    shift = direction(rng, 0.0, _WHOLE_PX) + moved[..., None] * off
    note = f"stripes {period:.0f} px apart, {moved.mean():.0%} off by {np.hypot(*off):.0f} px"
    return pair.moved(shift, note)


def bursts_of_jitter(pair: Pair, setting: Setting) -> Pair:
    """Rows are displaced by fast vibrations that come and go."""
    rows, rng = pair.input.shape[1], setting.rng
    size, period = rng.uniform(5, 14), rng.uniform(30, 110)
    noise = smooth_noise((rows, 1), rows / 8, rng)[:, 0]
    is_burst = noise > np.quantile(noise, rng.uniform(0.3, 0.5))
    along = size * np.sin(2 * np.pi * np.arange(rows) / period + rng.uniform(0, 6)) * is_burst
    note = f"{is_burst.mean():.0%} of the rows by ± {size:.0f} px, period {period:.0f} px"
    return pair.moved(_along_rows(np.column_stack([along, 0 * along]), pair.input.shape[1:]), note)


def duplicated_rows(pair: Pair, setting: Setting) -> Pair:
    """Some rows are repeated or missing, which displaces all rows below."""
    rows, rng = pair.input.shape[1], setting.rng
    number = int(rng.integers(7, 20)) * int(rng.choice([-1, 1]))
    at = int(rng.uniform(0.25, 0.75) * rows)
    below = np.arange(rows) >= at
    down = np.where(below, number, 0)
    if number > 0 and rng.random() < 0.5:
        # One row, repeated, fills the gap.
        down = np.clip(np.arange(rows) - at, 0, number)
    shift = np.column_stack([np.zeros(rows), down])
    note = f"{abs(number)} rows {'twice' if number > 0 else 'missing'} at row {at}"
    return pair.moved(_along_rows(shift, pair.input.shape[1:]), note)


def bulge(pair: Pair, setting: Setting) -> Pair:
    """A hill displaces a part of the image, as if no terrain model had been used."""
    rng, shape = setting.rng, pair.input.shape[1:]
    centre, reach = rng.uniform(0.25, 0.75, 2) * shape, rng.uniform(0.15, 0.3) * max(shape)
    height = bump(shape, centre, reach)
    off = direction(rng, 8.0, 18.0)
    return pair.moved(height[..., None] * off, f"hill by ({off[0]:+.1f}, {off[1]:+.1f}) px")


def stretched(pair: Pair, setting: Setting) -> Pair:
    """A part is stretched, as by a wrong control point: farther off the farther from a seam."""
    rng, shape = setting.rng, pair.input.shape[1:]
    angle, still = rng.uniform(0, 2 * np.pi), rng.uniform(0.4, 0.7)
    along = _along(shape, angle)
    along = (along - along.min()) / np.ptp(along)
    growing = np.clip((along - still) / (1 - still), 0, 1)
    off = direction(rng, 10.0, 25.0)
    note = f"{(growing > 0).mean():.0%} stretched by up to ({off[0]:+.1f}, {off[1]:+.1f}) px"
    return pair.moved(direction(rng, 0.0, _WHOLE_PX) + growing[..., None] * off, note)


def waves(pair: Pair, setting: Setting) -> Pair:
    """The whole input is warped smoothly, beyond any model of a few parameters."""
    rng, shape = setting.rng, pair.input.shape[1:]
    length = float(rng.uniform(30, 70))
    shift = np.stack([smooth_noise(shape, length, rng) for _ in range(2)], axis=-1)
    return pair.moved(rng.uniform(4, 8) * shift, f"smooth warp of {length:.0f} px")


ATTACKS = [
    *(Attack(PARTS, "a part lies off", name, seam(part)) for name, part in _PARTS.items()),
    *(
        Attack(PARTS, "a part of the reference lies off", name, in_the_reference(seam(part)))
        for name, part in _PARTS.items()
        if name in ("half", "third", "map tiles")
    ),
    *(
        Attack(PARTS, "a part lies far off", name, seam(part, _FAR))
        for name, part in _PARTS.items()
    ),
    Attack(PARTS, "strips lie off each by itself", "", own_strips),
    Attack(PARTS, "a part shows another place", "", half_of_another_place),
    Attack(PARTS, "jitter of rows", "", jitter),
    Attack(PARTS, "stripes of another date", "", stripes),
    Attack(PARTS, "bursts of jitter", "", bursts_of_jitter),
    Attack(PARTS, "duplicated or missing rows", "", duplicated_rows),
    Attack(PARTS, "hill", "", bulge),
    Attack(PARTS, "a part is stretched", "", stretched),
    Attack(PARTS, "smooth warp", "", waves),
]
