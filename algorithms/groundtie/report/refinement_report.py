"""The report on refined RPCs: a table as S 5.7, the errors as arrows, the image on the map."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from ..assessment.comparison import Comparison
from ..geometry.judging import TOLERANCE_PX
from ..masks.choice import MaskUsed
from ..rasters.grid import Grid
from ..registration.refinement_verdict import RefinementVerdict
from ..sensor.bias import Bias
from . import figures
from .report import COLOURS, plain, rendered, versions, write_page


@dataclass(frozen=True)
class RefinementReport:
    """What is shown of refined RPCs, whatever the verdict.

    Parameters
    ----------
    title
        Heading of the page.
    judged
        The verdict, and the errors before and after.
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
    warnings
        What speaks against them.
    comparison
        Reference and image on the map; None: there is no reference.
    mask
        What of the reference took part; None without one.
    parameters
        What the tool was called with.
    seconds
        How long it took.
    """

    title: str
    judged: RefinementVerdict
    bias: Bias
    residuals: figures.Residuals
    grid: Grid
    pixel_m: float
    heights: str
    warnings: tuple[str, ...]
    comparison: Comparison | None
    mask: MaskUsed | None
    parameters: dict[str, Any]
    seconds: float

    def summary(self) -> dict[str, Any]:
        """Return the report's numbers as values that strict JSON can carry."""
        values = {
            "verdict": self.judged.summary(),
            "bias": self.bias.to_json(),
            "heights": {"used": self.heights, "warnings": self.warnings},
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
        summary, verdict = self.summary(), self.judged.verdict
        measured = {"before": self.judged.before, "after": self.judged.after}
        page = rendered(
            "refinement.html.j2",
            title=self.title,
            verdict=verdict,
            held_out=self.judged.held_out,
            errors={
                name: {"px": each, "m": each.scaled(self.pixel_m)}
                for name, each in measured.items()
            },
            bias=self.bias,
            shift=list(zip(("column", "row"), *self.bias.shift_px(), strict=True)),
            facts=[self.heights, *([] if self.mask is None else [self.mask.line()])],
            warnings=self.warnings,
            map=figures.svg_uri(figures.residual_map(self.residuals, self.grid)),
            histogram=figures.svg_uri(
                figures.error_histogram(self.residuals, verdict, self.pixel_m)
            ),
            scatter=figures.svg_uri(figures.error_scatter(self.residuals, verdict)),
            exaggeration=figures.residual_arrows(self.residuals, self.grid).exaggeration,
            grid=self.grid,
            pictures=self.comparison,
            colours=COLOURS,
            tolerance_px=TOLERANCE_PX,
            parameters=summary["parameters"],
            versions=summary["versions"],
            seconds=self.seconds,
        )
        write_page(html_path, page, json_path, summary)
