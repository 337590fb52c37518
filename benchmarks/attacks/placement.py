"""Attacks by wrong georeferencing, by flipped or turned images, and by too little overlap."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from affine import Affine

from groundtie.rasters.grid import compose

from .catalogue import CONTROLS, PLACEMENT, Attack, Make, Setting, direction
from .pairs import Pair, join, to_bytes


def mirrored(pair: Pair, setting: Setting) -> Pair:
    """The input is a mirror image, which no transform model allows."""
    axis = int(setting.rng.integers(1, 3))
    shown = np.full_like(pair.shown, np.nan)
    return replace(pair, input=np.flip(pair.input, axis), shown=shown, note=f"axis {axis}")


def turned(pair: Pair, setting: Setting) -> Pair:
    """The input is turned by right angles; its georeferencing is not."""
    turns = int(setting.rng.integers(1, 4))
    image = np.rot90(pair.input, turns, (1, 2))
    shown = np.rot90(pair.shown, turns, (0, 1))
    return replace(pair, input=image, shown=shown, note=f"{90 * turns}°")


def south_up(pair: Pair, setting: Setting) -> Pair:
    """The input's rows run northwards, as its geotransform states."""
    shift = direction(setting.rng, 0.0, 15.0)
    moved = pair.moved(shift)
    rows = moved.input.shape[1]
    place = compose(moved.input_transform, Affine.translation(0, rows), Affine.scale(1, -1))
    return replace(
        moved, input=moved.input[:, ::-1], shown=moved.shown[::-1], input_transform=place
    )


def tiny_overlap(pair: Pair, setting: Setting) -> Pair:
    """The images share a strip of only 12 to 30 %, in which the ground is displaced."""
    rng = setting.rng
    shift, share = direction(rng, 0.0, 20.0), rng.uniform(0.12, 0.3)
    moved = pair.moved(shift)
    columns = moved.input.shape[2]
    right, left = int(columns * (0.5 + share / 2)), int(columns * (0.5 - share / 2))
    return replace(
        moved,
        reference=moved.reference[:, :, :right],
        input=moved.input[:, :, left:],
        shown=moved.shown[:, left:],
        input_transform=compose(moved.input_transform, Affine.translation(left, 0)),
        note=f"{moved.note}, {share:.0%} overlap",
    )


def claimed(draw: Callable[[np.random.Generator], tuple[Affine, str]]) -> Make:
    """The input's georeferencing states a wrong pixel size or rotation."""

    def make(pair: Pair, setting: Setting) -> Pair:
        shift = direction(setting.rng, 0.0, 12.0)
        moved = pair.moved(shift)
        wrong, note = draw(setting.rng)
        centre = np.array(moved.size) / 2
        to, back = Affine.translation(*centre), Affine.translation(*-centre)
        place = compose(moved.input_transform, to, wrong, back)
        return replace(moved, input_transform=place, note=f"{moved.note}, {note}")

    return make


def wrong_scale(rng: np.random.Generator) -> tuple[Affine, str]:
    """State pixels that are 2 to 40 % too large or too small."""
    scale = float((1 + rng.uniform(0.02, 0.4)) ** rng.choice([-1, 1]))
    return Affine.scale(scale), f"scale {scale:.3f}"


def wrong_rotation(rng: np.random.Generator) -> tuple[Affine, str]:
    """State a rotation that is wrong by 1 to 30°."""
    angle = float(rng.uniform(1, 30) * rng.choice([-1, 1]))
    return Affine.rotation(angle), f"rotation {angle:.1f}°"


def wrong_aspect(rng: np.random.Generator) -> tuple[Affine, str]:
    """State pixels that are 3 to 30 % too wide or too narrow."""
    scale = float((1 + rng.uniform(0.03, 0.3)) ** rng.choice([-1, 1]))
    return Affine.scale(scale, 1.0), f"columns {scale:.3f} as wide"


def other_zone(pair: Pair, setting: Setting) -> Pair:
    """The input states the neighbouring UTM zone with the same coordinates."""
    return replace(pair, input_crs="EPSG:32634")


def unknown_units(pair: Pair, setting: Setting) -> Pair:
    """Neither image states a CRS, and the map units are 0.2 to 5 m."""
    shift, scale = direction(setting.rng, 0.0, 12.0), float(5 ** setting.rng.uniform(-1, 1))
    moved = pair.moved(shift)
    return replace(
        moved,
        reference_transform=compose(Affine.scale(scale), moved.reference_transform),
        input_transform=compose(Affine.scale(scale), moved.input_transform),
        reference_crs=None,
        input_crs=None,
        note=f"{moved.note}, {1 / scale:.2f} m a unit",
    )


def far_off(pair: Pair, setting: Setting) -> Pair:
    """The ground is displaced by 30 to 60 px, beyond the search radius."""
    shift = direction(setting.rng, 30.0, 60.0)
    return pair.moved(shift).within(float(setting.rng.uniform(8, 28)))


def other_place(pair: Pair, setting: Setting) -> Pair:
    """The input shows another place; nothing else is changed."""
    return setting.elsewhere(pair)


def bands_apart(pair: Pair, setting: Setting) -> Pair:
    """Two of three bands are displaced against the first, whose place counts."""
    rng = setting.rng
    shift, further = direction(rng, 0.0, 12.0), direction(rng, 5.0, 15.0)
    stays, moves = pair.moved(shift), pair.moved(shift + further)
    bands = [stays.input[:1], *(np.resize(moves.input, (2, *moves.input.shape[1:]))[:, None])]
    gains = 1.0, *rng.uniform(0.6, 1.0, 2)
    made = [to_bytes(gain * band) for gain, band in zip(gains, bands, strict=True)]
    note = f"bands 2 and 3 {np.hypot(*further):.1f} px off band 1"
    return replace(stays, input=np.concatenate(made), note=join(stays.note, note))


ATTACKS = [
    Attack(PLACEMENT, "bands apart", "", bands_apart),
    Attack(PLACEMENT, "mirrored", "", mirrored),
    Attack(PLACEMENT, "turned", "", turned),
    Attack(PLACEMENT, "tiny overlap", "", tiny_overlap),
    Attack(PLACEMENT, "wrong scale claimed", "", claimed(wrong_scale)),
    Attack(PLACEMENT, "wrong rotation claimed", "", claimed(wrong_rotation)),
    Attack(PLACEMENT, "wrong aspect claimed", "", claimed(wrong_aspect)),
    Attack(PLACEMENT, "other zone", "", other_zone),
    Attack(PLACEMENT, "unknown units", "", unknown_units),
    Attack(PLACEMENT, "beyond the radius", "", far_off),
    Attack(PLACEMENT, "another place", "", other_place),
    Attack(CONTROLS, "rows run northwards", "", south_up),
]
