"""Rules on refined RPCs alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .rule import Rule

if TYPE_CHECKING:
    from ..refinement import RefinementEvidence

# Least share of each side of an image that control must span (suite rpc).
_SMALLEST_EXTENT = 0.25

# Largest error, in pixels, of new RPCs that a bias is folded into.
_LARGEST_FOLDING_PX = 0.01


def _narrow_control(evidence: RefinementEvidence) -> str | None:
    if not evidence.needs_spread or evidence.extent >= _SMALLEST_EXTENT:
        return None
    share = f"{100 * evidence.extent:.0f} %"
    return f"the control points spread over {share} of a side of the image only"


def _not_nearer(evidence: RefinementEvidence) -> str | None:
    before, after = evidence.before.rmse, evidence.after.rmse
    # Without inliers both are NaN, which refuses: nothing shows that the points are nearer.
    if before > after:
        return None
    name = evidence.held_out.name
    return f"{name} are not nearer than before: {after:.2f} px, {before:.2f} px as delivered"


def _not_folded(evidence: RefinementEvidence) -> str | None:
    if evidence.folding_px <= _LARGEST_FOLDING_PX:
        return None
    return f"RPCs cannot take up the bias: they miss it by {evidence.folding_px:.3f} px"


REFINEMENT_RULES: tuple[Rule, ...] = (
    Rule(
        "narrow control",
        f"control points spread over less than {_SMALLEST_EXTENT:.0%} of a side of the image, "
        "unless they are given by the user and only a shift is asked for",
        "suite rpc",
        "give control all over the image, or points of your own with --model shift",
        _narrow_control,
    ),
    Rule(
        "not nearer than before",
        "the refined RPCs place the held-out points no nearer than the delivered ones",
        "definition of a refinement",
        "keep the delivered RPCs",
        _not_nearer,
    ),
    Rule(
        "bias not folded",
        f"new RPCs miss the bias by more than {_LARGEST_FOLDING_PX:g} px",
        "a hundredth of a pixel is below what control measures",
        "give a simpler model of the bias",
        _not_folded,
    ),
)
