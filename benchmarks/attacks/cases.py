"""One attack on one tool: made, run and judged."""

from __future__ import annotations

import math
import time
import traceback
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import groundtie
from groundtie.errors import GroundTieError, NotRegisteredError

from ..accuracy import CORRECT, CRASHED, REFUSED, SILENTLY_WRONG, classify
from ..cases import SAR_OPTICAL
from ..rotated_pairs import LARGEST_ERROR_PX
from . import examples, ground, locked, noise, parts, placement, repetition
from .catalogue import Attack, Setting
from .pairs import Pair
from .scenes import SAR_SAR, Scene, scenes

ATTACKS: tuple[Attack, ...] = tuple(
    chain.from_iterable(
        module.ATTACKS for module in (locked, parts, noise, repetition, ground, placement, examples)
    )
)

_ANY = ("coregister", "register", "estimate_rotation")
TOOLS = {SAR_OPTICAL: _ANY, SAR_SAR: ("match_sar_sar", *_ANY)}
_CAMERAS = ("match_optical", *_ANY)

POSES = "estimate_rotation"
# Widths of the images that the limits of `rotated_pairs` are for.
_POSE_SIDE_PX = 256
_POSE_LIMITS = {kind.removesuffix("-rotated"): limit for kind, limit in LARGEST_ERROR_PX.items()}
_OTHER_POSE_LIMIT = min(_POSE_LIMITS.values())

# A tool without a radius looks where it likes.
_WITHOUT_RADIUS = ("register",)


def tools_of(kind: str) -> tuple[str, ...]:
    """Return the tools that register pairs of a kind."""
    return TOOLS.get(kind, _CAMERAS)


@dataclass(frozen=True)
class AttackOutcome:
    """What became of one attack.

    Parameters
    ----------
    name, group, attack, variant, scene, kind, tool, seed
        Which case.
    verdict
        One of `accuracy.VERDICTS`.
    error_px, rmse_px
        What 90 % of the errors do not exceed, and their root mean square; NaN if refused.
    claimed_ce90_px
        What the tool itself claims for the former.
    rule, reason
        What refused it, and what the tool said.
    note
        What was drawn.
    seconds
        Wall-clock time of the call.
    """

    name: str
    group: str
    attack: str
    variant: str
    scene: str
    kind: str
    tool: str
    seed: int
    verdict: str
    error_px: float
    rmse_px: float
    claimed_ce90_px: float
    rule: str
    reason: str
    note: str
    seconds: float

    def record(self) -> dict[str, Any]:
        """Return the outcome as values that JSON can carry."""
        return {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in asdict(self).items()
        }

    def line(self) -> str:
        """Return the outcome as a line of text."""
        error = "" if math.isnan(self.error_px) else f" {self.error_px:.2f} px"
        why = self.rule or self.reason
        return f"{self.name}: {self.verdict}{error} in {self.seconds:.1f} s; {why}; {self.note}"


