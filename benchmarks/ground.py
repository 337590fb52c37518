"""Recall and precision of `mask-ground` on the ground of simulated cities."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.geometry.views import View
from groundtie.masks.ground import find_ground
from groundtie.masks.object_heights import RasterModel
from groundtie.masks.scene import Scene
from groundtie.masks.surface_model import SurfaceGround
from groundtie.rasters.reading import Mask, open_raster
from groundtie.simulation import files

from .city import city
from .suites import Goal, Settings, SuiteResult, Table


@dataclass(frozen=True)
class FoundGround:
    """A mask compared with the ground that ray casting finds in the simulator's heights.

    Parameters
    ----------
    seed
        The city.
    share
        Share of the image that the mask keeps.
    radar_precision
        Share of the mask that is ground visible to the radar, free of layover and radar shadow.
    precision, recall
        Precision: share of the mask that is ground visible in both images, outside cast shadow.
        Recall: share of this ground that the mask keeps.
    """

    seed: int
    share: float
    radar_precision: float
    precision: float
    recall: float

    @classmethod
    def of(cls, seed: int, mask: Mask, radar: Mask, both: Mask) -> FoundGround:
        """Compare a mask with the ground visible to the radar, and visible in both images."""
        return cls(
            seed,
            float(mask.mean()),
            float(radar[mask].mean()) if mask.any() else float("nan"),
            float(both[mask].mean()) if mask.any() else float("nan"),
            float(mask[both].mean()) if both.any() else float("nan"),
        )

    def record(self) -> dict[str, Any]:
        """Return this as values that JSON can carry."""
        return dict(vars(self))


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    found = []
    for seed in settings.seed_numbers():
        found.append(of_seed(seed, settings.cache))
        print(f"city, seed {seed}: {found[-1].share:.0%} of the image", flush=True)
    return SuiteResult(
        "Ground that is found in simulated dense cities",
        [goal(found)],
        (table(found),),
        [f.record() for f in found],
        ("Truth: ray casting in the simulator's heights, changes between the images left out.",),
    )


def of_seed(seed: int, cache: Path) -> FoundGround:
    """Return the mask that `coregister` makes of a city, compared with the ground."""
    pair = city(seed).pair(cache)
    views = [View.of(path, None) for path in (pair.reference, pair.input)]
    with ExitStack() as stack:
        reference, heights = (
            stack.enter_context(open_raster(path))
            for path in (pair.reference, pair.reference.parent / files.NAMES["dsm"])
        )
        scene = Scene.of(reference)
        ground = find_ground(scene)
        radar, both = (
            SurfaceGround(scene, RasterModel(heights), tuple(v for v in seen if v is not None))
            for seen in (views[:1], views)
        )
        return FoundGround.of(
            seed,
            ground.select(scene.whole).part,
            radar.select(scene.whole).part,
            both.select(scene.whole).part,
        )


def goal(found: Sequence[FoundGround]) -> Goal:
    """Return the goal on the medians of all cities."""
    precision, recall = (
        float(np.median([getattr(f, name) for f in found])) for name in ("precision", "recall")
    )
    return Goal(
        "Median precision and recall", "reported", f"{precision:.0%} and {recall:.0%}", None
    )


def table(found: Sequence[FoundGround]) -> Table:
    """Return a table with a row for each city."""
    head = ("seed", "share kept", "ground to the radar", "ground to both", "of both, kept")
    rows = [
        [str(f.seed)] + [f"{s:.0%}" for s in (f.share, f.radar_precision, f.precision, f.recall)]
        for f in found
    ]
    return Table("By city", head, rows)
