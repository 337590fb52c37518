"""What a verdict on refined RPCs rests on: points that took no part, before and after."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..assessment.statistics import Statistics
from ..geometry.accuracy import NOTHING_COMMON, Common, predict_accuracy
from ..geometry.judging import FEWEST_CHECK_POINTS, TOLERANCE_PX
from ..geometry.misses import Misses
from ..rasters.grid import PIXEL_COORDINATES, FloatArray, Grid
from ..sensor.adjustment import LEAST_REACH_PX, Adjustment, Control
from .evidence import AGREEMENT, ERROR, REFINEMENT, HeldOut, hull_share

CHECK_POINTS, LEFT_OUT = "check points", "points left out in turn"


@dataclass(frozen=True)
class RefinementEvidence:
    """What is known of refined RPCs.

    Parameters
    ----------
    held_out
        How points that took no part agree with the refined RPCs.
    before_px, after_px
        Errors at those of them that are inliers, by the RPCs as delivered and as refined, shape
        (n, 2).
    extent
        Share of the sides of the image that control spreads over, the smaller one.
    extrapolated_share
        Share of the image outside of the hull of the control.
    fit_points, fit_points_used
        How many points the fit had, and how many of them it used.
    metres_per_px
        Side of an image pixel on the ground.
    folding_px
        By how much RPCs with the bias folded in miss it.
    needs_spread
        Whether control at one place does not tell the bias elsewhere; who measured points and asks
        for a shift states that it does.
    """

    held_out: HeldOut
    before_px: FloatArray
    after_px: FloatArray
    extent: float
    extrapolated_share: float
    fit_points: int
    fit_points_used: int
    metres_per_px: float
    folding_px: float
    needs_spread: bool = True

    stages: ClassVar = (AGREEMENT, ERROR, REFINEMENT)
    judged: ClassVar = "the refined RPCs"

    @property
    def before(self) -> Statistics:
        """Errors at the held-out inliers by the RPCs as delivered, px."""
        return Statistics.of(self.before_px)

    @property
    def after(self) -> Statistics:
        """Errors at the held-out inliers by the refined RPCs, px."""
        return Statistics.of(self.after_px)

    def summary(self) -> dict[str, Any]:
        """Return which points were held out, and their errors, as values that JSON can carry."""
        errors = {
            name: {
                key: value if math.isfinite(value) else None
                for key, value in statistics.summary("px", ("col", "row")).items()
            }
            for name, statistics in (("before", self.before), ("after", self.after))
        }
        return {"held_out": self.held_out.name, **errors}

    @classmethod
    def of(
        cls,
        control: Control,
        adjustment: Adjustment,
        check: Control | None,
        pixel_m: float,
        max_error_px: float,
        folding_px: float = 0.0,
        needs_spread: bool = True,
        common: Common = NOTHING_COMMON,
    ) -> RefinementEvidence:
        """Measure a bias that was estimated.

        Parameters
        ----------
        control
            The points of the fit.
        adjustment
            What was fitted to them.
        check
            Points that took no part; None: there are none, so that each point of the fit is
            judged by a fit without it and its neighbours.
        pixel_m
            Side of an image pixel on the ground.
        max_error_px
            Largest root mean square error at held-out points.
        folding_px
            By how much RPCs with the bias folded in miss it.
        needs_spread
            Whether control at one place does not tell the bias elsewhere.
        common
            What displaces all points alike, in pixels of the image, as far as it is known.
        """
        if check is None or len(check) < FEWEST_CHECK_POINTS:
            name, points = LEFT_OUT, control
            after = adjustment.left_out_px
        else:
            name, points = CHECK_POINTS, check
            after = check.residuals_px(adjustment.bias)
        before = points.residuals_px(None)
        reach = max(int(np.ceil(np.hypot(*after.T).max(initial=0.0))), LEAST_REACH_PX)
        tolerance = max(TOLERANCE_PX, max_error_px)
        misses = Misses(points.expected_px, after, reach, max_error_px, tolerance)
        nodes_px = Grid(PIXEL_COORDINATES, None, *control.size).lattice()
        held_out = HeldOut.of(
            name,
            misses,
            len(after),
            "the image",
            _spread_px(adjustment, nodes_px),
            predict_accuracy(adjustment.fold_biases, nodes_px, misses, common),
        )
        used_px = control.found_px[adjustment.used]
        return cls(
            held_out,
            before[misses.mixture.inliers],
            after[misses.mixture.inliers],
            float((np.ptp(used_px, axis=0) / np.array(control.size)).min()),
            1 - hull_share(used_px, control.size),
            len(control),
            int(adjustment.used.sum()),
            pixel_m,
            folding_px,
            needs_spread,
        )


def _spread_px(adjustment: Adjustment, px: FloatArray) -> FloatArray:
    """Return how far the correction varies with its points at places (n, 2), shape (n,)."""
    return np.maximum(adjustment.spread_px(px), adjustment.bias.sigma_px(px))
