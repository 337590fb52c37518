"""Rules on stored tie points: whether a model follows from them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...geometry.judging import LARGEST_LOG10_CHANCE
from .rule import Rule

if TYPE_CHECKING:
    from ..tie_point_evidence import TiePointEvidence

# Largest move of the raster's border by an error of 1 px in stored tie points, as a share of its
# longer side. Beyond that, the raster would be distorted past recognition.
_LARGEST_BORDER_SPREAD = 0.1


def _points_too_near(evidence: TiePointEvidence) -> str | None:
    spread = evidence.border_spread_px
    if spread <= _LARGEST_BORDER_SPREAD * evidence.side_px:
        return None
    if not np.isfinite(spread):
        return f"the tie points lie so that no {evidence.kind} model follows from them"
    return (
        f"the tie points lie so near to each other, or to a line, that an error of 1 px moves the "
        f"raster's border by {spread:.0f} px"
    )


def _points_at_random(evidence: TiePointEvidence) -> str | None:
    chance = evidence.log10_chance
    if chance is None or chance <= LARGEST_LOG10_CHANCE:
        return None
    return f"the {evidence.count} tie points fit each other no better than random ones"


TIE_POINT_RULES: tuple[Rule, ...] = (
    Rule(
        "tie points too near",
        "an error of 1 px in stored tie points moves the border of the raster by more than "
        f"{_LARGEST_BORDER_SPREAD:.0%} of its longer side: they lie at one place or along a line",
        "leverage; [Hastie2009] 3.2",
        "give points all over the raster, or a simpler model",
        _points_too_near,
    ),
    Rule(
        "tie points at random",
        "as many random points would fit the model as well with a probability above "
        f"10^{LARGEST_LOG10_CHANCE:.0f}",
        "expected false alarms; [Moisan2004]",
        "take out points that are wrong, or give those of this raster",
        _points_at_random,
    ),
)
