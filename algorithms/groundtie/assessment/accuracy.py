"""Errors of a registration at points: those of its fit, those held out, and check points.

Thesis S section 2.5.3: errors at control points only tell how well the model takes up the points
that it was fitted to; errors at test points, which took no part in the fit, tell how good it is.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike, NDArray

from ..errors import GeoreferencingError, TooFewPointsError, TransformFileError
from ..geometry.judging import (
    FEWEST_CHECK_POINTS,
    SMALLEST_INLIER_SHARE,
    USUAL_MAX_ERROR_PX,
    sigma_range_px,
)
from ..geometry.robust import fit_mixture
from ..geometry.tie_point_files import StoredTiePoints, read_tie_points
from ..geometry.tie_points import USED
from ..geometry.transform import Transform
from ..rasters.grid import Grid, reproject
from ..registration.verdict import Verdict

FloatArray = NDArray[np.float64]

# Search window of held-out points, in pixels², if residuals do not show a larger one.
_WINDOW_AREA_PX2 = 25.0**2


@dataclass(frozen=True)
class Statistics:
    """What there is to say of errors in one unit; NaN where nothing was measured.

    Parameters
    ----------
    rmse, mean, median
        Of the errors' lengths.
    ce90
        Radius of the circle that holds 90 % of the errors (quantile of their lengths).
    largest
        Largest length.
    bias, std
        Mean and standard deviation along both axes: RMSE² is the sum of all four squared.
    """

    rmse: float
    mean: float
    median: float
    ce90: float
    largest: float
    bias: tuple[float, float]
    std: tuple[float, float]

    @classmethod
    def of(cls, errors: FloatArray) -> Statistics:
        """Measure errors, shape (n, 2)."""
        if len(errors) == 0:
            nan = math.nan
            return cls(nan, nan, nan, nan, nan, (nan, nan), (nan, nan))
        lengths = np.hypot(*errors.T)
        bias, std = errors.mean(axis=0), errors.std(axis=0)
        return cls(
            float(np.sqrt((lengths**2).mean())),
            float(lengths.mean()),
            float(np.median(lengths)),
            # Hazen's quantile is the least biased of the simple ones at few points.
            float(np.percentile(lengths, 90, method="hazen")),
            float(lengths.max()),
            (float(bias[0]), float(bias[1])),
            (float(std[0]), float(std[1])),
        )

    def scaled(self, factor: float) -> Statistics:
        """Return the numbers in another unit."""
        bias, std = ((factor * x, factor * y) for x, y in (self.bias, self.std))
        return Statistics(
            factor * self.rmse,
            factor * self.mean,
            factor * self.median,
            factor * self.ce90,
            factor * self.largest,
            bias,
            std,
        )

    def summary(self, unit: str, axes: tuple[str, str]) -> dict[str, float]:
        """Return the numbers by names that end in the unit."""
        values = {
            "rmse": self.rmse,
            "mean": self.mean,
            "median": self.median,
            "ce90": self.ce90,
            "max": self.largest,
        }
        for name, pair in (("bias", self.bias), ("std", self.std)):
            values |= {f"{name}_{axis}": value for axis, value in zip(axes, pair, strict=True)}
        return {f"{name}_{unit}": value for name, value in values.items()}


@dataclass(frozen=True)
class PointErrors:
    """By how much a transform misses points.

    Parameters
    ----------
    input_px
        The points in the input image (col, row), shape (n, 2).
    error_px
        Where the input has the points minus where the transform puts them, input pixels, (n, 2).
    error_m
        Where the registered input shows the points minus where they are, metres along the axes
        of the reference map, shape (n, 2); None if there are no metres.
    counted
        False for wrong matches, which do not enter the statistics, shape (n,).
    """

    input_px: FloatArray
    error_px: FloatArray
    error_m: FloatArray | None
    counted: NDArray[np.bool_]

    @classmethod
    def of(cls, transform: Transform, reference_xy: ArrayLike, input_px: ArrayLike) -> PointErrors:
        """Measure a transform.

        Parameters
        ----------
        transform
            The transform.
        reference_xy
            The points on the reference map, in the transform's CRS, shape (n, 2).
        input_px
            The points in the input (col, row), shape (n, 2).
        """
        xy = np.asarray(reference_xy, float).reshape(-1, 2)
        px = np.asarray(input_px, float).reshape(-1, 2)
        error_m = None
        if transform.crs is not None or transform.input_grid.is_georeferenced:
            error_m = (transform.inverse(px) - xy) * _metres_per_unit(transform, xy)
        return cls(px, px - transform(xy), error_m, np.ones(len(px), bool))

    @classmethod
    def none(cls) -> PointErrors:
        """Return the errors at no points."""
        return cls(np.zeros((0, 2)), np.zeros((0, 2)), None, np.zeros(0, bool))

    def __len__(self) -> int:
        return len(self.input_px)

    @property
    def placed(self) -> NDArray[np.bool_]:
        """Which points the transform can place at all, shape (n,)."""
        finite = np.isfinite(self.error_px).all(axis=1)
        if self.error_m is not None:
            finite &= np.isfinite(self.error_m).all(axis=1)
        return np.asarray(finite)

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which points the statistics are of, shape (n,)."""
        return self.counted & self.placed

    @property
    def in_pixels(self) -> Statistics:
        """Statistics in input pixels, along columns and rows."""
        return Statistics.of(self.error_px[self.used])

    @property
    def in_metres(self) -> Statistics:
        """Statistics in metres, along x and y of the reference map."""
        return Statistics.of(np.zeros((0, 2)) if self.error_m is None else self.error_m[self.used])

    def of_right_matches(self, max_error_px: float | None = None) -> PointErrors:
        """Return the errors of which only those of right matches count.

        Matches scatter around their place or fall anywhere in their search window; the verdict on
        a registration tells them apart in the same way. `max_error_px` is the root mean square
        error that right matches may well have (None: as `coregister` has it).
        """
        which = self.placed
        errors = self.error_px[which]
        if len(errors) == 0:
            return self
        area = max(_WINDOW_AREA_PX2, float(np.ptp(errors, axis=0).prod()))
        sigmas = sigma_range_px(USUAL_MAX_ERROR_PX if max_error_px is None else max_error_px)
        counted = np.zeros(len(self), bool)
        counted[which] = fit_mixture(errors, area, sigmas).inliers
        return replace(self, counted=counted)

    def summary(self) -> dict[str, Any]:
        """Return the numbers of points and the statistics, by name."""
        return {
            "points": len(self),
            "points_used": int(self.used.sum()),
            **self.in_pixels.summary("px", ("col", "row")),
            **self.in_metres.summary("m", ("x", "y")),
        }


