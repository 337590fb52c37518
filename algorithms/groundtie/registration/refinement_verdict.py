"""The verdict on refined RPCs: better than before at points that took no part, or refused."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from ..assessment.statistics import Statistics
from ..geometry.chance import agreement_probability, log10_chance
from ..geometry.judging import (
    CE90_FACTOR,
    FEWEST_CHECK_POINTS,
    LARGEST_LOG10_CHANCE,
    SMALLEST_INLIER_SHARE,
    TOLERANCE_PX,
    sigma_range_px,
)
from ..geometry.robust import fit_mixture
from ..sensor.adjustment import Adjustment, Control
from ..sensor.bias import Bias
from .verdict import Verdict

FloatArray = NDArray[np.float64]

# Control must spread over so much of each side of the image.
_SMALLEST_EXTENT = 0.25

# Wrong points lie within this distance at least, in pixels.
_LEAST_REACH_PX = 50

_NODES = 9


@dataclass(frozen=True)
class RefinementVerdict:
    """Whether refined RPCs can be trusted.

    Parameters
    ----------
    verdict
        The verdict, its errors in image pixels and in metres on the ground.
    before, after
        Errors at the held-out points that agree, by the RPCs as delivered and as refined, px.
    held_out
        Which points were held out: "check points", or "points left out in turn".
    """

    verdict: Verdict
    before: Statistics
    after: Statistics
    held_out: str

    def summary(self) -> dict[str, Any]:
        """Return the verdict as values that JSON can carry."""
        numbers = {"before": self.before, "after": self.after}
        return {
            **self.verdict.summary(),
            "held_out": self.held_out,
            **{
                name: {
                    key: value if math.isfinite(value) else None
                    for key, value in statistics.summary("px", ("col", "row")).items()
                }
                for name, statistics in numbers.items()
            },
        }


def judge_refinement(
    control: Control,
    adjustment: Adjustment,
    check: Control | None,
    pixel_m: float,
    max_error_px: float,
) -> RefinementVerdict:
    """Judge a bias that was estimated.

    Parameters
    ----------
    control
        The points of the fit.
    adjustment
        What was fitted to them.
    check
        Points that took no part; None: there are none, so that each point of the fit is judged by
        a fit without it and its neighbours.
    pixel_m
        Side of an image pixel on the ground.
    max_error_px
        Largest root mean square error at held-out points.
    """
    if check is None or len(check) < FEWEST_CHECK_POINTS:
        held_out, before, after = (
            "points left out in turn",
            control.residuals_px(None),
            adjustment.left_out_px,
        )
    else:
        held_out, before, after = (
            "check points",
            check.residuals_px(None),
            check.residuals_px(adjustment.bias),
        )
    length = np.hypot(*after.T)
    reach = max(int(np.ceil(length.max(initial=0.0))), _LEAST_REACH_PX)
    mixture = fit_mixture(after, (2 * reach + 1) ** 2, sigma_range_px(max_error_px))
    right = mixture.right
    agreeing = int((length <= max(TOLERANCE_PX, max_error_px)).sum())
    probability = agreement_probability(max(TOLERANCE_PX, max_error_px), reach)
    chance = log10_chance(agreeing, len(after), probability)
    rmse = mixture.sigma * math.sqrt(2)
    ce90 = mixture.sigma * CE90_FACTOR
    spread = _spread_px(adjustment, control.size)
    extent = _extent(control.found_px[adjustment.used], control.size)
    worse = _rms(before[right]) <= _rms(after[right])
    reasons = (
        (chance > LARGEST_LOG10_CHANCE or agreeing < FEWEST_CHECK_POINTS,
         f"{agreeing} of {len(after)} {held_out} agree, as they may by chance"),
        (agreeing < SMALLEST_INLIER_SHARE * len(after),
         f"only {agreeing} of {len(after)} {held_out} agree"),
        (extent < _SMALLEST_EXTENT,
         f"the control points spread over {100 * extent:.0f} % of a side of the image only"),
        (rmse > max_error_px,
         f"error at {held_out} is {rmse:.2f} px, above {max_error_px:g} px"),
        (spread > max_error_px,
         f"the points do not hold the model: it varies by {spread:.2f} px over the image"),
        (worse,
         f"{held_out} are not nearer than before: {_rms(after[right]):.2f} px, "
         f"{_rms(before[right]):.2f} px as delivered"),
    )  # fmt: skip
    reason = next((why for wrong, why in reasons if wrong), None)
    verdict = Verdict(
        reason is None,
        reason or f"{held_out} confirm the refined RPCs",
        len(control),
        int(adjustment.used.sum()),
        len(after),
        agreeing,
        rmse,
        rmse * pixel_m,
        ce90,
        ce90 * pixel_m,
        chance,
        spread,
        1 - _hull_share(control.found_px[adjustment.used], control.size),
    )
    return RefinementVerdict(
        verdict, Statistics.of(before[right]), Statistics.of(after[right]), held_out
    )


def _rms(residuals: FloatArray) -> float:
    return float(np.sqrt((residuals**2).sum(axis=1).mean())) if len(residuals) else math.inf


def _spread_px(adjustment: Adjustment, size: tuple[int, int]) -> float:
    """Return how far the correction varies with its points over the image, root mean square."""
    nodes = np.stack(np.meshgrid(*(np.linspace(0, side - 1, _NODES) for side in size)), -1)
    px = nodes.reshape(-1, 2)
    bias: Bias = adjustment.bias
    by_points = adjustment.spread_px(px)
    by_noise = bias.sigma_px(px)
    return float(np.sqrt(np.mean(np.maximum(by_points, by_noise) ** 2)))


def _extent(px: FloatArray, size: tuple[int, int]) -> float:
    """Return the share of the sides that points spread over; the smaller one."""
    return float((np.ptp(px, axis=0) / np.array(size)).min())


def _hull_share(px: FloatArray, size: tuple[int, int]) -> float:
    try:
        return float(np.clip(ConvexHull(px).volume / (size[0] * size[1]), 0, 1))
    except (QhullError, ValueError):
        return 0.0