@dataclass(frozen=True)
class AttackCase:
    """An attack on a scene, and the tool that is to be deceived."""

    attack: str
    variant: str
    scene: str
    tool: str
    seed: int
    data: Path
    cache: Path

    @property
    def name(self) -> str:
        """What repeats it alone."""
        return "/".join((self.attack, self.variant or "-", self.scene, self.tool, str(self.seed)))

    def make(self) -> Pair:
        """Return the attacked pair, the same for all tools."""
        key = f"{self.attack}/{self.variant}/{self.scene}"
        rng = np.random.default_rng((zlib.crc32(key.encode()), self.seed))
        every = all_scenes(self.data)
        pair = every[self.scene].pair(self.seed, self.cache)
        others = [scene for name, scene in every.items() if not examples.is_example(scene)]
        setting = Setting(rng, others, self.cache)
        return find(self.attack, self.variant).make(pair, setting)

    def run(self, workers: int | None) -> AttackOutcome:
        """Make the pair, let the tool try, and judge what it says."""
        pair = self.make()
        arguments = {} if self.tool in _WITHOUT_RADIUS else dict(pair.arguments)
        started = time.perf_counter()
        try:
            result = getattr(groundtie, self.tool)(*pair.rasters(), workers=workers, **arguments)
        except NotRegisteredError as refusal:
            verdict = refusal.verdict
            rule = "" if verdict is None else verdict.rule
            reason = str(refusal) if verdict is None else verdict.reason
            return self._outcome(pair, started, REFUSED, rule=rule, reason=reason)
        except GroundTieError as error:
            # Bad input, named in one line.
            return self._outcome(pair, started, REFUSED, rule="bad input", reason=str(error))
        except Exception as error:
            # A finding like any other: it is counted, and `run.py` exits with 1.
            traceback.print_exc()
            return self._outcome(pair, started, CRASHED, reason=repr(error))
        error_px, rmse_px = pair.errors_px(result.transform)
        claimed = getattr(result.verdict, "check_ce90_px", math.nan)
        return self._outcome(
            pair,
            started,
            judge(self.tool, pair, error_px),
            error_px,
            rmse_px,
            claimed,
            reason=result.verdict.reason,
        )

    def _outcome(
        self,
        pair: Pair,
        started: float,
        verdict: str,
        error_px: float = math.nan,
        rmse_px: float = math.nan,
        claimed: float = math.nan,
        rule: str = "",
        reason: str = "",
    ) -> AttackOutcome:
        return AttackOutcome(
            self.name,
            find(self.attack, self.variant).group,
            self.attack,
            self.variant,
            self.scene,
            pair.kind,
            self.tool,
            self.seed,
            verdict,
            error_px,
            rmse_px,
            claimed,
            rule,
            reason,
            pair.note,
            time.perf_counter() - started,
        )


def judge(tool: str, pair: Pair, error_px: float) -> str:
    """Return what an accepted result is; a pose is a start, and right or wrong."""
    if tool != POSES:
        return classify(True, error_px, pair.sigma_px)
    limit = _POSE_LIMITS.get(pair.kind, _OTHER_POSE_LIMIT) * max(pair.size) / _POSE_SIDE_PX
    return CORRECT if error_px <= max(limit, pair.sigma_px + 1) else SILENTLY_WRONG


@lru_cache
def all_scenes(data: Path) -> dict[str, Scene]:
    """Return all scenes by name, the examples, too."""
    return {scene.name: scene for scene in (*scenes(data), *examples.scenes(data))}


def find(attack: str, variant: str) -> Attack:
    """Return an attack by its name."""
    return next(one for one in ATTACKS if (one.name, one.variant) == (attack, variant))


def named(name: str, data: Path, cache: Path) -> AttackCase:
    """Return the case of a name.

    Raises
    ------
    ValueError
        There is none.
    """
    words = name.split("/")
    if len(words) != 5 or not words[-1].isdigit() or words[2] not in all_scenes(data):
        raise ValueError(f"no case {name!r}: attack/variant/scene/tool/seed")
    attack, variant, scene, tool, seed = words
    return AttackCase(
        attack, "" if variant == "-" else variant, scene, tool, int(seed), data, cache
    )


def cases(seeds: Sequence[int], data: Path, cache: Path) -> list[AttackCase]:
    """Return the cases: each seed draws a scene for each attack, which is tried on all tools."""
    made = []
    every = all_scenes(data)
    for seed in seeds:
        for attack in ATTACKS:
            key = zlib.crc32(f"{attack.group}/{attack.name}/{attack.variant}".encode())
            rng = np.random.default_rng((key, seed))
            fitting = [
                scene
                for scene in every.values()
                if attack.fits(scene) and examples.is_example(scene) == attack.is_example
            ]
            if not fitting or (attack.is_example and seed != seeds[0]):
                continue
            scene = draw_scene(fitting, rng)
            made += [
                AttackCase(attack.name, attack.variant, scene.name, tool, seed, data, cache)
                for tool in tools_of(scene.kind)
            ]
    return made


def draw_scene(fitting: Sequence[Scene], rng: np.random.Generator) -> Scene:
    """Return a scene: each kind of pair, and simulated ones, as likely."""
    groups: dict[str, list[Scene]] = {}
    for scene in fitting:
        kind = scene.kind if scene.kind in TOOLS else "camera"
        groups.setdefault(f"{kind} {scene.case is None}", []).append(scene)
    group = list(groups.values())[int(rng.integers(len(groups)))]
    return group[int(rng.integers(len(group)))]
