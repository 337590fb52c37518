"""The report on refined RPCs: a table as [Suri2010], table 5.7, and the errors as arrows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ..assessment.comparison import Comparison
from ..registration.refinement import RefinedRpc
from . import figures
from .page import Page


@dataclass(frozen=True)
class RefinementReport(Page):
    """The report on refined RPCs, whatever the verdict.

    Parameters
    ----------
    refined
        The RPCs and the verdict on them.
    comparison
        Reference and image on the map; None: there is no reference.
    """

    refined: RefinedRpc
    comparison: Comparison | None
    template: ClassVar[str] = "refinement.html.j2"

    def numbers(self) -> dict[str, Any]:
        """Return the measured values by name."""
        found = self.refined
        return {
            "verdict": found.verdict.summary() | found.evidence.summary(),
            "bias": found.adjustment.bias.to_json(),
            "points_by_hand": found.points.by_hand,
            "heights": {"used": found.ground, "warnings": found.heights.warnings()},
            "mask": None if found.mask is None else found.mask.summary(),
        }

    def values(self) -> dict[str, Any]:
        """Return the values that the template shows."""
        found, verdict, evidence = self.refined, self.refined.verdict, self.refined.evidence
        residuals, grid, bias = found.residuals(), found.grid, found.adjustment.bias
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
            "warnings": found.heights.warnings(),
            **figures.shown_residuals(residuals, grid),
            **figures.shown_errors(residuals, verdict, evidence.metres_per_px),
            "tolerance_px": residuals.tolerance_px,
            "grid": grid,
            "pictures": self.comparison,
        }

    def _facts(self) -> list[str]:
        found, count = self.refined, self.refined.points.by_hand
        by_hand = [f"points set by hand: {count}"] if count else []
        mask = [] if found.mask is None else [found.mask.line()]
        return [found.ground, *by_hand, *mask]
