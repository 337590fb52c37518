"""From ground control to refined RPCs that are judged: the steps of `refine_rpc` after matching."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..assessment.point_errors import PointErrors
from ..assessment.statistics import Statistics
from ..declaration import file_lines
from ..errors import NotRegisteredError, TooFewPointsError
from ..geometry.accuracy import NOTHING_COMMON, Common, ErrorModel
from ..geometry.judging import FEWEST_CHECK_POINTS, TOLERANCE_PX
from ..geometry.misses import Misses
from ..kinds import plain
from ..masks.used import MaskUsed
from ..matching.survey import Survey
from ..rasters.grid import PIXEL_COORDINATES, FloatArray, Grid
from ..report.parts import coverage_lines, coverage_numbers
from ..sensor.adjustment import Adjustment, Control, adjust, reach_px
from ..sensor.bias import SHIFT, fold
from ..sensor.control_points import ControlPoints, left_out
from ..sensor.height_check import HeightCheck, check_heights
from ..sensor.heights import ConstantHeight, Heights
from ..sensor.orientation import sensor_grid
from ..sensor.rpc_fit import RPCFit
from ..wording import signed
from .evidence import AGREEMENT, ERROR, REFINEMENT, Agreement, outside_hull
from .ground_control import GroundControl
from .sensor_input import OrientedImage
from .verdict import Verdict, judge, judge_search

CHECK_POINTS, LEFT_OUT = "check points", "points left out in turn"


@dataclass(frozen=True)
class RefinementEvidence:
    """Evidence for refined RPCs.

    Parameters
    ----------
    control
        The points of the fit.
    adjustment
        The bias that was estimated from them.
    check
        Held-out points; None: there are none. If they are too few, each point of the fit is judged
        by a fit without it and its neighbours.
    metres_per_px
        Side of an image pixel on the ground.
    max_error_px
        Largest root mean square error at held-out points.
    folding_px
        Largest error of RPCs that the bias is folded into.
    needs_spread
        Whether control at one place does not determine the bias elsewhere. A user who gives points
        and asks for a shift states that it does.
    common
        Displacement of all points alike, in pixels of the image, as far as it is known.
    """

    control: Control
    adjustment: Adjustment
    check: Control | None
    metres_per_px: float
    max_error_px: float
    folding_px: float
    needs_spread: bool = True
    common: Common = NOTHING_COMMON

    stages: ClassVar = (AGREEMENT, ERROR, REFINEMENT)
    judged: ClassVar = "the refined RPCs"

    @property
    def fit_points(self) -> int:
        """How many points the fit had."""
        return len(self.control)

    @property
    def fit_points_used(self) -> int:
        """How many of them it used."""
        return int(self.adjustment.used.sum())

    @property
    def extent(self) -> float:
        """Share of a side of the image that control spreads over; of both sides, the smaller."""
        return float((np.ptp(self._used_px, axis=0) / np.array(self.control.size)).min())

    @property
    def extrapolated_share(self) -> float:
        """Share of the image outside of the hull of the control."""
        return outside_hull(self._used_px, self.control.size)

    @cached_property
    def held_out(self) -> Agreement:
        """How held-out points agree with the refined RPCs."""
        name, _, after = self.held
        nodes_px = Grid(PIXEL_COORDINATES, None, *self.control.size).places()
        return Agreement.of(
            name,
            self._error,
            len(after),
            "the image",
            nodes_px,
            least_spread_px=self.adjustment.bias.sigma_px(nodes_px),
        )

    @property
    def before(self) -> Statistics:
        """Errors at the held-out inliers by the RPCs as delivered, px."""
        _, points, _ = self.held
        return Statistics.of(points.residuals_px(None)[self._error.check.mixture.inliers])

    @property
    def after(self) -> Statistics:
        """Errors at the held-out inliers by the refined RPCs, px."""
        _, _, after = self.held
        return Statistics.of(after[self._error.check.mixture.inliers])

    def summary(self) -> dict[str, Any]:
        """Return which points were held out, and their errors, as values that JSON can carry."""
        found = {"before": self.before, "after": self.after}
        errors = {name: each.summary("px", ("col", "row")) for name, each in found.items()}
        return {"held_out": self.held_out.name, **plain(errors)}

    @property
    def _used_px(self) -> FloatArray:
        return self.control.found_px[self.adjustment.used]

    @cached_property
    def held(self) -> tuple[str, Control, FloatArray]:
        """The name of the held-out points, the points, and their residuals by the bias, (n, 2)."""
        if self.check is None or len(self.check) < FEWEST_CHECK_POINTS:
            return LEFT_OUT, self.control, self.adjustment.left_out_px
        return CHECK_POINTS, self.check, self.check.residuals_px(self.adjustment.bias)

    @property
    def tolerance_px(self) -> float:
        """Largest residual of held-out points that agree."""
        return max(TOLERANCE_PX, self.max_error_px)

    @cached_property
    def _error(self) -> ErrorModel:
        _, points, after = self.held
        farthest = float(np.hypot(*after.T).max(initial=0.0))
        reach = int(np.ceil(reach_px(farthest, self.control.size)))
        misses = Misses(points.expected_px, after, reach, self.max_error_px, self.tolerance_px)
        return ErrorModel(self.adjustment.fold_biases, misses, self.common)


@dataclass(frozen=True)
class RefinedRpc:
    """RPCs that were refined by ground control, and judged.

    Parameters
    ----------
    path
        The image.
    grid
        Its pixels.
    ground
        Which heights are used, in words.
    points
        The ground control; blunders are rejected.
    fit
        The RPCs with the bias folded in, and the largest error of that.
    evidence
        The basis of the verdict: the points as the delivered RPCs see them, and the bias.
    verdict
        Whether the refined RPCs can be trusted.
    heights
        The check of the heights' vertical datum.
    mask
        Which mask points were matched with; None: they were given.
    survey
        The survey of the matching by chips all over the overlap; None: there was none.
    files
        The files that were written, by name.
    tried
        Why RPCs were refined, if the images decided that, a line each.
    """

    path: str
    grid: Grid
    ground: str
    points: ControlPoints
    fit: RPCFit
    evidence: RefinementEvidence
    verdict: Verdict
    heights: HeightCheck
    mask: MaskUsed | None
    survey: Survey | None
    files: Mapping[str, str] = field(default_factory=dict)
    tried: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        points: ControlPoints,
        image: OrientedImage,
        model: str,
        max_error_px: float,
        found: GroundControl | None,
    ) -> RefinedRpc:
        """Estimate the bias by the points of the fit that are used, and judge it.

        Parameters
        ----------
        points
            The ground control.
        image
            The image.
        model
            As `adjust` takes it.
        max_error_px
            Largest root mean square error at held-out points.
        found
            The matching that the points come from; None: somebody measured them.

        Raises
        ------
        NotRegisteredError
            There are too few points.
        """
        fitted, checked = points.fit, points.check
        rpc = image.orientation.rpc
        seen = points.seen_by(rpc, image.source.grid.size)
        control = seen.take(fitted)
        try:
            adjustment = adjust(control, model)
        except TooFewPointsError as error:
            verdict = judge_search(error)
            raise _refused(image.source.path, verdict) from error
        blunders = np.zeros(len(points), bool)
        blunders[np.flatnonzero(fitted)[~adjustment.used]] = True
        needs_spread = found is not None or model != SHIFT
        fit = fold(rpc, adjustment.bias)
        evidence = RefinementEvidence(
            control,
            adjustment,
            seen.take(checked) if checked.any() else None,
            sensor_grid(image.source, image.orientation).pixel_size_m,
            max_error_px,
            fit.largest_residual_px,
            needs_spread,
            NOTHING_COMMON if found is None else found.common,
        )
        kept = points.reject(blunders, "blunder")
        above = _median_above(kept, image.orientation.heights) if found is None else None
        heights = check_heights(image.orientation, control.size, above)
        matched = None if found is None else found.registration
        return cls(
            image.source.path,
            image.source.grid.on_own_pixels(),
            image.heights,
            kept,
            fit,
            evidence,
            judge(evidence),
            heights,
            None if matched is None else matched.mask,
            None if matched is None else matched.survey,
        )

    @property
    def adjustment(self) -> Adjustment:
        """The bias, as it was estimated."""
        return self.evidence.adjustment

    def residuals(self) -> PointErrors:
        """Return the residuals of the points by the refined RPCs, in the image.

        Without enough check points, the residuals of points left out in turn take their place.
        """
        control, adjustment = self.evidence.control, self.adjustment
        fitted = control.residuals_px(adjustment.bias)
        _, held_out, missed = self.evidence.held
        return PointErrors(
            np.concatenate([control.found_px, held_out.found_px]),
            np.concatenate([fitted, missed]),
            np.repeat([False, True], [len(fitted), len(missed)]),
            np.append(adjustment.used, np.ones(len(missed), bool)),
            tolerance_px=self.evidence.tolerance_px,
        )

    def require_accepted(self) -> None:
        """Raise `NotRegisteredError` if it was refused."""
        if not self.verdict.accepted:
            raise _refused(self.path, self.verdict)

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "verdict": self.verdict.summary() | self.evidence.summary(),
            "points_by_hand": self.points.by_hand,
            "bias": self.adjustment.bias.to_json(),
            "left_out_rmse_px": self.adjustment.left_out_rmse_px,
            "folding_residual_px": self.fit.largest_residual_px,
            "heights": {"used": self.ground, **self.heights.summary()},
            "mask": None if self.mask is None else self.mask.summary(),
            **coverage_numbers(self.survey),
            "files": self.files,
            **({"tried": list(self.tried)} if self.tried else {}),
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        verdict, evidence, bias = self.verdict, self.evidence, self.adjustment.bias
        shift, sigma = bias.shift_px()
        by_hand = self.points.by_hand
        lost = int(self.points.without_height.sum())
        return [
            *self.tried,
            f"accepted: {verdict.reason}",
            verdict.model_line(bias.kind),
            f"shift in the middle of the image: {signed(shift[0])} ± {sigma[0]:.2f}, "
            f"{signed(shift[1])} ± {sigma[1]:.2f} px (column, row)",
            f"error at {evidence.held_out.name}: {evidence.before.rmse:.2f} px before, "
            f"{evidence.after.rmse:.2f} px after",
            verdict.accuracy_line(),
            f"{verdict.check_points_agreeing} of {verdict.check_points} agree",
            *coverage_lines(self.survey),
            *([f"set by hand: {by_hand} points"] if by_hand else []),
            *([left_out(lost)] if lost else []),
            self.ground,
            *(() if self.mask is None else (self.mask.line(),)),
            *(f"warning: {line}" for line in self.heights.warnings()),
            *file_lines(self.files),
        ]


def _median_above(points: ControlPoints, heights: Heights) -> float | None:
    """Return the median height above a terrain model of points that have heights of their own.

    None: there is no terrain model, or no point has a height.
    """
    if isinstance(heights, ConstantHeight):
        return None
    above = points.height_m - heights.at(points.lon_lat)
    above = above[np.isfinite(above) & points.used]
    return float(np.median(above)) if len(above) else None


def _refused(path: str, verdict: Verdict) -> NotRegisteredError:
    return NotRegisteredError(f"the RPCs of {path} were not refined: {verdict.sentence()}", verdict)
