"""The report that a person looks at: one HTML page without network, and its numbers as JSON."""

from __future__ import annotations

import json
import math
import os
import platform
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rasterio
import scipy

from ..assessment.accuracy import Assessment
from ..assessment.comparison import Comparison
from ..geometry.judging import TOLERANCE_PX
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..masks.choice import MaskUsed
from ..rasters.atomic import writing
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..registration.verdict import Verdict
from ..similarity.peak import find_peak
from ..similarity.surface import Surface
from ..version import __version__
from . import figures, pictures

_TEMPLATES = Path(__file__).with_name("templates")

COLOURS = {
    "fit": figures.FIT_COLOUR,
    "check": figures.CHECK_COLOUR,
    "rejected": figures.REJECTED_COLOUR,
}

# What an assessment's parts are called.
PART_LABELS = {
    "control_points": "control points",
    "test_points": "test points",
    "check_points": "check points",
    "two_way": "two-way consistency",
    "three_way": "three-way consistency",
}

# The model's correction is looked at on a lattice of so many points a side.
_LATTICE = 9


@dataclass(frozen=True)
class Report:
    """What is shown of a registration, whatever the verdict.

    Parameters
    ----------
    title
        Heading of the page.
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
    parameters
        What the tool was called with.
    seconds
        How long it took.
    mask
        Which mask was used; None: no question of one.
    """

    title: str
    verdict: Verdict
    pair: ImagePair
    points: TiePoints | None
    transform: Transform | None
    surfaces: tuple[tuple[str, Surface], ...]
    parameters: dict[str, Any]
    seconds: float
    mask: MaskUsed | None = None

    def summary(self) -> dict[str, Any]:
        """Return the report's numbers as values that strict JSON can carry."""
        values = {
            "verdict": self.verdict.summary(),
            "transform": None if self.transform is None else self.transform.to_json(),
            "mask": None if self.mask is None else self.mask.summary(),
            "parameters": self.parameters,
            "versions": versions(),
            "seconds": self.seconds,
        }
        return {name: plain(value) for name, value in values.items()}

    def write(self, html_path: str | os.PathLike[str], json_path: str | os.PathLike[str]) -> None:
        """Write the page and its numbers.

        Raises
        ------
        OutputError
            A file cannot be written.
        """
        summary = self.summary()
        write_page(html_path, self._page(summary), json_path, summary)

    def _page(self, summary: dict[str, Any]) -> str:
        return rendered(
            "report.html.j2",
            title=self.title,
            verdict=self.verdict,
            grid=self.pair.grid,
            notes=[*self.pair.notes(), *([] if self.mask is None else [self.mask.line()])],
            metres=_metres_per_px(self.pair.grid),
            model=None if self.transform is None else self.transform.model.kind,
            correction=_Correction.of(self.transform, self.pair.grid),
            pictures=Comparison.of(self.pair, self.transform),
            residuals=self._residual_figures(),
            tolerance_px=TOLERANCE_PX,
            colours=COLOURS,
            surfaces=[_shown_surface(label, surface) for label, surface in self.surfaces],
            parameters=summary["parameters"],
            versions=summary["versions"],
            seconds=self.seconds,
        )

    def _residual_figures(self) -> dict[str, Any] | None:
        """Return the figures that the points allow."""
        grid, verdict = self.pair.grid, self.verdict
        if self.points is None:
            return None
        if self.transform is None:
            return {"map": figures.svg_uri(figures.point_map(self.points, grid)), "errors": False}
        residuals = figures.Residuals.of(self.points, self.transform, grid)
        reach = figures.error_reach_px(residuals, verdict)
        shown = {
            "map": figures.svg_uri(figures.residual_map(residuals, grid)),
            "exaggeration": figures.residual_arrows(residuals, grid).exaggeration,
            "errors": bool(residuals.check.any()),
        }
        if shown["errors"]:
            histogram = figures.error_histogram(residuals, verdict, _metres_per_px(grid))
            shown |= {
                "histogram": figures.svg_uri(histogram),
                "scatter": figures.svg_uri(figures.error_scatter(residuals, verdict)),
                "measured": int(residuals.check.sum()),
                "reach_px": reach,
                "beyond": int((residuals.length_px[residuals.check] > reach).sum()),
            }
        return shown


