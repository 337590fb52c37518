"""The report on refined RPCs: a table as [Suri2010], table 5.7, and the errors as arrows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ..assessment.comparison import Comparison
from ..assessment.point_errors import PointErrors
from ..masks.choice import MaskUsed
from ..rasters.grid import Grid
from ..registration.refinement_evidence import RefinementEvidence
from ..registration.verdict import Verdict
from ..sensor.bias import Bias
from . import figures
from .page import Page


@dataclass(frozen=True)
class RefinementReport(Page):
    """What is shown of refined RPCs, whatever the verdict.

    Parameters
    ----------
    verdict
        Whether they can be trusted.
    evidence
        What that rests on, with the errors before and after.
    bias
        What was, or would have been, taken out.
    residuals
        By how much the refined RPCs miss the points, in image pixels.
    grid
        The image's pixels.
    pixel_m
        Side of one on the ground.
    heights
        Which heights were used, in words.
    by_hand
        How many of the points a person moved or added.
    warnings
        What makes the heights doubtful.
    comparison
        Reference and image on the map; None: there is no reference.
    mask
        What of the reference took part; None without one.
    """

    verdict: Verdict
    evidence: RefinementEvidence
    bias: Bias
    residuals: PointErrors
    grid: Grid
    pixel_m: float
    heights: str
    by_hand: int
    warnings: tuple[str, ...]
    comparison: Comparison | None
    mask: MaskUsed | None
    template: ClassVar[str] = "refinement.html.j2"

    def numbers(self) -> dict[str, Any]:
        """Return what was measured, by name."""
        return {
            "verdict": self.verdict.summary() | self.evidence.summary(),
            "bias": self.bias.to_json(),
            "points_by_hand": self.by_hand,
            "heights": {"used": self.heights, "warnings": self.warnings},
            "mask": None if self.mask is None else self.mask.summary(),
        }

    def values(self) -> dict[str, Any]:
        """Return what the template shows."""
        verdict, residuals, grid = self.verdict, self.residuals, self.grid
        measured = {"before": self.evidence.before, "after": self.evidence.after}
        histogram = figures.error_histogram(residuals, verdict, self.pixel_m)
        return {
            "verdict": verdict,
            "held_out": self.evidence.held_out.name,
            "errors": {
                name: {"px": each, "m": each.scaled(self.pixel_m)}
                for name, each in measured.items()
            },
            "bias": self.bias,
            "shift": list(zip(("column", "row"), *self.bias.shift_px(), strict=True)),
            "facts": self._facts(),
            "warnings": self.warnings,
            "map": figures.svg_uri(figures.residual_map(residuals, grid)),
            "histogram": figures.svg_uri(histogram),
            "scatter": figures.svg_uri(figures.error_scatter(residuals, verdict)),
            "exaggeration": figures.residual_arrows(residuals, grid).exaggeration,
            "grid": grid,
            "pictures": self.comparison,
        }

    def _facts(self) -> list[str]:
        by_hand = [f"points set by hand: {self.by_hand}"] if self.by_hand else []
        return [self.heights, *by_hand, *([] if self.mask is None else [self.mask.line()])]
