"""Measure how good a registration is that was made before, by points, consistency and by eye."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from ..assessment.accuracy import Assessment
from ..assessment.comparison import Comparison, compare
from ..assessment.measuring import AssessmentFiles
from ..assessment.point_errors import PointErrors
from ..declaration import NO_VALUES, Output, Values, file_lines, given_files, tool
from ..errors import NotRegisteredError
from ..geometry.models import KINDS
from ..geometry.tie_point_files import SUFFIXES
from ..geometry.transform import Transform
from ..kinds import Choice, FileIn, Number, RasterIn
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import open_raster
from ..registration.verdict import Verdict
from ..report.assessment_report import PART_LABELS, AssessmentReport
from ..wording import signed
from .parameters import general


@dataclass(frozen=True)
class AssessmentResult:
    """What `assess` measured.

    Parameters
    ----------
    assessment
        The errors.
    verdict
        Whether the registration can be trusted; None if no largest error was asked for.
    transform
        What was measured.
    numbers
        The same as the report's JSON.
    files
        What was written, by name.
    """

    assessment: Assessment
    verdict: Verdict | None
    transform: Transform
    numbers: dict[str, Any]
    files: dict[str, str]

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {**self.numbers, "files": self.files}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        lines = [] if self.verdict is None else [f"accepted: {self.verdict.reason}"]
        for name, errors in self.assessment.parts().items():
            if len(errors):
                lines += _lines(PART_LABELS[name], errors)
        return lines + file_lines(self.files)


def _lines(label: str, errors: PointErrors) -> list[str]:
    px, metres = errors.in_pixels, errors.in_metres
    names = {"rmse": "RMSE", "mean": "mean", "median": "median", "ce90": "CE90",
             "largest": "largest"}  # fmt: skip
    lengths = [
        f"{label_of} {getattr(px, name):.2f} px"
        + (f" ({getattr(metres, name):.2f} m)" if errors.error_m is not None else "")
        for name, label_of in names.items()
    ]
    return [
        f"{label}: {errors.used.sum()} of {len(errors)} points, {', '.join(lengths)}",
        f"  bias {signed(px.bias[0])}, {signed(px.bias[1])} px, "
        f"standard deviation {px.std[0]:.2f}, {px.std[1]:.2f} px (columns, rows)",
    ]


def _transform_in(label: str, help: str, advanced: bool = True) -> FileIn:
    return FileIn(label=label, help=help, suffixes=(".json",), advanced=advanced)


@tool(
    title="Assess a registration",
    group="Quality",
    outputs=(
        Output("CHECK_RMSE_PX", "Error at check points (px)", "check_points.rmse_px"),
        Output("CHECK_CE90_M", "CE90 at check points (m)", "check_points.ce90_m"),
        Output("TEST_RMSE_PX", "Error at test points (px)", "test_points.rmse_px"),
        Output("CONTROL_RMSE_PX", "Error at control points (px)", "control_points.rmse_px"),
        Output("TWO_WAY_RMSE_PX", "Two-way consistency (px)", "two_way.rmse_px"),
        Output("THREE_WAY_RMSE_PX", "Three-way consistency (px)", "three_way.rmse_px"),
    ),
)
def assess(
    transform: Annotated[
        Path | None,
        _transform_in(
            "Transform",
            "The registration: a transform from reference to input. Without it, it is fitted "
            "to the tie points; without these, the input's own georeferencing is measured.",
            advanced=False,
        ),
    ] = None,
    tie_points: Annotated[
        Path | None,
        FileIn(
            help="The points of the registration: those with the role fit are control points, "
            "those with the role check are test points.",
            suffixes=SUFFIXES,
        ),
    ] = None,
    check_points: Annotated[
        Path | None,
        FileIn(
            help="Points that are independent of the registration: tie points, or a CSV table "
            "with the columns reference_x, reference_y and input_col, input_row (or input_x, "
            "input_y).",
            suffixes=SUFFIXES,
        ),
    ] = None,
    back_transform: Annotated[
        Path | None,
        _transform_in(
            "Transform back",
            "The registration of the reference to the input, for two-way consistency.",
            advanced=False,
        ),
    ] = None,
    reference: Annotated[
        Path | None,
        RasterIn(
            label="Reference image",
            help="The image whose georeferencing is right: for the report's pictures, and for the "
            "verdict, as test points were searched for in windows of the coarser image's pixels.",
        ),
    ] = None,
    input: Annotated[
        Path | None,
        RasterIn(
            label="Input image",
            help="The image that was registered, for the report's pictures. It is needed where "
            "there is no transform: its georeferencing gives the nominal positions.",
        ),
    ] = None,
    max_error: Annotated[
        float | None,
        Number(
            label="Largest error",
            help="The registration is refused if its root mean square error at check points "
            "(without any, at test points) is larger, or that of a consistency. By default "
            "there is no verdict.",
            unit="px",
            minimum=0.1,
            maximum=100,
        ),
    ] = None,
    report: Annotated[
        Path | None,
        general.report_page(
            "A page with the errors and, if both images are given, swipe and checkerboard",
            "a refusal",
        ),
    ] = None,
    onward_transform: Annotated[
        Path | None,
        _transform_in(
            "Transform onward",
            "For three-way consistency: the registration of a third image to the input "
            "(the input is its reference). It needs the transform closing or direct, too.",
        ),
    ] = None,
    closing_transform: Annotated[
        Path | None,
        _transform_in(
            "Transform closing",
            "For three-way consistency: the registration of the reference to the third image "
            "(the third image is its reference).",
        ),
    ] = None,
    direct_transform: Annotated[
        Path | None,
        _transform_in(
            "Transform direct",
            "For three-way consistency, in place of the closing transform: the registration "
            "of the third image to the reference; its inverse is taken.",
        ),
    ] = None,
    model: Annotated[
        str | None,
        Choice(
            help="What is fitted to tie points where there is no transform; affine by default.",
            choices=KINDS,
            advanced=True,
        ),
    ] = None,
    progress: Progress = SILENT,
    parameters: Values = NO_VALUES,
) -> AssessmentResult:
    """Measure how good a registration is that was made before, by points, consistency and by eye.

    Errors are measured at control points (no measure of accuracy), at test points, at independent
    check points, and as the consistency of several transforms: RMSE, mean, median, CE90, largest,
    bias and standard deviation, in input pixels and metres. Only points that took no part in the
    fit can confirm a registration; inconsistency can refuse it, too.
    """
    started = time.perf_counter()
    files = AssessmentFiles(
        transform, tie_points, check_points, back_transform,
        onward_transform, closing_transform, direct_transform,
    )  # fmt: skip
    images = {"reference": reference, "input": input}
    files.check(images, max_error, report is not None)
    comparison: Comparison | None = None
    with ExitStack() as stack:
        right, moving = (
            None if path is None else stack.enter_context(open_raster(path))
            for path in images.values()
        )
        progress.update(0.0, "measuring")
        found = files.registration(model, right, moving)
        assessment = files.measure(found, max_error, right)
        verdict = None if max_error is None else assessment.judge(max_error)
        progress.update(0.3, "drawing")
        if report is not None and right is not None and moving is not None:
            comparison = compare(right, moving, found)
            if files.is_nominal:  # nothing was registered: there is no before and after
                comparison = replace(comparison, registered=None)
    subject = str(transform or tie_points or input)
    page = AssessmentReport(
        assessment,
        verdict,
        found,
        comparison,
        title=f"Assessment of {Path(subject).name}",
        parameters=parameters,
        seconds=time.perf_counter() - started,
    )
    progress.update(0.8, "writing")
    with Outputs() as outputs:
        if report is not None:
            page.write(outputs, report)
    if verdict is not None and not verdict.accepted:
        raise NotRegisteredError(f"{subject} is refused: {verdict.reason}", verdict)
    written = given_files({"report": report})
    return AssessmentResult(assessment, verdict, found, page.summary(), written)