@dataclass(frozen=True)
class AssessmentReport:
    """What is shown of how good a registration is that was made before.

    Parameters
    ----------
    title
        Heading of the page.
    assessment
        All that was measured.
    verdict
        Whether the registration can be trusted; None if no largest error was asked for.
    transform
        What was measured.
    comparison
        The images; None if they were not given.
    parameters
        What the tool was called with.
    seconds
        How long it took.
    """

    title: str
    assessment: Assessment
    verdict: Verdict | None
    transform: Transform
    comparison: Comparison | None
    parameters: dict[str, Any]
    seconds: float

    def summary(self) -> dict[str, Any]:
        """Return the report's numbers as values that strict JSON can carry."""
        values = {
            "verdict": None if self.verdict is None else self.verdict.summary(),
            **self.assessment.summary(),
            "transform": self.transform.to_json(),
            "parameters": self.parameters,
            "versions": versions(),
            "seconds": self.seconds,
        }
        return {name: plain(value) for name, value in values.items()}

    def write(self, html_path: str | os.PathLike[str], json_path: str | os.PathLike[str]) -> None:
        """Write the page and its numbers.

        Raises
        ------
        OutputError
            A file cannot be written.
        """
        summary = self.summary()
        parts = {name: errors for name, errors in self.assessment.parts().items() if len(errors)}
        page = rendered(
            "assessment.html.j2",
            title=self.title,
            verdict=self.verdict,
            parts=parts,
            labels=PART_LABELS,
            metres=any(errors.error_m is not None for errors in parts.values()),
            model=self.transform.model.kind,
            pictures=self.comparison,
            map=self._error_map(),
            colours=COLOURS,
            tolerance_px=TOLERANCE_PX,
            parameters=summary["parameters"],
            versions=summary["versions"],
            seconds=self.seconds,
        )
        write_page(html_path, page, json_path, summary)

    def _error_map(self) -> dict[str, Any] | None:
        """Return the figure of the errors at all points, over the input."""
        held_out = (self.assessment.test_points, self.assessment.check_points)
        every = [(self.assessment.control_points, False), *((errors, True) for errors in held_out)]
        # A wrong match is shown: as a check point that disagrees.
        residuals = figures.Residuals(
            np.concatenate([errors.input_px for errors, _ in every]),
            np.concatenate([errors.error_px for errors, _ in every]),
            np.concatenate([np.full(len(errors), check) for errors, check in every]),
            np.concatenate([errors.placed for errors, _ in every]),
        )
        if not residuals.used.any():
            return None
        grid = self.transform.input_grid
        return {
            "uri": figures.svg_uri(figures.residual_map(residuals, grid)),
            "exaggeration": figures.residual_arrows(residuals, grid).exaggeration,
            "width": grid.width,
            "height": grid.height,
        }


@dataclass(frozen=True)
class _Correction:
    """How far the input was off, in matching pixels: at the centre, and at least and most."""

    centre_px: float
    least_px: float
    most_px: float

    @classmethod
    def of(cls, transform: Transform | None, grid: Grid) -> _Correction | None:
        if transform is None:
            return None
        cols, rows = np.meshgrid(
            np.linspace(0, grid.width - 1, _LATTICE), np.linspace(0, grid.height - 1, _LATTICE)
        )
        px = np.column_stack([cols.ravel(), rows.ravel()])
        moved = grid.map_to_pixel(transform.model(grid.pixel_to_map(px))) - px
        lengths = np.hypot(*moved.T)
        centre = float(lengths[len(lengths) // 2])
        return cls(centre, float(lengths.min()), float(lengths.max()))


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    return {
        "groundtie": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "opencv": cv2.__version__,
        "rasterio": rasterio.__version__,
        "gdal": rasterio.__gdal_version__,
    }


def rendered(template: str, **values: Any) -> str:
    """Return a page made from one of the templates."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(number=_number, percent=_percent)
    environment.tests["finite"] = math.isfinite
    return environment.get_template(template).render(**values)


def write_page(
    html_path: str | os.PathLike[str],
    page: str,
    json_path: str | os.PathLike[str],
    summary: dict[str, Any],
) -> None:
    """Write a page and its numbers as JSON.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    with writing(html_path):
        Path(html_path).write_text(page, encoding="utf-8")
    with writing(json_path):
        text = json.dumps(summary, indent=1, allow_nan=False, ensure_ascii=False)
        Path(json_path).write_text(text, encoding="utf-8")


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


def _metres_per_px(grid: Grid) -> float | None:
    return grid.pixel_size_m if grid.is_georeferenced else None


def _number(value: float | None, digits: int = 2) -> str:
    if value is None or not math.isfinite(value):
        return "–"
    # Adding 0 turns -0.0 into 0.0.
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _percent(value: float) -> str:
    return f"{value:.0%}".replace("%", " %") if math.isfinite(value) else "–"


def plain(value: Any) -> Any:
    """Return a value as JSON can carry it: what is not finite is None, what is no value text."""
    if isinstance(value, dict):
        return {str(name): plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
