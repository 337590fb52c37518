"""Attacks on RPCs and ground control: scenes of `simulate_sensor`, unchanged or attacked.

Attacks change the image; where they move its content, the truth at the check points moves, too.
"""

from __future__ import annotations

import math
import tempfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shutil import copytree

import numpy as np
import rasterio

import groundtie

from ..accuracy import FloatArray
from ..rpc import image_positions
from ..rpc_city import RUNS, judge, misses_px
from ..simulations import kept, simulator_version
from .catalogue import SENSOR, direction
from .overlays import OVERLAYS
from .pairs import ERROR_PERCENTILE, Image
from .tries import AttackOutcome, attempted

TOOLS = ("refine_rpc", "extract_gcps")
_SIDES_PX = (420, 560)
_SHIFT_M = 40.0

# Takes an image's bands; returns the changed bands, and the function that gives the movement of
# the content at positions (n, 2). NaN: it is no longer shown.
Moved = Callable[[FloatArray], FloatArray]
Change = Callable[[Image, np.random.Generator], tuple[Image, Moved]]


def _nowhere(px: FloatArray) -> FloatArray:
    return np.zeros_like(px)


def as_it_is(image: Image, rng: np.random.Generator) -> tuple[Image, Moved]:
    """Change nothing."""
    return image, _nowhere


def noisy(image: Image, rng: np.random.Generator) -> tuple[Image, Moved]:
    """Add noise of a fifth to half of the range."""
    size = rng.uniform(0.2, 0.5) * float(np.ptp(image))
    return _like(image, image + size * rng.normal(size=image.shape)), _nowhere


def lower_part(
    image: Image,
    rng: np.random.Generator,
    between_px: tuple[float, float] = (6.0, 20.0),
) -> tuple[Image, Moved]:
    """Move the lower 30 to 60 % of the rows, as if they were a strip of another pass."""
    first = int(image.shape[1] * rng.uniform(0.4, 0.7))
    right, down = (int(n) for n in np.rint(direction(rng, *between_px)))
    made = image.copy()
    moved = np.roll(image, (down, right), axis=(1, 2))
    made[:, first:] = moved[:, first:]

    def by(px: FloatArray) -> FloatArray:
        moved, kept = (px[:, 1] + down >= first)[:, None], (px[:, 1] < first)[:, None]
        return np.where(moved, np.array([right, down]), np.where(kept, 0.0, np.nan))

    return made, by


def labelled(image: Image, rng: np.random.Generator) -> tuple[Image, Moved]:
    """Put labels and roads over the image."""
    put = OVERLAYS["labels and roads"](image.shape[1:], rng).change()
    scale = 255 / float(image.max())
    return _like(image, put((image * scale).astype(np.uint8)) / scale), _nowhere


def _like(image: Image, values: FloatArray) -> Image:
    limits = np.iinfo(image.dtype)
    made = np.clip(np.rint(values), 1, limits.max).astype(image.dtype)
    return np.where(image.any(axis=0), made, 0).astype(image.dtype)


# Group, attack, density, share of changed buildings in percent, change.
_ATTACKS: tuple[tuple[str, str, str, float, Change], ...] = (
    ("RPCs in a dense city", "-", "city", 0.0, as_it_is),
    ("RPCs in a dense city", "rebuilt", "city", 30.0, as_it_is),
    ("RPCs in a town", "urban", "urban", 0.0, as_it_is),
    ("RPCs in a town", "suburban", "suburban", 10.0, as_it_is),
    ("RPCs, noise over a town", "-", "suburban", 0.0, noisy),
    ("RPCs, a part lies off", "-", "rural", 0.0, lower_part),
    ("RPCs, a part lies off", "far", "rural", 0.0, partial(lower_part, between_px=(20.0, 70.0))),
    ("RPCs, labels", "-", "suburban", 0.0, labelled),
)


@dataclass(frozen=True)
class SensorCase:
    """An attack on one of the tools for sensor models."""

    attack: str
    variant: str
    tool: str
    seed: int
    cache: Path

    group = SENSOR
    scene = "sim-sensor"

    @property
    def name(self) -> str:
        """Name by which this case can be repeated."""
        return "/".join((self.attack, self.variant, self.scene, self.tool, str(self.seed)))

    def make(self, folder: Path) -> tuple[Path, Moved]:
        """Write the attacked scene into a folder; return the folder and how the content moved."""
        one = next(a for a in _ATTACKS if a[:2] == (self.attack, self.variant))
        rng = np.random.default_rng((zlib.crc32("/".join(one[:2]).encode()), self.seed))
        size = int(rng.integers(*_SIDES_PX))
        scene = self._simulated(one[2], one[3], size, float(1 + self.seed % 4))
        copytree(scene, folder, dirs_exist_ok=True)
        with rasterio.open(folder / "sensor.tif", "r+") as dataset:
            image, moved = one[4](dataset.read(), rng)
            dataset.write(image)
        return folder, moved

    def save(self, folder: Path) -> None:
        """Write the scene into a folder for inspection."""
        self.make(folder)

    def _simulated(self, density: str, changed: float, size: int, looks: float) -> Path:
        parts = density, changed, size, looks, self.seed, simulator_version()
        make = partial(
            groundtie.simulate_sensor,
            size=size,
            density=density,
            shift=_SHIFT_M,
            looks=looks,
            changed=changed,
            seed=self.seed,
        )
        return kept(self.cache / "-".join(map(str, ("attacked-sensor", *parts))), make)

    def run(self, workers: int | None) -> AttackOutcome:
        """Make the scene, call the tool, and judge what it wrote."""
        with tempfile.TemporaryDirectory() as temporary:
            scene, moved = self.make(Path(temporary) / "scene")
            wanted = RUNS[self.tool]
            output = Path(temporary) / wanted.output
            call = partial(wanted.call, scene, output, workers)
            result, outcome = attempted(self, "rpc", 0.0, "", call)
            if result is None:
                return outcome
            off = np.hypot(*errors_px(scene, output, moved).T)
            off = off[np.isfinite(off)]
        error_px = float(np.percentile(off, ERROR_PERCENTILE))
        return replace(
            outcome,
            verdict=judge(error_px),
            error_px=error_px,
            rmse_px=float(np.sqrt(np.mean(off**2))),
            claimed_ce90_px=result.summary()["verdict"].get("ce90_px") or math.nan,
        )


def errors_px(scene: Path, output: Path, moved: Moved) -> FloatArray:
    """Return the misses of a tool's output for the attacked image, as `misses_px` does."""
    return moved(image_positions(scene / "check_points.csv")) + misses_px(scene, output)


def sensor_cases(seeds: Sequence[int], cache: Path) -> list[SensorCase]:
    """Return every attack on every tool, ordered by seed."""
    return [
        SensorCase(attack, variant, tool, seed, cache)
        for seed in seeds
        for attack, variant, *_ in _ATTACKS
        for tool in TOOLS
    ]
