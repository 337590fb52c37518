"""The list of attacks: each turns a correctly georeferenced pair into one that deceives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .pairs import Pair
from .scenes import Scene, elsewhere


@dataclass(frozen=True)
class Setting:
    """Random numbers and other scenes that an attack may draw from.

    Parameters
    ----------
    rng
        Random numbers for this case alone.
    scenes, seed, cache
        Scenes of other places; the seed and the folder by which they are made.
    """

    rng: np.random.Generator
    scenes: Sequence[Scene]
    seed: int
    cache: Path

    def elsewhere(self, pair: Pair) -> Pair:
        """Return the pair with an input that shows another place."""
        return elsewhere(pair, self.scenes, self.rng, self.seed, self.cache)


Make = Callable[[Pair, Setting], Pair]


@dataclass(frozen=True)
class Attack:
    """A way to deceive.

    Parameters
    ----------
    group, name, variant
        Its kind; its name in tables; what distinguishes attacks of one name.
    make
        Returns the attacked pair.
    fits
        Whether a scene is suitable.
    """

    group: str
    name: str
    variant: str
    make: Make
    fits: Callable[[Scene], bool] = lambda scene: True

    @property
    def is_example(self) -> bool:
        """Whether it stands for a single pair of files."""
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


# Number of scenes that a seed draws for each attack of a group; 1 for other groups.
DRAWS = {PARTS: 2, NOISE: 3, CITIES: 3, REPETITION: 3, GROUND: 2, PLACEMENT: 2}


def direction(rng: np.random.Generator, low: float, high: float) -> np.ndarray:
    """Return a shift (right, down) in a random direction, its length between two limits."""
    angle, length = rng.uniform(0, 2 * np.pi), rng.uniform(low, high)
    return length * np.array([np.cos(angle), np.sin(angle)])


def resampled(make: Make) -> Make:
    """Return an attack that also resamples the input to another grid and states it correctly."""

    def made(pair: Pair, setting: Setting) -> Pair:
        other = make(pair, setting)
        scale, corner = float(setting.rng.uniform(0.85, 1.2)), setting.rng.uniform(0, 1, 2)
        return other.on_another_grid(scale, corner)

    return made
