"""The two jobs for images with RPCs: ground control from a reference, and refined RPCs by it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..context import Context, threads
from ..errors import ParameterError
from ..masks.used import MaskUsed
from ..matching.survey import Survey
from ..progress import Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import open_raster
from ..report.parts import coverage_lines, coverage_numbers
from ..sensor.control_points import ControlPoints, read_control_points
from ..sensor.heights import require_crs
from .asked import asked_masks, searched
from .ground_control import GroundControl, match_ground_control
from .refinement import RefinedRpc
from .refinement_output import RefinementFiles, require_place
from .sensor_input import Ground, OrientedImage, open_oriented_image
from .specification import Specification
from .verdict import Verdict


@dataclass(frozen=True)
class GcpResult:
    """The result of `extract_gcps`.

    Parameters
    ----------
    points
        The points, check points included.
    verdict
        Whether they can be trusted, by the check points.
    mask
        The mask that was used.
    output
        The file.
    heights
        Which heights were used, in words.
    survey
        The survey by chips all over the overlap; None: there was none.
    """

    points: ControlPoints
    verdict: Verdict
    mask: MaskUsed
    output: Path
    heights: str
    survey: Survey | None

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "output": str(self.output),
            "points": len(self.points),
            "points_used": int(self.points.used.sum()),
            "heights": self.heights,
            "mask": self.mask.summary(),
            "verdict": self.verdict.summary(),
            **coverage_numbers(self.survey),
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        points, verdict = self.points, self.verdict
        return [
            f"accepted: {verdict.reason}",
            f"{int(points.fit.sum())} of {int((~points.is_check).sum())} "
            f"points, and {int(points.check.sum())} check points",
            verdict.error_line(),
            *coverage_lines(self.survey),
            self.heights,
            self.mask.line(),
            f"wrote {self.output}",
        ]


def extract_control(parameters: Mapping[str, Any], progress: Progress) -> GcpResult:
    """Extract ground control as the tool `extract_gcps` does, from its parameters by name.

    Raises
    ------
    NotRegisteredError
        The points are refused; nothing is written.
    """
    output = parameters["output"]
    with threads(parameters["workers"], progress) as context, ExitStack() as stack:
        sensor, found = _matched(parameters, stack, context)
        assert found is not None
        points = found.accepted_points()
        with Outputs() as outputs:
            points.write(outputs.stage(output), sensor.orientation, sensor.source.grid)
    registration = found.registration
    return GcpResult(
        points,
        registration.verdict,
        registration.mask,
        output,
        sensor.heights,
        registration.survey,
    )


def refine(
    parameters: Mapping[str, Any], progress: Progress, files: RefinementFiles | None = None
) -> RefinedRpc:
    """Refine RPCs as the tool `refine_rpc` does, from its parameters by name.

    `files`, if given, are written instead of those of the parameters.

    Raises
    ------
    ParameterError
        There is neither a reference nor ground control, or both.
    NotRegisteredError
        The ground control or the refined RPCs are refused; the report is written.
    """
    files = files or RefinementFiles(
        parameters["output"], parameters["residuals"], parameters["report"], parameters
    )
    gcps = parameters["gcps"]
    if (parameters["reference"] is None) == (gcps is None):
        raise ParameterError("give either a reference or ground control points (gcps)")
    with threads(parameters["workers"], progress) as context, ExitStack() as stack:
        sensor, found = _matched(parameters, stack, context.part(0.0, 0.9))
        if found is None:
            points = read_control_points(
                gcps, sensor.orientation, sensor.source.grid, sensor.source.path
            )
        else:
            points = files.points_or_report(found)
        context.update(0.9, "estimating the bias")
        model, max_error_px = parameters["model"], parameters["max_error"]
        refined = RefinedRpc.of(points, sensor, model, max_error_px, found)
        for warning in refined.heights.warnings():
            context.update(0.9, warning)
        files.write(refined, sensor, found, context.part(0.9, 1.0).progress)
    return replace(refined, files=files.written())


def _matched(
    given: Mapping[str, Any], stack: ExitStack, context: Context
) -> tuple[OrientedImage, GroundControl | None]:
    """Return the oriented image, and ground control matched in the reference if there is one."""
    cover = given["dem_cover"] / 100
    ground = Ground(given["dem"], given["dem_datum"], given["geoid"], given["height"], cover)
    reference = None
    if given["reference"] is not None:
        reference = stack.enter_context(open_raster(given["reference"]))
    crs = None if reference is None else require_crs(reference)
    sensor = open_oriented_image(given["image"], given["rpc"], ground, crs, stack, context.progress)
    require_place(sensor.source, given["output"], given.get("residuals"), given.get("report"))
    if reference is None:
        return sensor, None
    spec = searched(Specification(), given, "image")
    bands = given["reference_band"], given["image_band"]
    masks = asked_masks(given, "image")
    return sensor, match_ground_control(sensor, reference, spec, bands, masks, stack, context)
