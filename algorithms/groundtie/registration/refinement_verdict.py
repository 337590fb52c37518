"""The verdict on refined RPCs: better than before at points that took no part, or refused."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..assessment.statistics import Statistics
from .refinement_evidence import RefinementEvidence
from .verdict import Verdict, judge_refinement


@dataclass(frozen=True)
class RefinementVerdict:
    """Whether refined RPCs can be trusted.

    Parameters
    ----------
    verdict
        The verdict, its errors in image pixels and in metres on the ground.
    before, after
        Errors at the held-out inliers, by the RPCs as delivered and as refined, px.
    held_out
        Which points were held out: "check points", or "points left out in turn".
    """

    verdict: Verdict
    before: Statistics
    after: Statistics
    held_out: str

    @classmethod
    def of(cls, evidence: RefinementEvidence) -> RefinementVerdict:
        """Judge a bias that was estimated."""
        return cls(
            judge_refinement(evidence),
            Statistics.of(evidence.before_px),
            Statistics.of(evidence.after_px),
            evidence.held_out.name,
        )

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
