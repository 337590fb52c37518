"""The list of attacks: each makes, of a pair whose ground lies right, one that deceives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .pairs import Pair
from .scenes import Scene, elsewhere


@dataclass(frozen=True)
class Setting:
    """What an attack may draw from.

    Parameters
    ----------
    rng
        Random numbers of this case alone.
    scenes, seed, cache
        Other places, and which of each.
    """

    rng: np.random.Generator
    scenes: Sequence[Scene]
    seed: int
    cache: Path

    def elsewhere(self, pair: Pair) -> Pair:
        """Return a pair with an input of another place."""
        return elsewhere(pair, self.scenes, self.rng, self.seed, self.cache)


Make = Callable[[Pair, Setting], Pair]


@dataclass(frozen=True)
class Attack:
    """A way to deceive.

    Parameters
    ----------
    group, name, variant
        Of which kind it is; what it is called in tables; what differs between attacks of one name.
    make
        Makes the pair.
    fits
        Which scenes it can be made of.
    """

    group: str
    name: str
    variant: str
    make: Make
    fits: Callable[[Scene], bool] = lambda scene: True

    @property
    def is_control(self) -> bool:
        """Whether it ought to be registered."""
        return self.group == CONTROLS

    @property
    def is_example(self) -> bool:
        """Whether it stands for one pair of files alone."""
        return self.group == EXAMPLES


CONTROLS = "controls"
LOCKED = "pixel-locked content"
PARTS = "parts that moved differently"
NOISE = "noise"
REPETITION = "repetition beyond the radius"
CITIES = "dense cities"
GROUND = "changed ground"
PLACEMENT = "wrong placement"
EXAMPLES = "examples"
SENSOR = "images with RPCs"


# How many scenes a seed draws for each attack of a group, if not one.
DRAWS = {PARTS: 2, NOISE: 3, CITIES: 3, REPETITION: 3, GROUND: 2, PLACEMENT: 2}


def direction(rng: np.random.Generator, low: float, high: float) -> np.ndarray:
    """Return a shift (right, down) of a length between two limits, in any direction."""
    angle, length = rng.uniform(0, 2 * np.pi), rng.uniform(low, high)
    return length * np.array([np.cos(angle), np.sin(angle)])


def resampled(make: Make) -> Make:
    """Make the same, and put the input onto another grid, which its georeferencing states."""

    def made(pair: Pair, setting: Setting) -> Pair:
        other = make(pair, setting)
        scale, corner = float(setting.rng.uniform(0.85, 1.2)), setting.rng.uniform(0, 1, 2)
        return other.on_another_grid(scale, corner)

    return made


def as_text(shift_px: np.ndarray) -> str:
    """Return a shift for people."""
    return f"ground at ({shift_px[0]:+.1f}, {shift_px[1]:+.1f}) px"