@dataclass(frozen=True)
class Assessment:
    """All that was measured of a registration; no points where there was no evidence.

    Parameters
    ----------
    control_points
        Points of the fit: no measure of accuracy.
    test_points
        Matches that were held out of the fit; only right ones count.
    check_points
        Independent points, which all count.
    two_way, three_way
        How far a way back by other transforms misses the start, over the input (see
        `consistency`).
    """

    control_points: PointErrors = field(default_factory=PointErrors.none)
    test_points: PointErrors = field(default_factory=PointErrors.none)
    check_points: PointErrors = field(default_factory=PointErrors.none)
    two_way: PointErrors = field(default_factory=PointErrors.none)
    three_way: PointErrors = field(default_factory=PointErrors.none)

    def parts(self) -> dict[str, PointErrors]:
        """Return everything by name."""
        return {name: getattr(self, name) for name in Assessment.__dataclass_fields__}

    def summary(self) -> dict[str, Any]:
        """Return all numbers by name."""
        return {name: errors.summary() for name, errors in self.parts().items()}

    @property
    def can_be_judged(self) -> bool:
        """Whether there are points that took no part in the fit."""
        return len(self.check_points) + len(self.test_points) > 0

    def judge(self, max_error_px: float) -> Verdict:
        """Accept or refuse the registration by its check points, without such by test points.

        Inconsistency can refuse a registration, but consistency alone cannot confirm it.

        Parameters
        ----------
        max_error_px
            Largest root mean square error, in input pixels.

        Raises
        ------
        TooFewPointsError
            There are neither check points nor test points.
        """
        if not self.can_be_judged:
            raise TooFewPointsError(
                "no points took no part in the fit: give check points, or tie points with the "
                "role check"
            )
        name = "check" if len(self.check_points) else "test"
        judged = self.check_points if len(self.check_points) else self.test_points
        px, metres = judged.in_pixels, judged.in_metres
        against = self._objections(judged, f"{name} points", max_error_px)
        return Verdict(
            accepted=not against,
            reason=against[0] if against else f"{name} points confirm the registration",
            fit_points=len(self.control_points),
            fit_points_used=int(self.control_points.used.sum()),
            check_points=len(judged),
            check_points_agreeing=int(judged.used.sum()),
            check_rmse_px=px.rmse,
            check_rmse_m=metres.rmse,
            check_ce90_px=px.ce90,
            check_ce90_m=metres.ce90,
            log10_chance=math.nan,
        )

    def _objections(self, judged: PointErrors, name: str, max_error_px: float) -> list[str]:
        """Return what speaks against the registration, the gravest first."""
        count, used, lost = len(judged), int(judged.used.sum()), int((~judged.placed).sum())
        rmse = judged.in_pixels.rmse
        tests = {
            f"the transform cannot place {lost} of {count} {name}": lost > 0,
            f"{count} {name} are too few to measure anything": count < FEWEST_CHECK_POINTS,
            f"only {used} of {count} {name} agree": used
            < max(FEWEST_CHECK_POINTS, SMALLEST_INLIER_SHARE * count),
            f"error at {name} is {rmse:.2f} px, above {max_error_px:g} px": rmse > max_error_px,
        }
        for label, errors in (("two-way", self.two_way), ("three-way", self.three_way)):
            miss = errors.in_pixels.rmse
            what = f"{label} inconsistency is {miss:.2f} px, above {max_error_px:g} px"
            tests[what] = miss > max_error_px
        return [reason for reason, holds in tests.items() if holds]


