"""Whether a pose stands out so far that it cannot be chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ..context import Context
from ..geometry.limits import SearchLimits
from ..rasters.patch import Patch
from ..similarity.surface import SimilaritySettings
from .pose import PoseFound
from .search import find_poses, moved_px

# Limits of the two rules below. Measured on 29 real pairs (right poses: height ≥ 6.2, ratio ≥ 1.8)
# and 115 of different places (where the height passed: ratio ≤ 1.45); docs/estimate-rotation.md.
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
        Height of the best pose of an exhaustive search, in robust standard deviations.
    rival_ratio
        Its height over that of the best one elsewhere; None if nothing was found.
    """

    accepted: bool
    reason: str
    height: float = 0.0
    rival_ratio: float | None = None

    def summary(self) -> dict[str, Any]:
        """Return the verdict as values that JSON can carry."""
        return asdict(self)


def refuse_by_height(height: float) -> str | None:
    """Return why a peak may be chance, or None: it is at least `LEAST_HEIGHT` high."""
    return (
        f"the best pose is no higher than chance ({height:.1f})" if height < LEAST_HEIGHT else None
    )


def refuse_by_rival(ratio: float) -> str | None:
    """Return why a pose is ambiguous, or None: it is `LEAST_RIVAL_RATIO` times its rival's height.

    The rival is the best pose elsewhere; repetitive scenes have one.
    """
    if ratio < LEAST_RIVAL_RATIO:
        return f"another pose matches about as well (1 : {1 / ratio:.2f})"
    return None


def judge_pose(
    reference: Patch,
    input: Patch,
    limits: SearchLimits,
    found: Sequence[PoseFound],
    exhaustive: bool,
    context: Context,
) -> PoseVerdict:
    """Judge the best candidate of a search by an exhaustive one over all rotations.

    Rotations beyond the limits measure how high chance is, and may hold a better pose.

    Parameters
    ----------
    reference, input
        The windows.
    limits
        Those of the search.
    found
        What the search found, best first.
    exhaustive
        Whether the search was `find_poses`; it is not repeated if it was over all rotations.
    context
        Threads to work in.
    """
    if not found:
        return PoseVerdict(False, "nothing in common was found")
    everything = found
    if not exhaustive or limits.rotation_deg < 180:
        low, high = limits.scale
        wide = SearchLimits(limits.radius, 180.0, (min(low, 0.8), max(high, 1.25)))
        everything = find_poses(reference, input, wide, SimilaritySettings(), context)
    if len(everything) < 2:
        return PoseVerdict(False, "the images hold too little to judge by")
    best = everything[0]
    ratio = best.height / everything[1].height
    reason = (
        refuse_by_height(best.height)
        or refuse_by_rival(ratio)
        or _refuse_other(found[0], best, reference)
    )
    if reason is None:
        return PoseVerdict(True, "no other pose matches nearly as well", best.height, ratio)
    return PoseVerdict(False, reason, best.height, ratio)


def _refuse_other(found: PoseFound, best: PoseFound, reference: Patch) -> str | None:
    """Return why a pose is not that of the exhaustive search, or None: it is."""
    rows, cols = reference.values.shape
    apart = moved_px(best.pose, found.pose, (rows, cols))
    if apart <= _SAME_SHARE * max(rows, cols):
        return None
    return (
        f"a search over all rotations prefers {best.pose.rotation_deg:.1f}° and scale "
        f"{best.pose.scale:.3f}, {apart:.0f} px away"
    )
