"""The report on refined RPCs: a table as [Suri2010], table 5.7, and the errors as arrows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ..assessment.comparison import Comparison
from ..masks.used import MaskUsed
from ..registration.refinement import Refinement
from ..sensor.height_check import HeightCheck
from . import figures
from .page import Page


@dataclass(frozen=True)
class RefinementReport(Page):
    """What is shown of refined RPCs, whatever the verdict.

    Parameters
    ----------
    refinement
        The RPCs and the verdict on them.
    heights
        What makes the heights doubtful.
    comparison
        Reference and image on the map; None: there is no reference.
    mask
        What of the reference took part; None without one.
    """

    refinement: Refinement
    heights: HeightCheck
    comparison: Comparison | None
    mask: MaskUsed | None
    template: ClassVar[str] = "refinement.html.j2"

    def numbers(self) -> dict[str, Any]:
        """Return what was measured, by name."""
        found = self.refinement
        return {
            "verdict": found.verdict.summary() | found.evidence.summary(),
            "bias": found.evidence.adjustment.bias.to_json(),
            "points_by_hand": found.points.by_hand,
            "heights": {"used": found.image.heights, "warnings": self.heights.warnings()},
            "mask": None if self.mask is None else self.mask.summary(),
        }

    def values(self) -> dict[str, Any]:
        """Return what the template shows."""
        found, verdict, evidence = (
            self.refinement,
            self.refinement.verdict,
            self.refinement.evidence,
        )
        residuals, grid, bias = found.residuals(), found.grid, evidence.adjustment.bias
        measured = {"before": evidence.before, "after": evidence.after}
        return {
            "verdict": verdict,
            "held_out": evidence.held_out.name,
            "errors": {
                name: {"px": each, "m": each.scaled(evidence.metres_per_px)}
                for name, each in measured.items()
            },
            "bias": bias,
            "shift": list(zip(("column", "row"), *bias.shift_px(), strict=True)),
            "facts": self._facts(),
            "warnings": self.heights.warnings(),
            **figures.shown_residuals(residuals, grid),
            **figures.shown_errors(residuals, verdict, evidence.metres_per_px),
            "grid": grid,
            "pictures": self.comparison,
        }

    def _facts(self) -> list[str]:
        found, count = self.refinement, self.refinement.points.by_hand
        by_hand = [f"points set by hand: {count}"] if count else []
        return [found.image.heights, *by_hand, *([] if self.mask is None else [self.mask.line()])]