def read_points(path: Path, transform: Transform) -> StoredTiePoints:
    """Read tie points or a simple CSV table, with reference positions in a transform's CRS.

    A CSV table without a column `reference_crs` has its reference positions in the transform's
    CRS. Its places in the input are given by `input_x`, `input_y` on the input's own map, or by
    `input_col`, `input_row`.

    Parameters
    ----------
    path
        The file.
    transform
        Tells the CRS of the reference map and the input's grid.

    Raises
    ------
    TransformFileError
        The file cannot be read or understood.
    TooFewPointsError
        It holds no points but rejected ones.
    GeoreferencingError
        Only one of the file and the transform has a CRS, or a position lies outside of it.
    """
    simple = _read_simple_table(path, transform) if path.suffix.lower() == ".csv" else None
    points = simple or read_tie_points(path, transform.input_grid)
    if not points.used.any():
        raise TooFewPointsError(f"{path} holds no points that are used")
    if not np.isfinite([*points.reference_xy, *points.input_px]).all():
        raise TransformFileError(f"{path} holds positions that are not finite")
    if (points.crs is None) != (transform.crs is None):
        raise GeoreferencingError(f"only one of {path} and the transform has a CRS")
    xy = reproject(points.reference_xy, points.crs, transform.crs)
    if not np.isfinite(xy).all():
        raise GeoreferencingError(f"{path} holds positions outside of a map's projection")
    return replace(points, reference_xy=xy, crs=transform.crs)


def measure_tie_points(
    path: Path, transform: Transform, max_error_px: float | None = None
) -> tuple[PointErrors, PointErrors]:
    """Measure a transform at its control points and at its test points, in a file of tie points.

    Control points have the role "fit", test points the role "check". Raises as `read_points`.
    """
    points = read_points(path, transform)
    test = _errors(transform, points, points.used & points.is_check)
    control = _errors(transform, points, points.used & ~points.is_check)
    return control, test.of_right_matches(max_error_px)


def measure_check_points(path: Path, transform: Transform) -> PointErrors:
    """Measure a transform at independent points; raises as `read_points`.

    Where some points have the role "check", those without it do not take part.
    """
    points = read_points(path, transform)
    which = points.used & points.is_check
    return _errors(transform, points, which if which.any() else points.used)


def _errors(transform: Transform, points: StoredTiePoints, which: NDArray[np.bool_]) -> PointErrors:
    if not which.any():
        return PointErrors.none()
    return PointErrors.of(transform, points.reference_xy[which], points.input_px[which])


def _read_simple_table(path: Path, transform: Transform) -> StoredTiePoints | None:
    """Read a CSV table that names no CRS; None: it does, or lacks the input's columns."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            table = csv.DictReader(file)
            names = set(table.fieldnames or ())
            rows = list(table)
        on_own_map = {"input_x", "input_y"} <= names
        if "reference_crs" in names or not (on_own_map or {"input_col", "input_row"} <= names):
            return None

        def columns(x: str, y: str) -> FloatArray:
            return np.array([[float(row[x]), float(row[y])] for row in rows]).reshape(-1, 2)

        if on_own_map:
            input_px = transform.input_grid.map_to_pixel(columns("input_x", "input_y"))
        else:
            input_px = columns("input_col", "input_row")
        return StoredTiePoints(
            columns("reference_x", "reference_y"),
            input_px,
            np.array([row.get("role") == "check" for row in rows], bool),
            np.array([row.get("state", USED) == USED for row in rows], bool),
            transform.crs,
        )
    except (OSError, ValueError, TypeError, KeyError, csv.Error) as error:
        reason = f"column {error} is missing" if isinstance(error, KeyError) else error
        raise TransformFileError(f"cannot read the points {path}: {reason}") from error


def _metres_per_unit(transform: Transform, xy: FloatArray) -> FloatArray:
    """Return how long the reference map's units are at the middle of some positions, (2,)."""
    finite = xy[np.isfinite(xy).all(axis=1)]
    centre = finite.mean(axis=0) if len(finite) else np.zeros(2)
    return np.array(Grid(Affine.translation(*(centre - 0.5)), transform.crs, 1, 1).metres_per_unit)
