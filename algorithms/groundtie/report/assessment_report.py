"""The report on an existing registration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..assessment.accuracy import Assessment
from ..assessment.comparison import Comparison
from ..assessment.point_errors import PointErrors
from ..geometry.transform import Transform
from ..registration.verdict import Verdict
from . import figures
from .page import Page

# Names of an assessment's parts.
PART_LABELS = {
    "control_points": "control points",
    "test_points": "test points",
    "check_points": "check points",
    "two_way": "two-way consistency",
    "three_way": "three-way consistency",
}


@dataclass(frozen=True)
class AssessmentReport(Page):
    """The report on the accuracy of an existing registration.

    Parameters
    ----------
    assessment
        All measurements.
    verdict
        Whether the registration can be trusted; None if no largest error was asked for.
    transform
        The measured transform.
    comparison
        The images; None if they were not given.
    """

    assessment: Assessment
    verdict: Verdict | None
    transform: Transform
    comparison: Comparison | None
    template: ClassVar[str] = "assessment.html.j2"

    def numbers(self) -> dict[str, Any]:
        """Return the measured values by name."""
        verdict = None if self.verdict is None else self.verdict.summary()
        parts = self.assessment.summary()
        return {"verdict": verdict, **parts, "transform": self.transform.to_json()}

    def values(self) -> dict[str, Any]:
        """Return the values that the template shows."""
        parts = {name: errors for name, errors in self.assessment.parts().items() if len(errors)}
        return {
            "verdict": self.verdict,
            "parts": parts,
            "labels": PART_LABELS,
            "metres": any(errors.error_m is not None for errors in parts.values()),
            "model": self.transform.model.kind,
            "pictures": self.comparison,
            "residuals": self._residuals(),
        }

    def _residuals(self) -> dict[str, Any] | None:
        """Return the template's values for the errors at all points, over the input; None: none."""
        measured = self.assessment
        fit = measured.control_points
        parts = (
            replace(fit, is_check=np.zeros(len(fit), bool)),
            measured.test_points,
            measured.check_points,
        )
        # Outliers are shown, too, as check points that disagree.
        shown = [replace(p, counted=p.placed, error_m=None) for p in parts if p.placed.any()]
        if not shown:
            return None
        # The tolerance is that of all parts.
        errors, grid = PointErrors.concatenate(shown), self.transform.input_grid
        residuals = figures.shown_residuals(errors, grid)
        return {**residuals, "grid": grid, "tolerance_px": errors.tolerance_px}
