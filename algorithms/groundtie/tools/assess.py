"""Judge a registration that was made before, by points, by consistency and by eye."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from ..assessment.accuracy import Assessment
from ..assessment.comparison import Comparison, compare
from ..assessment.consistency import Leg, consistency
from ..assessment.measuring import measure_check_points, measure_tie_points
from ..assessment.point_errors import PointErrors
from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..errors import GeoreferencingError, NotRegisteredError, ParameterError, SameFileError
from ..geometry.models import KINDS
from ..geometry.transform import Transform, load_transform
from ..kinds import Choice, FileIn, FileOut, Number, RasterIn, check_different
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import RasterSource, bounded_cache, open_raster
from ..registration.stored_transform import load_stored, transform_of
from ..registration.verdict import Verdict
from ..report.assessment_report import PART_LABELS, AssessmentReport

_TABLES = (".gpkg", ".geojson", ".csv", ".points")


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
        return lines + [f"{name}: {path}" for name, path in self.files.items()]


def _lines(label: str, errors: PointErrors) -> list[str]:
    px, metres = errors.in_pixels, errors.in_metres

    def both(name: str) -> str:
        in_metres = f" ({getattr(metres, name):.2f} m)" if errors.error_m is not None else ""
        return f"{getattr(px, name):.2f} px{in_metres}"

    return [
        f"{label}: {errors.used.sum()} of {len(errors)} points, RMSE {both('rmse')}, "
        f"mean {both('mean')}, median {both('median')}, CE90 {both('ce90')}, "
        f"largest {both('largest')}",
        f"  bias {px.bias[0]:+.2f}, {px.bias[1]:+.2f} px, standard deviation {px.std[0]:.2f}, "
        f"{px.std[1]:.2f} px (columns, rows)",
    ]


@tool(
    title="Assess a registration",
    group="Quality",
    outputs=(
        ResultOutput("CHECK_RMSE_PX", "Error at check points (px)", "check_points.rmse_px"),
        ResultOutput("CHECK_CE90_M", "CE90 at check points (m)", "check_points.ce90_m"),
        ResultOutput("TEST_RMSE_PX", "Error at test points (px)", "test_points.rmse_px"),
        ResultOutput("CONTROL_RMSE_PX", "Error at control points (px)", "control_points.rmse_px"),
        ResultOutput("TWO_WAY_RMSE_PX", "Two-way consistency (px)", "two_way.rmse_px"),
        ResultOutput("THREE_WAY_RMSE_PX", "Three-way consistency (px)", "three_way.rmse_px"),
    ),
)
def assess(
    transform: Annotated[
        Path | None,
        FileIn(
            label="Transform",
            help="The registration: a transform from reference to input. Without it, it is fitted "
            "to the tie points; without these, the input's own georeferencing is judged.",
            suffixes=(".json",),
        ),
    ] = None,
    tie_points: Annotated[
        Path | None,
        FileIn(
            label="Tie points",
            help="The points of the registration: those with the role fit are control points, "
            "those with the role check are test points.",
            suffixes=_TABLES,
        ),
    ] = None,
    check_points: Annotated[
        Path | None,
        FileIn(
            label="Check points",
            help="Points that are independent of the registration: tie points, or a CSV table "
            "with the columns reference_x, reference_y and input_col, input_row (or input_x, "
            "input_y).",
            suffixes=_TABLES,
        ),
    ] = None,
    back_transform: Annotated[
        Path | None,
        FileIn(
            label="Transform back",
            help="The registration of the reference to the input, for two-way consistency.",
            suffixes=(".json",),
        ),
    ] = None,
    reference: Annotated[
        Path | None,
        RasterIn(
            label="Reference image",
            help="For the report's pictures: the image whose georeferencing is right.",
        ),
    ] = None,
    input: Annotated[
        Path | None,
        RasterIn(
            label="Input image",
            help="The image that was registered, for the report's pictures. It is needed where "
            "there is no transform, as it tells where its pixels claim to be.",
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
        FileOut(
            label="Report",
            help="A page with the errors and, if both images are given, swipe and checkerboard; "
            "its numbers are put beside it as JSON. It is written for a refusal, too.",
            suffixes=(".html",),
        ),
    ] = None,
    onward_transform: Annotated[
        Path | None,
        FileIn(
            label="Transform onward",
            help="For three-way consistency: the registration of a third image to the input "
            "(the input is its reference). It needs the transform closing or direct, too.",
            suffixes=(".json",),
            advanced=True,
        ),
    ] = None,
    closing_transform: Annotated[
        Path | None,
        FileIn(
            label="Transform closing",
            help="For three-way consistency: the registration of the reference to the third image "
            "(the third image is its reference).",
            suffixes=(".json",),
            advanced=True,
        ),
    ] = None,
    direct_transform: Annotated[
        Path | None,
        FileIn(
            label="Transform direct",
            help="For three-way consistency, in place of the closing transform: the registration "
            "of the third image to the reference; its inverse is taken.",
            suffixes=(".json",),
            advanced=True,
        ),
    ] = None,
    model: Annotated[
        str,
        Choice(
            label="Model",
            help="What is fitted to tie points where there is no transform.",
            choices=KINDS,
            advanced=True,
        ),
    ] = "affine",
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> AssessmentResult:
    """Judge a registration that was made before, by points, by consistency and by eye.

    Errors are measured at control points (no measure of accuracy), at test points, at independent
    check points, and as the consistency of several transforms: RMSE, mean, median, CE90, largest,
    bias and standard deviation, in input pixels and metres. Only points that took no part in the
    fit can confirm a registration; inconsistency can refuse it, too.
    """
    started = time.perf_counter()
    files = _Files(
        transform, tie_points, check_points, back_transform,
        onward_transform, closing_transform, direct_transform,
    )  # fmt: skip
    _check_call(files, reference, input, max_error, report)
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())
        reference_source, input_source = (
            None if path is None else stack.enter_context(open_raster(path))
            for path in (reference, input)
        )
        progress.update(0.0, "measuring")
        found = files.registration(model, reference_source, input_source)
        assessment = files.measure(found, max_error)
        verdict = None if max_error is None else assessment.judge(max_error)
        progress.update(0.3, "drawing")
        comparison = None
        if report is not None and reference_source is not None and input_source is not None:
            comparison = _pictures(files, reference_source, input_source, found)
    subject = str(transform or tie_points or input)
    page = AssessmentReport(
        title=f"Assessment of {Path(subject).name}",
        assessment=assessment,
        verdict=verdict,
        transform=found,
        comparison=comparison,
        parameters={k: v for k, v in parameters.items() if v is not None},
        seconds=time.perf_counter() - started,
    )
    progress.update(0.8, "writing")
    written = {}
    with Outputs() as outputs:
        if report is not None:
            page.write(outputs.stage(report), outputs.stage(report.with_suffix(".json")))
            written["report"] = str(report)
    if verdict is not None and not verdict.accepted:
        raise NotRegisteredError(f"{subject} is refused: {verdict.reason}", verdict)
    return AssessmentResult(assessment, verdict, found, page.summary(), written)


@dataclass(frozen=True)
class _Files:
    """The files that a registration is given and measured by; None: not given."""

    transform: Path | None
    tie_points: Path | None
    check_points: Path | None
    back_transform: Path | None
    onward_transform: Path | None
    closing_transform: Path | None
    direct_transform: Path | None

    @property
    def is_claimed(self) -> bool:
        """Whether it is the input's own georeferencing that is judged."""
        return self.transform is None and self.tie_points is None

    def registration(
        self, model: str, reference: RasterSource | None, input: RasterSource | None
    ) -> Transform:
        """Return the transform that is judged."""
        if self.transform is not None:
            found = load_transform(self.transform)
            return found if input is None else transform_of(found, input, self.transform)
        if input is None:
            raise ParameterError(
                "give a transform, or the input image, which tells where its pixels claim to be"
            )
        if self.tie_points is not None:
            return load_stored(self.tie_points, model, input)[0]
        crs = input.grid.crs if reference is None else reference.grid.crs
        if (crs is None) != (input.grid.crs is None):
            raise GeoreferencingError(f"only one of {input.path} and the reference has a CRS")
        return Transform.nominal(crs, input.grid)

    def measure(self, found: Transform, max_error_px: float | None) -> Assessment:
        """Measure a transform by all evidence there is."""
        measured = Assessment()
        if self.tie_points is not None:
            control, test = measure_tie_points(self.tie_points, found, max_error_px)
            measured = replace(measured, control_points=control, test_points=test)
        if self.check_points is not None:
            check = measure_check_points(self.check_points, found)
            measured = replace(measured, check_points=check)
        subject = Leg(str(self.transform or self.tie_points), found)
        if self.back_transform is not None:
            measured = replace(measured, two_way=consistency(subject, [_leg(self.back_transform)]))
        if self.onward_transform is not None:
            last = _leg(
                self.closing_transform or self.direct_transform,
                reverse=self.closing_transform is None,
            )
            way = [_leg(self.onward_transform), last]
            measured = replace(measured, three_way=consistency(subject, way))
        return measured


