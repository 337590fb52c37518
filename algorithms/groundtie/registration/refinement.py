"""From ground control to refined RPCs that are judged: the steps of `refine_rpc` after matching."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..assessment.point_errors import PointErrors
from ..errors import NotRegisteredError, TooFewPointsError
from ..rasters.grid import PIXEL_COORDINATES, Grid
from ..sensor.adjustment import Adjustment, Control, adjust
from ..sensor.bias import fold
from ..sensor.control_points import ControlPoints
from ..sensor.height_check import HeightCheck, check_heights
from ..sensor.orientation import sensor_grid
from ..sensor.rpc_fit import RPCFit
from .refinement_verdict import RefinementVerdict, judge_refinement
from .sensor_input import OrientedImage
from .verdict import refuse

# A bias that is folded in by a new fit may be missed by so much, in pixels.
_LARGEST_FOLDING_PX = 0.01


@dataclass(frozen=True)
class Fitting:
    """How a bias is estimated and judged; parameters of `refine_rpc`.

    Parameters
    ----------
    model, method, largest_residual_px, seed
        As `adjust` takes them.
    max_error_px
        Largest error at held-out points.
    """

    model: str
    method: str
    largest_residual_px: float
    max_error_px: float
    seed: int


@dataclass(frozen=True)
class Refinement:
    """A bias that was estimated from ground control, and judged.

    Parameters
    ----------
    image
        The image, with the RPCs as delivered.
    points
        The ground control; blunders are rejected.
    control, check
        Points of the fit and points that took no part, as the delivered RPCs see them; None:
        there are none of the latter.
    adjustment
        The bias.
    judged
        The verdict, and the errors before and after.
    """

    image: OrientedImage
    points: ControlPoints
    control: Control
    check: Control | None
    adjustment: Adjustment
    judged: RefinementVerdict

    @classmethod
    def of(cls, points: ControlPoints, image: OrientedImage, fitting: Fitting) -> Refinement:
        """Estimate the bias by the points of the fit that are used.

        Raises
        ------
        NotRegisteredError
            There are too few.
        """
        table = points.points
        fitted, checked = table.used & ~table.is_check, table.used & table.is_check
        seen = points.seen_by(image.rpc, image.size)
        control = seen.take(fitted)
        check = seen.take(checked) if checked.any() else None
        try:
            adjustment = adjust(
                control, fitting.model, fitting.method, fitting.largest_residual_px, fitting.seed
            )
        except TooFewPointsError as error:
            raise NotRegisteredError(
                f"the RPCs of {image.source.path} were not refined: {error}", refuse(str(error))
            ) from error
        blunders = np.zeros(len(table), bool)
        blunders[np.flatnonzero(fitted)[~adjustment.used]] = True
        pixel_m = sensor_grid(image.source, image.orientation).pixel_size_m
        judged = judge_refinement(control, adjustment, check, pixel_m, fitting.max_error_px)
        kept = points.with_points(table.reject(blunders, "blunder"))
        return cls(image, kept, control, check, adjustment, judged)

    @property
    def grid(self) -> Grid:
        """The image's pixels."""
        return Grid(PIXEL_COORDINATES, None, *self.image.size)

    def residuals(self) -> PointErrors:
        """Return by how much the refined RPCs miss the points, in the image.

        Without check points, those are shown for them that points have when they are left out.
        """
        bias, held_out = self.adjustment.bias, self.check
        fitted = self.control.residuals_px(bias)
        if held_out is None:
            held_out, missed = self.control, self.adjustment.left_out_px
        else:
            missed = held_out.residuals_px(bias)
        return PointErrors(
            np.concatenate([self.control.found_px, held_out.found_px]),
            np.concatenate([fitted, missed]),
            np.repeat([False, True], [len(fitted), len(missed)]),
            np.append(self.adjustment.used, np.ones(len(missed), bool)),
        )

    def accepted(self) -> RPCFit:
        """Return the RPCs with the bias folded in.

        Raises
        ------
        NotRegisteredError
            The refinement is refused, or RPCs cannot take up the bias.
        """
        verdict, name = self.judged.verdict, self.image.source.path
        if not verdict.accepted:
            raise NotRegisteredError(
                f"the RPCs of {name} were not refined: {verdict.reason}", verdict
            )
        fit = fold(self.image.rpc, self.adjustment.bias)
        if fit.largest_residual_px > _LARGEST_FOLDING_PX:
            raise NotRegisteredError(
                f"the RPCs of {name} cannot take up the bias: they miss it by "
                f"{fit.largest_residual_px:.3f} px",
                verdict,
            )
        return fit

    def heights(self, own_heights: bool) -> HeightCheck:
        """Return what speaks against the heights.

        `own_heights` tells that the points have heights of their own, which are compared.
        """
        above = self._median_above() if own_heights else None
        return check_heights(
            self.image.orientation, self.image.size, self.control, self.adjustment, above
        )

    def _median_above(self) -> float | None:
        """Return how far points that have heights of their own lie above the ground."""
        points = self.points
        above = points.height_m - self.image.orientation.heights.at(points.lon_lat)
        above = above[np.isfinite(above) & points.points.used]
        return float(np.median(above)) if len(above) else None
