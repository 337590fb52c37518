"""Rules on the kinds of images, applied before matching and again to its result."""

from __future__ import annotations

from ...masks.used import LAYER, SURFACE
from ..evidence import ImagesEvidence
from .rule import ON_GROUND, Rule


def _ground_not_found(evidence: ImagesEvidence) -> str | None:
    scene = evidence.scene
    if evidence.mask.kind in (LAYER, SURFACE):
        return None
    if scene.is_despeckled_town:
        return "the radar image of a town has no speckle, by which its ground is found"
    if scene.is_town_of_unknown_size:
        return "the reference of a town has no CRS, and its ground is found by distances in metres"
    return None


IMAGES_RULES: tuple[Rule, ...] = (
    Rule(
        "ground not found",
        "a radar image of a town has no speckle, or the reference has no CRS; the ground of a town "
        "cannot be found without them",
        "suites city and coarse_towns",
        f"give the radar image unfiltered, and the reference a CRS; {ON_GROUND}",
        _ground_not_found,
        is_final=True,
    ),
)
