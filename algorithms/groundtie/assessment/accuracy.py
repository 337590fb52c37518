"""The measured accuracy of a registration, and the verdict on it.

Errors at control points only show how well the model fits the points that it was fitted to. Errors
at test points, which took no part in the fit, show its accuracy. Source: [Suri2010], section 2.5.3.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from ..errors import TooFewPointsError
from ..geometry.tie_points import NONE_HELD_OUT
from ..registration.evidence import AGREEMENT, ASSESSMENT, ERROR, Agreement
from ..registration.verdict import Verdict, decide
from .point_errors import PointErrors


@dataclass(frozen=True)
class AssessmentEvidence:
    """The rules' evidence on an existing registration.

    Parameters
    ----------
    name
        Name of the points.
    points
        Errors at points that took no part in the fit.
    max_error_px
        Largest root mean square error, in input pixels.
    misses_px
        Root mean square inconsistency of the paths back, by name; NaN: not measured.
    log10_chance
        log10 of the probability that random points would agree as well; NaN for check points.
    """

    name: str
    points: PointErrors
    max_error_px: float
    misses_px: Mapping[str, float]
    log10_chance: float

    stages: ClassVar = (ASSESSMENT, AGREEMENT, ERROR)

    @property
    def held_out(self) -> Agreement:
        """The agreement of the points; the model's spread is unknown."""
        used, count = int(self.points.used.sum()), len(self.points)
        rmse, limit = self.points.in_pixels.rmse, self.max_error_px
        return Agreement(self.name, used, count, self.log10_chance, rmse, limit, 0.0, "")


@dataclass(frozen=True)
class Assessment:
    """All measurements of a registration; without evidence, a part has no points.

    Parameters
    ----------
    control_points
        Points of the fit: no measure of accuracy.
    test_points
        Matches that were held out of the fit; only inliers count.
    check_points
        Independent points, which all count.
    two_way, three_way
        Misclosure of a path back by other transforms, over the input (see `consistency`).
    """

    control_points: PointErrors = field(default_factory=PointErrors.none)
    test_points: PointErrors = field(default_factory=PointErrors.none)
    check_points: PointErrors = field(default_factory=PointErrors.none)
    two_way: PointErrors = field(default_factory=PointErrors.none)
    three_way: PointErrors = field(default_factory=PointErrors.none)

    def parts(self) -> dict[str, PointErrors]:
        """Return the parts by name."""
        return {name: getattr(self, name) for name in Assessment.__dataclass_fields__}

    def summary(self) -> dict[str, Any]:
        """Return all numbers by name."""
        return {name: errors.summary() for name, errors in self.parts().items()}

    def judge(self, max_error_px: float) -> Verdict:
        """Accept or refuse the registration by its check points or, without any, its test points.

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
        name, judged, chance = "check points", self.check_points, math.nan
        if not len(judged):
            name, judged = "test points", self.test_points
            chance = judged.log10_chance
        if not len(judged):
            raise TooFewPointsError(NONE_HELD_OUT)
        ways = {"two-way": self.two_way, "three-way": self.three_way}
        misses = {name: errors.in_pixels.rmse for name, errors in ways.items()}
        evidence = AssessmentEvidence(name, judged, max_error_px, misses, chance)
        return replace(
            decide(evidence, f"{name} confirm the registration"),
            fit_points=len(self.control_points),
            fit_points_used=int(self.control_points.used.sum()),
            check_points=len(judged),
            check_points_agreeing=int(judged.used.sum()),
            check_rmse_px=judged.in_pixels.rmse,
            check_rmse_m=judged.in_metres.rmse,
            log10_chance=chance,
        )
