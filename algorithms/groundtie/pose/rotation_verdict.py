"""Whether a pose stands out so far that it cannot be chance."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from typing import Any

from ..rasters.patch import Patch
from ..similarity.surface import SimilaritySettings
from .pose import PoseFound, PoseLimits
from .rotation_steps import moved_px, rotation_steps

# Measured: see docs/estimate-rotation.md.
LEAST_HEIGHT = 5.0
LEAST_RIVAL_RATIO = 1.6

# A pose is that of the exhaustive search if it moves the reference's corners by less than this
# share of its longer side.
_SAME_SHARE = 0.02


@dataclass(frozen=True)
class PoseVerdict:
    """Whether a pose can be trusted.

    Parameters
    ----------
    accepted
        Whether it can.
    reason
        Why, or why not, in a sentence.
    height
        How far the best pose of an exhaustive search stands out, in robust standard deviations.
    rival_ratio
        Its height over that of the best one elsewhere; None if nothing was found.
    """

    accepted: bool
    reason: str
    height: float
    rival_ratio: float | None

    def summary(self) -> dict[str, Any]:
        """Return the verdict as values that JSON can carry."""
        return asdict(self)


def judge_pose(
    reference: Patch,
    input: Patch,
    limits: PoseLimits,
    found: Sequence[PoseFound],
    exhaustive: bool,
    executor: Executor | None = None,
) -> PoseVerdict:
    """Judge the best candidate of a search by an exhaustive one over all rotations.

    Rotations beyond the limits tell how high chance is, and another pose that they may hide.

    Parameters
    ----------
    reference, input
        The windows.
    limits
        Those of the search.
    found
        What the search found, best first.
    exhaustive
        Whether the search was `rotation_steps`; it is not repeated if it was over all rotations.
    executor
        Threads to work in.
    """
    if not found:
        return PoseVerdict(False, "nothing in common was found", 0.0, None)
    everything = found
    if not exhaustive or limits.rotation_deg < 180:
        low, high = limits.scale
        wide = PoseLimits(limits.radius_px, 180.0, (min(low, 0.8), max(high, 1.25)))
        everything = rotation_steps(reference, input, wide, SimilaritySettings(), executor)
    if len(everything) < 2:
        return PoseVerdict(False, "the images hold too little to judge by", 0.0, None)
    best = everything[0]
    ratio = best.height / everything[1].height
    rows, cols = reference.values.shape
    apart = moved_px(best.pose, found[0].pose, (rows, cols))
    if best.height < LEAST_HEIGHT:
        reason = f"the best pose is no higher than chance ({best.height:.1f})"
    elif ratio < LEAST_RIVAL_RATIO:
        reason = f"another pose matches about as well (1 : {1 / ratio:.2f})"
    elif apart > _SAME_SHARE * max(rows, cols):
        reason = (
            f"a search over all rotations prefers {best.pose.rotation_deg:.1f}° and scale "
            f"{best.pose.scale:.3f}, {apart:.0f} px away"
        )
    else:
        return PoseVerdict(True, "no other pose matches nearly as well", best.height, ratio)
    return PoseVerdict(False, reason, best.height, ratio)
