"""From ground control to refined RPCs that are judged: the steps of `refine_rpc` after matching."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..assessment.point_errors import PointErrors
from ..errors import NotRegisteredError, TooFewPointsError
from ..geometry.accuracy import NOTHING_COMMON, Common
from ..rasters.grid import PIXEL_COORDINATES, Grid
from ..sensor.adjustment import adjust
from ..sensor.bias import SHIFT, fold
from ..sensor.control_points import ControlPoints
from ..sensor.height_check import HeightCheck, check_heights
from ..sensor.orientation import sensor_grid
from ..sensor.rpc_fit import RPCFit
from .refinement_evidence import RefinementEvidence
from .sensor_input import OrientedImage
from .verdict import Verdict, judge, judge_search


@dataclass(frozen=True)
class Refinement:
    """A bias that was estimated from ground control, and judged.

    Parameters
    ----------
    image
        The image, with the RPCs as delivered.
    points
        The ground control; blunders are rejected.
    fit
        RPCs with the bias folded in.
    evidence
        What the verdict rests on: the points as the delivered RPCs see them, and the bias.
    verdict
        Whether the refined RPCs can be trusted.
    """

    image: OrientedImage
    points: ControlPoints
    fit: RPCFit
    evidence: RefinementEvidence
    verdict: Verdict

    @classmethod
    def of(
        cls,
        points: ControlPoints,
        image: OrientedImage,
        model: str,
        max_error_px: float,
        is_measured: bool = False,
        common: Common = NOTHING_COMMON,
    ) -> Refinement:
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
        is_measured
            Whether somebody measured the points, who were not matched.
        common
            What displaces all points alike, in pixels of the image, as far as it is known.

        Raises
        ------
        NotRegisteredError
            There are too few.
        """
        table = points.points
        fitted, checked = table.fit, table.check
        rpc = image.orientation.rpc
        seen = points.seen_by(rpc, image.size)
        control = seen.take(fitted)
        try:
            adjustment = adjust(control, model)
        except TooFewPointsError as error:
            verdict = judge_search(error)
            raise _refused(image, verdict) from error
        blunders = np.zeros(len(table), bool)
        blunders[np.flatnonzero(fitted)[~adjustment.used]] = True
        needs_spread = not (is_measured and model == SHIFT)
        fit = fold(rpc, adjustment.bias)
        evidence = RefinementEvidence(
            control,
            adjustment,
            seen.take(checked) if checked.any() else None,
            sensor_grid(image.source, image.orientation).pixel_size_m,
            max_error_px,
            fit.largest_residual_px,
            needs_spread,
            common,
        )
        kept = replace(points, points=table.reject(blunders, "blunder"))
        verdict = judge(evidence)
        return cls(image, kept, fit, evidence, verdict)

    @property
    def grid(self) -> Grid:
        """The image's pixels."""
        return Grid(PIXEL_COORDINATES, None, *self.image.size)

    def residuals(self) -> PointErrors:
        """Return by how much the refined RPCs miss the points, in the image.

        Without check points, those are shown for them that points have when they are left out.
        """
        control, adjustment = self.evidence.control, self.evidence.adjustment
        fitted, held_out = control.residuals_px(adjustment.bias), self.evidence.check
        if held_out is None:
            held_out, missed = control, adjustment.left_out_px
        else:
            missed = held_out.residuals_px(adjustment.bias)
        return PointErrors(
            np.concatenate([control.found_px, held_out.found_px]),
            np.concatenate([fitted, missed]),
            np.repeat([False, True], [len(fitted), len(missed)]),
            np.append(adjustment.used, np.ones(len(missed), bool)),
        )

    def accepted(self) -> RPCFit:
        """Return the RPCs with the bias folded in.

        Raises
        ------
        NotRegisteredError
            The refinement is refused.
        """
        if not self.verdict.accepted:
            raise _refused(self.image, self.verdict)
        return self.fit

    def heights(self, own_heights: bool) -> HeightCheck:
        """Return what contradicts the heights.

        With `own_heights` the points have heights of their own, which are compared.
        """
        above = self._median_above() if own_heights else None
        control, adjustment = self.evidence.control, self.evidence.adjustment
        return check_heights(self.image.orientation, control, adjustment, above)

    def _median_above(self) -> float | None:
        """Return how far points that have heights of their own lie above the ground."""
        points = self.points
        above = points.height_m - self.image.orientation.heights.at(points.lon_lat)
        above = above[np.isfinite(above) & points.points.used]
        return float(np.median(above)) if len(above) else None


def _refused(image: OrientedImage, verdict: Verdict) -> NotRegisteredError:
    name = image.source.path
    return NotRegisteredError(f"the RPCs of {name} were not refined: {verdict.sentence()}", verdict)
