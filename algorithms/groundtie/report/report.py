"""The report on a registration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from ..assessment.comparison import Comparison, without_masks
from ..assessment.point_errors import PointErrors
from ..similarity.peak import find_peak
from ..similarity.surface import Surface
from . import details, figures, parts, pictures
from .page import Page

if TYPE_CHECKING:
    from ..registration.registration import Registration


@dataclass(frozen=True)
class Report(Page):
    """The report on a registration, whatever the verdict.

    Parameters
    ----------
    registration
        The registration; its rasters are open.
    """

    registration: Registration
    template: ClassVar[str] = "report.html.j2"

    def numbers(self) -> dict[str, Any]:
        """Return the measured values by name."""
        found, survey = self.registration, self.registration.survey
        correction, transform, beyond = found.correction, found.transform, found.beyond
        return {
            "verdict": found.verdict.summary(),
            "correction": None if correction is None else correction.summary(),
            "transform": None if transform is None else transform.to_json(),
            "mask": found.mask.summary(),
            "notes": found.notes(),
            "scene": found.scene.summary(),
            **parts.coverage_numbers(survey),
            **({} if survey is None else {"parts": parts.summary(survey)}),
            **({} if beyond is None else {"outside_of_overlap": beyond.summary()}),
            **({"tried": list(found.tried)} if found.tried else {}),
        }

    def values(self) -> dict[str, Any]:
        """Return the values that the template shows."""
        found, pair, survey = self.registration, self.registration.pair, self.registration.survey
        beyond = () if found.beyond is None else (found.beyond.line(),)
        return {
            "verdict": found.verdict,
            "grid": pair.grid,
            "notes": [*found.notes(), found.mask.line(), *beyond],
            "metres": pair.grid.metres_per_pixel,
            "model": None if found.transform is None else found.transform.model.kind,
            "correction": found.correction,
            "pictures": Comparison.of(pair, found.transform),
            "surfaces": [_shown_surface(*labelled) for labelled in found.extreme_surfaces()],
            "scene": found.scene.facts(),
            "tried": found.tried,
            "parts": None if survey is None else parts.shown(survey),
            **self._at_points(),
        }

    def _at_points(self) -> dict[str, Any]:
        """Return residuals, and chips at full resolution; nothing without a transform."""
        found, pair = self.registration, self.registration.pair
        if found.transform is None or found.tie_points is None:
            return {"residuals": None, "details": []}
        errors = PointErrors.on_grid(found.tie_points, found.transform, pair.grid)
        return {
            "residuals": self._residual_figures(errors),
            "details": details.shown(without_masks(pair), found.transform, errors),
        }

    def _residual_figures(self, errors: PointErrors) -> dict[str, Any]:
        """Return the figures that the points allow."""
        grid, verdict = self.registration.pair.grid, self.registration.verdict
        shown: dict[str, Any] = {
            **figures.shown_residuals(errors, grid),
            "errors": bool(errors.check.any()),
        }
        if shown["errors"]:
            reach = figures.error_reach_px(errors, verdict)
            shown |= {
                **figures.shown_errors(errors, verdict, grid.metres_per_pixel),
                "measured": int(errors.check.sum()),
                "reach_px": reach,
                "beyond": int((errors.length_px[errors.check] > reach).sum()),
            }
        return shown


def _shown_surface(label: str, surface: Surface) -> dict[str, Any]:
    peak = find_peak(surface)
    radius = surface.shape[0] // 2
    return {
        "label": label,
        "uri": pictures.surface_uri(surface),
        "radius": radius,
        "peak": peak,
        # Position of the peak in a picture of (2 radius + 1)² unit squares.
        "at": [radius + 0.5 + shift for shift in peak.shift_px],
    }
