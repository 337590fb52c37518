"""The report on a registration that was made before."""

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

# What an assessment's parts are called.
PART_LABELS = {
    "control_points": "control points",
    "test_points": "test points",
    "check_points": "check points",
    "two_way": "two-way consistency",
    "three_way": "three-way consistency",
}


@dataclass(frozen=True)
class AssessmentReport(Page):
    """What is shown of how good a registration is that was made before.

    Parameters
    ----------
    assessment
        All that was measured.
    verdict
        Whether the registration can be trusted; None if no largest error was asked for.
    transform
        What was measured.
    comparison
        The images; None if they were not given.
    """

    assessment: Assessment
    verdict: Verdict | None
    transform: Transform
    comparison: Comparison | None
    template: ClassVar[str] = "assessment.html.j2"

    def numbers(self) -> dict[str, Any]:
        """Return what was measured, by name."""
        verdict = None if self.verdict is None else self.verdict.summary()
        parts = self.assessment.summary()
        return {"verdict": verdict, **parts, "transform": self.transform.to_json()}

    def values(self) -> dict[str, Any]:
        """Return what the template shows."""
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
        """Return what is shown of the errors at all points, over the input; None: nothing."""
        measured = self.assessment
        fit = measured.control_points
        parts = (
            replace(fit, is_check=np.zeros(len(fit), bool)),
            measured.test_points,
            measured.check_points,
        )
        # An outlier is shown: as a check point that disagrees.
        shown = [replace(part, counted=part.placed, error_m=None) for part in parts]
        errors = PointErrors.concatenate(shown)
        if not errors.used.any():
            return None
        grid = self.transform.input_grid
        return {**figures.shown_residuals(errors, grid), "grid": grid}
