"""The verdict on a pose: whether it stands out so far that it cannot be chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..context import Context
from ..geometry.limits import SearchLimits
from ..matching.locked import Sameness, sameness_near
from ..pose.pose import Pose, PoseFound
from ..pose.search import find_poses, moved_px
from ..rasters.patch import Patch
from ..similarity.surface import SimilaritySettings
from .evidence import POSE
from .verdict import first_refusal

# A pose is a shift if rotation and scale move no corner by more, in pixels: it is no better known.
_SHIFT_PX = 6.0


@dataclass(frozen=True)
class PoseEvidence:
    """What is known of a pose.

    Parameters
    ----------
    found
        The poses that a search found, best first.
    exhaustive
        Those of an exhaustive search over all rotations, best first.
    shape
        Rows and columns of the reference.
    sameness
        How much both have the same where the pose does no more than move the array; None: it does.
    """

    found: Sequence[PoseFound]
    exhaustive: Sequence[PoseFound]
    shape: tuple[int, int]
    sameness: Sameness | None = None

    stages: ClassVar = (POSE,)

    @property
    def height(self) -> float:
        """Height of the best exhaustive pose, in robust standard deviations."""
        return self.exhaustive[0].height if self.exhaustive else 0.0

    @property
    def rival_ratio(self) -> float | None:
        """Its height over that of the best one elsewhere; None if there is none."""
        if len(self.exhaustive) < 2:
            return None
        return self.exhaustive[0].height / self.exhaustive[1].height

    @property
    def apart_px(self) -> float:
        """By how much the found pose moves the reference's corners against the exhaustive one."""
        return moved_px(self.exhaustive[0].pose, self.found[0].pose, self.shape)


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
    rule, advice
        See `Verdict`.
    """

    accepted: bool
    reason: str
    height: float = 0.0
    rival_ratio: float | None = None
    rule: str = ""
    advice: str = ""

    def summary(self) -> dict[str, Any]:
        """Return the verdict as values that JSON can carry."""
        return asdict(self)


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
    everything = found
    if found and (not exhaustive or limits.rotation_deg < 180):
        low, high = limits.scale
        wide = SearchLimits(limits.radius, 180.0, (min(low, 0.8), max(high, 1.25)))
        everything = find_poses(reference, input, wide, SimilaritySettings(), context)
    rows, cols = reference.values.shape
    sameness = _sameness(reference, input, found[0].pose) if found else None
    evidence = PoseEvidence(found, everything, (rows, cols), sameness)
    refusal = first_refusal(evidence)
    height, ratio = evidence.height, evidence.rival_ratio
    if refusal is None:
        return PoseVerdict(True, "no other pose matches nearly as well", height, ratio)
    rule, reason = refusal
    return PoseVerdict(False, reason, height, ratio, rule.name, rule.advice)


def _sameness(reference: Patch, input: Patch, pose: Pose) -> Sameness | None:
    """Return how much two images have the same under a pose; None: it is no shift of the array."""
    shapes = reference.values.shape, input.values.shape
    shift = replace(pose, rotation_deg=0.0, scale=1.0)
    if moved_px(pose, shift, shapes[0]) > _SHIFT_PX:
        return None
    between = shift.between(*shapes)
    return sameness_near(reference, input, np.rint([between.c, between.f]).astype(int))
