"""Rules on bands, which share one transform: applied to every pair and to poses."""

from __future__ import annotations

from ...masks.used import INPUT, REFERENCE
from ..evidence import ImagesEvidence
from .rule import Rule


def _bands_apart(evidence: ImagesEvidence) -> str | None:
    scene = evidence.scene
    # A chosen band of the reference is matched alone; of the input, all are registered.
    sought = {INPUT: scene.input}
    if not scene.reference.has_chosen_band:
        sought[REFERENCE] = scene.reference
    for name, facts in sought.items():
        for shift in facts.band_shifts:
            if shift.apart_px > evidence.max_error_px:
                one, other = shift.bands
                off = f"show the ground {shift.apart_px:.1f} px apart"
                return f"bands {one} and {other} of the {name} {off}"
    return None


BANDS_RULES: tuple[Rule, ...] = (
    Rule(
        "bands apart",
        "a band of the input shows the ground farther off than the largest error from where the "
        "first band does; or a band of the reference does, if all of its bands are matched",
        "the user's largest error",
        "register the bands to one another first, or give an image of one band",
        _bands_apart,
        is_final=True,
    ),
)
