"""One attack on one tool: made, run and judged."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import groundtie

from ..accuracy import CORRECT, SILENTLY_WRONG, classify
from ..cases import SAR_OPTICAL, SAR_SAR
from ..rotated_pairs import LARGEST_ERROR_PX
from . import examples, ground, locked, noise, parts, placement, repetition
from .catalogue import DRAWS, LOCKED, Attack, Setting
from .pairs import Pair
from .scenes import Scene, scenes
from .sensors import SensorCase, sensor_cases
from .tries import AttackOutcome, attempted

ATTACKS: tuple[Attack, ...] = tuple(
    chain.from_iterable(
        module.ATTACKS for module in (locked, parts, noise, repetition, ground, placement, examples)
    )
)

_ANY = ("coregister", "register", "estimate_rotation")
TOOLS = {SAR_OPTICAL: _ANY, SAR_SAR: ("match_sar_sar", *_ANY)}
_CAMERA = "camera"
_CAMERAS = ("match_optical", *_ANY)

POSES = "estimate_rotation"
# Image width for which the limits of `rotated_pairs` hold.
_POSE_SIDE_PX = 256
_POSE_LIMITS = {kind.removesuffix("-rotated"): limit for kind, limit in LARGEST_ERROR_PX.items()}
_OTHER_POSE_LIMIT = min(_POSE_LIMITS.values())

# 90 of 100 errors in the plane lie within this factor times their root mean square σ.
_CE90_PER_RMS = math.sqrt(math.log(10))

# Controls with overlays, of which each seed takes half.
_HALVED = ("overlay on aligned ground",)

# Share of attacks that get a search radius without needing one, and the range of the radius.
_WITH_RADIUS = 0.4
_RADII_PX = (26.0, 45.0)

# Tools without a search radius.
_WITHOUT_RADIUS = ("register",)


def tools_of(kind: str) -> tuple[str, ...]:
    """Return the tools that register pairs of a kind."""
    return TOOLS.get(kind, _CAMERAS)


@dataclass(frozen=True)
class AttackCase:
    """An attack on a scene, and the tool under attack."""

    attack: str
    variant: str
    scene: str
    tool: str
    seed: int
    data: Path
    cache: Path

    @property
    def group(self) -> str:
        """Group of the attack."""
        return find(self.attack, self.variant).group

    @property
    def name(self) -> str:
        """Name by which this case can be repeated."""
        return "/".join((self.attack, self.variant or "-", self.scene, self.tool, str(self.seed)))

    def make(self) -> Pair:
        """Return the attacked pair, the same for all tools."""
        key = f"{self.attack}/{self.variant}/{self.scene}"
        rng = np.random.default_rng((zlib.crc32(key.encode()), self.seed))
        every = all_scenes(self.data)
        own = every[self.scene]
        pair = own.pair(self.seed, self.cache)
        others = [
            scene
            for scene in every.values()
            if not examples.is_example(scene) and scene.is_large == own.is_large
        ]
        setting = Setting(rng, others, self.seed, self.cache)
        attack = find(self.attack, self.variant)
        made = attack.make(pair, setting)
        if made.radius_px is None and not attack.is_example and rng.random() < _WITH_RADIUS:
            made = made.within(float(rng.uniform(*_RADII_PX)))
        return made

    def run(self, workers: int | None) -> AttackOutcome:
        """Make the pair, call the tool, and judge its result."""
        pair = self.make()
        arguments = {} if self.tool in _WITHOUT_RADIUS else pair.arguments()

        def call() -> Any:
            return getattr(groundtie, self.tool)(*pair.rasters(), workers=workers, **arguments)

        result, outcome = attempted(self, pair.kind, pair.sigma_px, pair.note, call)
        if result is None:
            return outcome
        error_px, rmse_px = pair.errors_px(result.transform)
        return replace(
            outcome,
            verdict=judge(self.tool, pair, error_px),
            error_px=error_px,
            rmse_px=rmse_px,
            claimed_ce90_px=result.verdict.accuracy.ce90_px,
        )

    def save(self, folder: Path) -> None:
        """Write the pair into a folder for inspection."""
        self.make().save(folder)


def judge(tool: str, pair: Pair, error_px: float) -> str:
    """Return the verdict on an accepted result; a pose is only a start, so it is right or wrong."""
    believed = pair.sigma_px * _CE90_PER_RMS
    if tool != POSES:
        return classify(True, error_px, believed)
    limit = _POSE_LIMITS.get(pair.kind, _OTHER_POSE_LIMIT) * max(pair.size) / _POSE_SIDE_PX
    return CORRECT if error_px <= limit + believed else SILENTLY_WRONG


@lru_cache
def all_scenes(data: Path) -> dict[str, Scene]:
    """Return all scenes by name, including the examples."""
    return {scene.name: scene for scene in (*scenes(data), *examples.scenes(data))}


def find(attack: str, variant: str) -> Attack:
    """Return an attack by its name."""
    return next(one for one in ATTACKS if (one.name, one.variant) == (attack, variant))


def named(name: str, data: Path, cache: Path) -> AttackCase | SensorCase:
    """Return the case with a name.

    Raises
    ------
    ValueError
        The name does not have the form of a case's name.
    """
    words = name.split("/")
    if len(words) != 5 or not words[-1].isdigit():
        raise ValueError(f"no case {name!r}: attack/variant/scene/tool/seed")
    attack, variant, scene, tool, seed = words
    if scene == SensorCase.scene:
        return SensorCase(attack, variant, tool, int(seed), cache)
    variant = "" if variant == "-" else variant
    return AttackCase(attack, variant, scene, tool, int(seed), data, cache)


def cases(
    seeds: Sequence[int], data: Path, cache: Path, large: bool = False
) -> list[AttackCase | SensorCase]:
    """Return the cases: each seed draws scenes for each attack and tries them on all tools.

    Images with RPCs have one size, so `large` leaves them out.
    """
    made: list[AttackCase | SensorCase] = [] if large else list(sensor_cases(seeds, cache))
    every = all_scenes(data)
    for seed in seeds:
        for number, attack in enumerate(ATTACKS):
            # There are many overlays: each seed takes every other one.
            is_overlay = attack.group == LOCKED or attack.name in _HALVED
            if (is_overlay and (number + seed) % 2) or (attack.is_example and seed != seeds[0]):
                continue
            key = zlib.crc32(f"{attack.group}/{attack.name}/{attack.variant}".encode())
            rng = np.random.default_rng((key, seed))
            fitting = [
                scene
                for scene in every.values()
                if attack.fits(scene)
                and examples.is_example(scene) == attack.is_example
                and scene.is_large == large
            ]
            draws = DRAWS.get(attack.group, 1) if fitting else 0
            names = dict.fromkeys(draw_scene(fitting, rng).name for _ in range(draws))
            made += [
                AttackCase(attack.name, attack.variant, name, tool, seed, data, cache)
                for name in names
                for tool in tools_of(every[name].kind)
            ]
    return made


def draw_scene(fitting: Sequence[Scene], rng: np.random.Generator) -> Scene:
    """Draw a scene: first the kind of pair, real or simulated, then the scene."""
    groups: dict[str, list[Scene]] = {}
    for scene in fitting:
        kind = scene.kind if scene.kind in TOOLS else _CAMERA
        groups.setdefault(f"{kind} {scene.case is None}", []).append(scene)
    # Most real pairs are of cameras: their groups count twice.
    names = sorted(groups) + [name for name in groups if name.startswith(_CAMERA)]
    group = groups[names[int(rng.integers(len(names)))]]
    return group[int(rng.integers(len(group)))]
