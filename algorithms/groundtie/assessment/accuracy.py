"""What was measured of a registration, and the verdict on it.

Errors at control points only show how well the model takes up the points that it was fitted to;
errors at test points, which took no part in the fit, show how good it is. Source: [Suri2010],
section 2.5.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from ..errors import TooFewPointsError
from ..geometry.judging import FEWEST_CHECK_POINTS, SMALLEST_INLIER_SHARE
from ..registration.verdict import Verdict
from .point_errors import PointErrors


@dataclass(frozen=True)
class Assessment:
    """All that was measured of a registration; no points where there was no evidence.

    Parameters
    ----------
    control_points
        Points of the fit: no measure of accuracy.
    test_points
        Matches that were held out of the fit; only inliers count.
    check_points
        Independent points, which all count.
    two_way, three_way
        How far a way back by other transforms misses the start, over the input (see
        `consistency`).
    """

    control_points: PointErrors = field(default_factory=PointErrors.none)
    test_points: PointErrors = field(default_factory=PointErrors.none)
    check_points: PointErrors = field(default_factory=PointErrors.none)
    two_way: PointErrors = field(default_factory=PointErrors.none)
    three_way: PointErrors = field(default_factory=PointErrors.none)

    def parts(self) -> dict[str, PointErrors]:
        """Return everything by name."""
        return {name: getattr(self, name) for name in Assessment.__dataclass_fields__}

    def summary(self) -> dict[str, Any]:
        """Return all numbers by name."""
        return {name: errors.summary() for name, errors in self.parts().items()}

    @property
    def can_be_judged(self) -> bool:
        """Whether there are points that took no part in the fit."""
        return len(self.check_points) + len(self.test_points) > 0

    def judge(self, max_error_px: float) -> Verdict:
        """Accept or refuse the registration by its check points, without such by test points.

        Inconsistency can refuse a registration, but consistency alone cannot confirm it.

        Parameters
        ----------
        max_error_px
            Largest root mean square error, in input pixels.

        Raises
        ------
        TooFewPointsError
            There are neither check points nor test points.
        """
        if not self.can_be_judged:
            raise TooFewPointsError(
                "no points took no part in the fit: give check points, or tie points with the "
                "role check"
            )
        name = "check" if len(self.check_points) else "test"
        judged = self.check_points if len(self.check_points) else self.test_points
        px, metres = judged.in_pixels, judged.in_metres
        rule, against = self._deciding_rule(judged, f"{name} points", max_error_px)
        return Verdict(
            accepted=not against,
            reason=against or f"{name} points confirm the registration",
            fit_points=len(self.control_points),
            fit_points_used=int(self.control_points.used.sum()),
            check_points=len(judged),
            check_points_agreeing=int(judged.used.sum()),
            check_rmse_px=px.rmse,
            check_rmse_m=metres.rmse,
            check_ce90_px=px.ce90,
            check_ce90_m=metres.ce90,
            log10_chance=math.nan,
            rule=rule,
        )

    def _deciding_rule(
        self, judged: PointErrors, name: str, max_error_px: float
    ) -> tuple[str, str]:
        """Return the name of the gravest rule that refuses, and its reason; empty if none does."""
        count, used, lost = len(judged), int(judged.used.sum()), int((~judged.placed).sum())
        fewest = max(FEWEST_CHECK_POINTS, SMALLEST_INLIER_SHARE * count)
        rmse = judged.in_pixels.rmse
        above = f"px, above {max_error_px:g} px"
        rules = [
            ("placement", lost > 0, f"the transform cannot place {lost} of {count} {name}"),
            ("few points", count < FEWEST_CHECK_POINTS,
             f"{count} {name} are too few to measure anything"),
            ("agreement", used < fewest, f"only {used} of {count} {name} agree"),
            ("error", rmse > max_error_px, f"error at {name} is {rmse:.2f} {above}"),
        ]  # fmt: skip
        for label, errors in (("two-way", self.two_way), ("three-way", self.three_way)):
            miss = errors.in_pixels.rmse
            reason = f"{label} inconsistency is {miss:.2f} {above}"
            rules.append((f"{label} consistency", miss > max_error_px, reason))
        return next(((rule, reason) for rule, refuses, reason in rules if refuses), ("", ""))
