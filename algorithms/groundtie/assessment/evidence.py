"""The files that a registration is given and measured by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..errors import GeoreferencingError, ParameterError, SameFileError
from ..geometry.transform import Transform, load_transform
from ..kinds import check_different
from ..rasters.reading import RasterSource
from ..registration.stored_transform import load_stored, transform_of
from .accuracy import Assessment
from .consistency import Leg, consistency
from .measuring import measure_check_points, measure_tie_points
from .point_errors import PointErrors


@dataclass(frozen=True)
class AssessmentFiles:
    """The files that a registration is given and measured by; None: not given."""

    transform: Path | None
    tie_points: Path | None
    check_points: Path | None
    back_transform: Path | None
    onward_transform: Path | None
    closing_transform: Path | None
    direct_transform: Path | None

    @property
    def is_nominal(self) -> bool:
        """Whether it is the input's own georeferencing that is measured."""
        return self.transform is None and self.tie_points is None

    def check(
        self, images: Mapping[str, Path | None], max_error_px: float | None, report: Path | None
    ) -> None:
        """Raise if the parameters do not go together; `images` are reference and input."""
        closing = self.closing_transform, self.direct_transform
        if None not in closing or (closing == (None, None)) != (self.onward_transform is None):
            raise ParameterError(
                "three-way consistency needs onward_transform and either closing_transform or "
                "direct_transform"
            )
        by_consistency = self.back_transform is not None or self.onward_transform is not None
        if self.is_nominal and by_consistency:
            raise ParameterError("consistency needs a transform or tie points")
        by_points = self.tie_points is not None or self.check_points is not None
        by_eye = report is not None and None not in images.values()
        if not (by_points or by_eye or by_consistency):
            raise ParameterError(
                "there is nothing to judge by: give check_points, tie_points, back_transform, or "
                "reference, input and report"
            )
        if max_error_px is not None and not by_points:
            raise ParameterError("max_error needs points: give check_points or tie_points")
        check_different({name: path for name, path in images.items() if path is not None})
        numbers = None if report is None else report.with_suffix(".json").resolve()
        for name, path in {**vars(self), **images}.items():
            if path is not None and path.resolve() == numbers:
                raise SameFileError(f"{name} would be overwritten by the report's JSON: {path}")

    def registration(
        self, model: str, reference: RasterSource | None, input: RasterSource | None
    ) -> Transform:
        """Return the transform that is measured; `model` is fitted to tie points without one."""
        if self.transform is not None:
            found = load_transform(self.transform)
            return found if input is None else transform_of(found, input, self.transform)
        if input is None:
            raise ParameterError(
                "give a transform, or the input image, whose georeferencing is measured without one"
            )
        if self.tie_points is not None:
            return load_stored(self.tie_points, model, input)[0]
        crs = input.grid.crs if reference is None else reference.grid.crs
        if (crs is None) != (input.grid.crs is None):
            raise GeoreferencingError(f"only one of {input.path} and the reference has a CRS")
        return Transform.nominal(crs, input.grid)

    def measure(self, found: Transform, max_error_px: float | None) -> Assessment:
        """Measure a transform by all evidence there is."""
        parts: dict[str, PointErrors] = {}
        if self.tie_points is not None:
            measured = measure_tie_points(self.tie_points, found, max_error_px)
            parts["control_points"], parts["test_points"] = measured
        if self.check_points is not None:
            parts["check_points"] = measure_check_points(self.check_points, found)
        subject = Leg(str(self.transform or self.tie_points), found)
        if self.back_transform is not None:
            parts["two_way"] = consistency(subject, [_leg(self.back_transform)])
        last = self.closing_transform or self.direct_transform
        if self.onward_transform is not None and last is not None:
            way = [_leg(self.onward_transform), _leg(last, self.closing_transform is None)]
            parts["three_way"] = consistency(subject, way)
        return Assessment(**parts)


def _leg(path: Path, reverse: bool = False) -> Leg:
    return Leg(str(path), load_transform(path), reverse)
