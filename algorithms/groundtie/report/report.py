"""The report on a registration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..assessment.comparison import Comparison, without_masks
from ..assessment.point_errors import PointErrors
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..masks.used import MaskUsed
from ..matching.survey import Survey
from ..rasters.pair import ImagePair
from ..registration.registered_output import BeyondOverlap
from ..registration.verdict import Verdict
from ..similarity.peak import find_peak
from ..similarity.surface import Surface
from . import details, figures, parts, pictures
from .correction import Correction
from .page import Page


@dataclass(frozen=True)
class Report(Page):
    """What is shown of a registration, whatever the verdict.

    Parameters
    ----------
    verdict
        Whether the registration can be trusted.
    pair
        The images; their rasters are open.
    points
        All tie points; None if the registration did not come as far.
    transform
        The transform, also a refused one; None if there is none.
    surfaces
        Labels and similarity surfaces, shape (2 r + 1, 2 r + 1), of remarkable points.
    mask
        Which mask was used.
    scene
        Facts about the images by their names.
    survey
        What chips all over the overlap show of parts that lie elsewhere; None: not looked at.
    beyond
        What of the written image lies outside of the overlap; None: nothing.
    tried
        What was tried, a line each; empty where there was nothing to choose.
    """

    verdict: Verdict
    pair: ImagePair
    points: TiePoints | None
    transform: Transform | None
    surfaces: tuple[tuple[str, Surface], ...]
    mask: MaskUsed
    scene: Mapping[str, Any]
    survey: Survey | None
    beyond: BeyondOverlap | None = None
    tried: tuple[str, ...] = ()
    template: ClassVar[str] = "report.html.j2"

    def numbers(self) -> dict[str, Any]:
        """Return what was measured, by name."""
        moved, beyond = self.correction(), self.beyond
        return {
            "verdict": self.verdict.summary(),
            "correction": None if moved is None else moved.summary(),
            "transform": None if self.transform is None else self.transform.to_json(),
            "mask": self.mask.summary(),
            "scene": dict(self.scene),
            **({} if self.survey is None else {"parts": parts.summary(self.survey)}),
            **({} if beyond is None else {"outside_of_overlap": beyond.summary()}),
            **({"tried": list(self.tried)} if self.tried else {}),
        }

    def correction(self) -> Correction | None:
        """Return how far the transform moves the input; None without one."""
        return None if self.transform is None else Correction.of(self.transform, self.pair.grid)

    def values(self) -> dict[str, Any]:
        """Return what the template shows."""
        found, grid = self.transform, self.pair.grid
        beyond = () if self.beyond is None else (self.beyond.line(),)
        return {
            "verdict": self.verdict,
            "grid": grid,
            "notes": [*self.pair.notes(), self.mask.line(), *beyond],
            "metres": grid.metres_per_pixel,
            "model": None if found is None else found.model.kind,
            "correction": self.correction(),
            "pictures": Comparison.of(self.pair, found),
            "residuals": None if self.points is None else self._residual_figures(self.points),
            "surfaces": [_shown_surface(label, surface) for label, surface in self.surfaces],
            "scene": self.scene,
            "tried": self.tried,
            "details": self._details(),
            "parts": None if self.survey is None else parts.shown(self.survey),
        }

    def _details(self) -> list[dict[str, Any]]:
        """Return chips at full resolution; none without a transform."""
        if self.transform is None or self.points is None:
            return []
        errors = PointErrors.on_grid(self.points, self.transform, self.pair.grid)
        return details.shown(without_masks(self.pair), self.transform, errors)

    def _residual_figures(self, points: TiePoints) -> dict[str, Any]:
        """Return the figures that the points allow."""
        grid, verdict = self.pair.grid, self.verdict
        if self.transform is None:
            return {"map": figures.svg_uri(figures.point_map(points, grid)), "errors": False}
        errors = PointErrors.on_grid(points, self.transform, grid)
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
        # Where the peak lies in a picture of (2 radius + 1)² unit squares.
        "at": [radius + 0.5 + shift for shift in peak.shift_px],
    }
