"""One shift of a whole dense city, as in [Suri2010]: the effect of masks of the radar image.

The input is resampled by the truth, so that every peak off 0 is an error on the ground.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.geometry.transform import load_transform
from groundtie.masks.ground import find_ground
from groundtie.masks.regions import find_regions
from groundtie.masks.scene import Scene, Select
from groundtie.masks.threshold import ThresholdMask
from groundtie.progress import SILENT
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration.user_masks import drawn_mask
from groundtie.similarity.peak import find_peak
from groundtie.similarity.surface import SimilaritySettings, describe, similarity_surface

from .attempt import Pair
from .city import city
from .suites import Goal, Settings, SuiteResult, Table

# [Suri2010] searched 20 m around the expected shift.
RADIUS_PX = 20
SIMILARITIES = ("nmi", "orientation", "fused")
PLAIN = "no mask"


def by_threshold(percent: float) -> Callable[[Scene], Select]:
    """Return a mask of the brightest percent, as a function of the scene."""
    return lambda scene: ThresholdMask.of(scene, percent).select


def by_regions(width_m: float) -> Callable[[Scene], Select]:
    """Return a mask of all but regions on the ground, as a function of the scene."""
    return lambda scene: find_regions(scene, width_m).select


MASKS: dict[str, Callable[[Scene], Select] | None] = {
    PLAIN: None,
    **{f"brightest {p} %": by_threshold(p) for p in (5, 10, 20, 30, 40, 50)},
    **{f"regions, {w} m": by_regions(w) for w in (5, 11, 19)},
    "ground": lambda scene: find_ground(scene).select,
}


@dataclass(frozen=True)
class Found:
    """Offset of a similarity's peak from the ground truth, in pixels (right, down)."""

    seed: int
    mask: str
    similarity: str
    right_px: float
    down_px: float

    @property
    def error_px(self) -> float:
        """Length of the error."""
        return float(np.hypot(self.right_px, self.down_px))

    def record(self) -> dict[str, Any]:
        """Return this as values that JSON can carry."""
        return vars(self) | {"error_px": self.error_px}


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    found: list[Found] = []
    for seed in settings.seed_numbers():
        found += of_seed(seed, settings.cache)
        print(f"city, seed {seed}: {len(found)} peaks", flush=True)
    cells = {
        (mask, similarity): [
            f.error_px for f in found if (f.mask, f.similarity) == (mask, similarity)
        ]
        for mask in MASKS
        for similarity in SIMILARITIES
    }
    return SuiteResult(
        "One shift of a whole city, by mask",
        [stability(cells)],
        (table(cells),),
        [f.record() for f in found],
        (
            "Distance of the peak from the ground truth, in pixels of 1 m: median, and in "
            f"brackets the share of the seeds within 1 px; shifts of up to {RADIUS_PX} px.",
        ),
    )


def of_seed(seed: int, cache: Path) -> list[Found]:
    """Return the peaks of all masks and similarities on one city."""
    pair = city(seed).pair(cache)
    truth = load_transform(pair.reference.parent / "truth.json")
    found = []
    with ExitStack() as stack:
        images = opened(pair, stack)
        scene = Scene.of(images.reference.source)
        input = images.input_patch(images.reference.source.grid, truth)
        for name, mask in MASKS.items():
            masked = images if mask is None else masked_by(images, scene, mask(scene), stack)
            reference = masked.reference_patch(scene.grid)
            for similarity in SIMILARITIES:
                how = SimilaritySettings(similarity)
                there, here = (describe(p, p.values.size, how) for p in (reference, input))
                surface = similarity_surface(there.inner(RADIUS_PX), here, RADIUS_PX, how)
                found.append(Found(seed, name, similarity, *find_peak(surface).shift_px))
    return found


def opened(pair: Pair, stack: ExitStack) -> ImagePair:
    """Return the images of a pair; the stack keeps them open."""
    paths = pair.reference, pair.input
    return make_pair(*(Image(stack.enter_context(open_raster(path))) for path in paths))


def masked_by(images: ImagePair, scene: Scene, select: Select, stack: ExitStack) -> ImagePair:
    """Return a pair whose reference is masked."""
    mask, _ = drawn_mask(scene, select, stack, SILENT)
    return replace(images, reference=replace(images.reference, mask=mask))


def stability(cells: Mapping[tuple[str, str], list[float]]) -> Goal:
    """Return whether thresholds of 10 to 40 % agree with each other, as in [Suri2010] 5.3.1."""
    medians = [float(np.median(cells[f"brightest {p} %", "fused"])) for p in (10, 20, 30, 40)]
    text = ", ".join(f"{median:.1f}" for median in medians)
    return Goal("Median errors for thresholds of 10, 20, 30, 40 %, fused", "reported", text, None)


def table(cells: Mapping[tuple[str, str], list[float]]) -> Table:
    """Return the table of all masks and similarities."""
    rows = [
        [mask, *(_cell(cells[mask, similarity]) for similarity in SIMILARITIES)] for mask in MASKS
    ]
    return Table("Error on the ground (px)", ("mask", *SIMILARITIES), rows)


def _cell(errors: list[float]) -> str:
    return f"{np.median(errors):.1f} ({np.mean(np.array(errors) <= 1.0):.0%})"
