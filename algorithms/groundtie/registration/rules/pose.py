"""Rules on a pose: rotation, scale and shift."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .rule import Rule

if TYPE_CHECKING:
    from ..pose_verdict import PoseEvidence

# Height of a pose above chance, and its ratio to the height of the best pose elsewhere. Measured on
# 29 real pairs (correct poses: height ≥ 6.2, ratio ≥ 1.8) and 115 pairs of different places (where
# the height passed: ratio ≤ 1.45; suite rotated_pairs). Poses are the same if they place the
# reference's corners apart by no more than `SAME_SHARE` of its longer side.
LEAST_HEIGHT = 5.0
_LEAST_RIVAL_RATIO = 1.6
SAME_SHARE = 0.02


def _no_pose(evidence: PoseEvidence) -> str | None:
    if not evidence.found:
        return "nothing in common was found"
    if evidence.rival_ratio is None:
        return "the images hold too little to judge by"
    if evidence.height < LEAST_HEIGHT:
        return f"the best pose is no higher than chance ({evidence.height:.1f})"
    return None


def _second_pose(evidence: PoseEvidence) -> str | None:
    ratio = evidence.rival_ratio
    if ratio is None or ratio >= _LEAST_RIVAL_RATIO:
        return None
    return f"another pose matches about as well (1 : {1 / ratio:.2f})"


def _not_exhaustive(evidence: PoseEvidence) -> str | None:
    if evidence.apart_px <= SAME_SHARE * max(evidence.shape):
        return None
    best = evidence.exhaustive[0].pose
    return (
        f"a search over all rotations prefers {best.rotation_deg:.1f}° and scale "
        f"{best.scale:.3f}, {evidence.apart_px:.0f} px away"
    )


POSE_RULES: tuple[Rule, ...] = (
    Rule(
        "pose by chance",
        f"the best rotation, scale and shift are less than {LEAST_HEIGHT:g} robust standard "
        "deviations above chance",
        "suite rotated_pairs",
        "check the band and the overlap; give wider limits of rotation, scale and shift",
        _no_pose,
    ),
    Rule(
        "second pose",
        f"the best pose is less than {_LEAST_RIVAL_RATIO:g} times as high as the best one "
        "elsewhere",
        "suite rotated_pairs",
        "give a larger part of the scene, or limit rotation and scale to what is possible",
        _second_pose,
    ),
    Rule(
        "other pose",
        "an exhaustive search over all rotations, and shifts of up to a quarter of the input, "
        f"finds another pose, whose corners lie more than {SAME_SHARE:.0%} of the reference's "
        "longer side off",
        "suite rotated_pairs",
        "allow larger rotations and shifts",
        _not_exhaustive,
    ),
)