def _leg(path: Path | None, reverse: bool = False) -> Leg:
    assert path is not None
    return Leg(str(path), load_transform(path), reverse)


def _pictures(
    files: _Files, reference: RasterSource, input: RasterSource, found: Transform
) -> Comparison:
    drawn = compare(reference, input, found)
    # There is no before and after where the input is believed.
    return replace(drawn, registered=None) if files.is_claimed else drawn


def _check_call(
    files: _Files,
    reference: Path | None,
    input: Path | None,
    max_error: float | None,
    report: Path | None,
) -> None:
    """Raise if the parameters do not go together."""
    ways = (files.closing_transform is not None) + (files.direct_transform is not None)
    if ways > 1 or ways != (files.onward_transform is not None):
        raise ParameterError(
            "three-way consistency needs onward_transform and either closing_transform or "
            "direct_transform"
        )
    if files.is_claimed and (
        files.back_transform is not None or files.onward_transform is not None
    ):
        raise ParameterError("consistency needs a transform or tie points")
    by_points = files.tie_points is not None or files.check_points is not None
    by_eye = reference is not None and input is not None and report is not None
    if not (
        by_points
        or by_eye
        or files.back_transform is not None
        or files.onward_transform is not None
    ):
        raise ParameterError(
            "there is nothing to judge by: give check_points, tie_points, back_transform, or "
            "reference, input and report"
        )
    if max_error is not None and not by_points:
        raise ParameterError("max_error needs points: give check_points or tie_points")
    given = {"reference": reference, "input": input}
    check_different({name: path for name, path in given.items() if path is not None})
    if report is not None:
        numbers = report.with_suffix(".json")
        for name, path in (vars(files) | given).items():
            if isinstance(path, Path) and path.resolve() == numbers.resolve():
                raise SameFileError(f"{name} would be overwritten by the report's JSON: {path}")
