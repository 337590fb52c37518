"""The files that hold a registration and its evidence, and errors at the points of a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..call_paths import check_different
from ..errors import (
    GeoreferencingError,
    ParameterError,
    TooFewPointsError,
)
from ..geometry.tie_point_files import read_tie_points
from ..geometry.tie_points import NONE_HELD_OUT, TiePoints
from ..geometry.transform import Transform, load_transform
from ..rasters.grid import reproject, require_both_or_none
from ..rasters.reading import RasterSource
from ..registration.stored_transform import load_stored, require_no_model, transform_of
from .accuracy import Assessment
from .consistency import Leg, consistency
from .point_errors import PointErrors


@dataclass(frozen=True)
class AssessmentFiles:
    """The files that hold a registration and its evidence; None: not given."""

    transform: Path | None
    tie_points: Path | None
    check_points: Path | None
    back_transform: Path | None
    onward_transform: Path | None
    closing_transform: Path | None
    direct_transform: Path | None

    @property
    def is_nominal(self) -> bool:
        """Whether the input's own georeferencing is measured."""
        return self.transform is None and self.tie_points is None

    def check(
        self, images: Mapping[str, Path | None], max_error_px: float | None, has_report: bool
    ) -> None:
        """Raise an error if parameters contradict each other; `images` are reference and input."""
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
        by_eye = has_report and None not in images.values()
        if not (by_points or by_eye or by_consistency):
            raise ParameterError(
                "there is nothing to judge by: give check_points, tie_points or back_transform, or "
                "both images and a report"
            )
        if max_error_px is not None and not by_points:
            raise ParameterError("max_error needs points: give check_points or tie_points")
        check_different({name: path for name, path in images.items() if path is not None})

    def registration(
        self, model: str | None, reference: RasterSource | None, input: RasterSource | None
    ) -> Transform:
        """Return the measured transform: the given one, `model` of tie points, or the nominal."""
        if self.transform is not None:
            require_no_model(model, self.transform)
            found = load_transform(self.transform)
            return found if input is None else transform_of(found, input, self.transform)
        if input is None:
            raise ParameterError(
                "give a transform, or the input image, whose georeferencing is measured without one"
            )
        if self.tie_points is not None:
            return load_stored(self.tie_points, model, input)[0]
        if model is not None:
            raise ParameterError("a model (model) is fitted to tie points: there are none")
        crs = input.grid.crs if reference is None else reference.grid.crs
        require_both_or_none(crs, input.grid.crs, f"{input.path} and the reference")
        return Transform.nominal(crs, input.grid)

    def measure(
        self, found: Transform, max_error_px: float | None, reference: RasterSource | None
    ) -> Assessment:
        """Measure a transform by all evidence."""
        parts: dict[str, PointErrors] = {}
        pixel_px = matching_px(found, reference)
        if self.tie_points is not None:
            measured = measure_tie_points(self.tie_points, found, max_error_px, pixel_px)
            parts["control_points"], parts["test_points"] = measured
        if self.check_points is not None:
            check = measure_check_points(self.check_points, found, self.tie_points)
            parts["check_points"] = check.matched_in(pixel_px)
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


def matching_px(transform: Transform, reference: RasterSource | None) -> float:
    """Return the size of a matching pixel in input pixels.

    Matching pixels are those of the coarser image, or of the input without a reference.
    """
    if reference is None:
        return 1.0
    grid = reference.grid
    pixels = np.add(grid.centre_px, [[0, 0], [1, 0], [0, 1]])
    first, right, down = transform.of_map(grid.crs)(grid.pixel_to_map(pixels))
    sides = np.hypot(*np.subtract([right, down], first).T)
    # If the reference's centre has no position in the input, the input's pixels are taken.
    return float(sides[np.isfinite(sides)].max(initial=1.0))


def measure_tie_points(
    path: Path,
    transform: Transform,
    max_error_px: float | None = None,
    pixel_px: float = 1.0,
) -> tuple[PointErrors, PointErrors]:
    """Measure a transform at its control points and at its test points, in a file of tie points.

    Control points have the role "fit", test points the role "check". `pixel_px` is the size of a
    matching pixel in input pixels. Raises as `read_points`.
    """
    points = read_points(path, transform)
    control, test = (
        _errors(transform, points, which).matched_in(pixel_px)
        for which in (points.fit, points.check)
    )
    return control, test.of_inliers(max_error_px)


def measure_check_points(
    path: Path, transform: Transform, tie_points: Path | None = None
) -> PointErrors:
    """Measure a transform at independent points.

    If some points have a role, or the file is that of the registration's `tie_points`, only points
    with the role "check" take part.

    Raises
    ------
    TooFewPointsError
        All points took part in the fit.
    TransformFileError, GeoreferencingError
        As `read_points`, which raises TooFewPointsError, too.
    """
    points = read_points(path, transform)
    is_of_the_fit = tie_points is not None and tie_points.resolve() == path.resolve()
    which = points.check if is_of_the_fit else points.independent
    if not which.any():
        raise TooFewPointsError(f"{path}: {NONE_HELD_OUT}")
    return _errors(transform, points, which)


def read_points(path: Path, transform: Transform) -> TiePoints:
    """Read tie points, or a CSV table of points, with reference positions in a transform's CRS.

    Parameters
    ----------
    path
        The file: see `geometry.tie_point_files`.
    transform
        Reference positions of a CSV table without a CRS are on its map. Its input grid locates the
        points in the input.

    Raises
    ------
    TransformFileError
        The file cannot be read or understood.
    TooFewPointsError
        All points are rejected, or there are none.
    GeoreferencingError
        Only one of the file and the transform has a CRS, or a position lies outside of the map's.
    """
    points = read_tie_points(path, transform.input_grid, table_crs=transform.crs)
    if not points.used.any():
        raise TooFewPointsError(f"{path} holds no points that are used")
    require_both_or_none(points.crs, transform.crs, f"{path} and the transform")
    xy = reproject(points.reference_xy, points.crs, transform.crs)
    if not np.isfinite(xy).all():
        raise GeoreferencingError(f"{path} holds positions outside of a map's projection")
    return replace(points, reference_xy=xy, crs=transform.crs)


def _errors(transform: Transform, points: TiePoints, which: NDArray[np.bool_]) -> PointErrors:
    if not which.any():
        return PointErrors.none()
    return PointErrors.of(transform, points.reference_xy[which], points.input_px[which])
