"""Errors of a transform at points: those of its fit, and those held out of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..geometry.chance import log10_least_false_alarms
from ..geometry.judging import TOLERANCE_PX, USUAL_MAX_ERROR_PX, sigma_range_px
from ..geometry.robust import fit_mixture
from ..geometry.rows import Rows
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..matching.check import CHECK_RADIUS_PX
from ..rasters.grid import FloatArray, Grid, metres_per_unit_at, near_longitude
from ..rasters.reading import Mask
from .statistics import Statistics

# Side of the windows in which held-out points are searched for, in matching pixels.
WINDOW_PX = 2.0 * CHECK_RADIUS_PX + 1


@dataclass(frozen=True)
class PointErrors(Rows):
    """Errors of a transform at points, one row a point.

    Parameters
    ----------
    position_px
        The points (col, row) in the image or grid whose pixels the errors are in, shape (n, 2).
    error_px
        Measured minus transformed positions of the points, shape (n, 2).
    is_check
        Which points were held out of the fit, shape (n,).
    counted
        False for rejected points and outliers, which the statistics leave out, shape (n,).
    error_m
        Registered minus reference positions of the points, metres along the axes of the reference
        map, shape (n, 2); None without metres.
    window_px
        Side of the windows in which the points were searched for.
    tolerance_px
        Largest error of points that agree.
    """

    position_px: FloatArray
    error_px: FloatArray
    is_check: Mask
    counted: Mask
    error_m: FloatArray | None = None
    window_px: float = WINDOW_PX
    tolerance_px: float = TOLERANCE_PX

    @classmethod
    def of(cls, transform: Transform, reference_xy: ArrayLike, input_px: ArrayLike) -> PointErrors:
        """Measure a transform at points held out of its fit, in pixels of the input.

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
            moved = near_longitude(transform.inverse(px) - xy, 0.0, transform.crs)
            error_m = moved * metres_per_unit_at(xy, transform.crs)
        every = np.ones(len(px), bool)
        return cls(px, px - transform(xy), every, every, error_m)

    @classmethod
    def on_grid(cls, points: TiePoints, transform: Transform, grid: Grid) -> PointErrors:
        """Measure a transform at tie points, in pixels of the matching grid."""
        errors = points.residual_on(grid, transform)
        return cls(grid.map_to_pixel(points.reference_xy), errors, points.is_check, points.used)

    @classmethod
    def none(cls) -> PointErrors:
        """Return the errors at no points."""
        return cls(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, bool), np.zeros(0, bool))

    def matched_in(self, pixel_px: float) -> PointErrors:
        """Return the errors with windows and tolerance of matching pixels of another size."""
        return replace(self, window_px=WINDOW_PX * pixel_px, tolerance_px=TOLERANCE_PX * pixel_px)

    @property
    def placed(self) -> Mask:
        """Which points the transform can place at all, shape (n,)."""
        finite = np.isfinite(self.error_px).all(axis=1)
        if self.error_m is not None:
            finite &= np.isfinite(self.error_m).all(axis=1)
        return np.asarray(finite)

    @property
    def used(self) -> Mask:
        """Which points the statistics use, shape (n,)."""
        return self.counted & self.placed

    @property
    def length_px(self) -> FloatArray:
        """Lengths of the errors, shape (n,)."""
        return np.asarray(np.hypot(*self.error_px.T))

    @property
    def fit(self) -> Mask:
        """Which points the fit used, shape (n,)."""
        return self.used & ~self.is_check

    @property
    def check(self) -> Mask:
        """Which held-out points were measured, shape (n,)."""
        return self.used & self.is_check

    @property
    def agreeing(self) -> Mask:
        """Which held-out points agree with the transform, shape (n,)."""
        return self.check & (self.length_px <= self.tolerance_px)

    @property
    def in_pixels(self) -> Statistics:
        """Statistics in pixels, along columns and rows."""
        return Statistics.of(self.error_px[self.used])

    @property
    def in_metres(self) -> Statistics:
        """Statistics in metres, along x and y of the reference map."""
        return Statistics.of(np.zeros((0, 2)) if self.error_m is None else self.error_m[self.used])

    @property
    def log10_chance(self) -> float:
        """log10 of the probability that random matches would agree as well; 0 without points.

        It is that of the least likely radius ([Moisan2004]).
        """
        if not self.placed.any():
            return 0.0
        return min(log10_least_false_alarms(self.length_px, self._window_area_px2, 0), 0.0)

    @property
    def _window_area_px2(self) -> float:
        """Area of uniform outliers: that of the windows, or of the errors' extent if larger."""
        return max(self.window_px**2, float(np.ptp(self.error_px[self.placed], axis=0).prod()))

    def of_inliers(self, max_error_px: float | None = None) -> PointErrors:
        """Return the errors with only inliers counted.

        Inliers scatter around zero; outliers are uniform over their search window. The verdict on a
        registration separates them in the same way. `max_error_px` is the root mean square error
        that inliers may have (None: the default of `coregister`).
        """
        which = self.placed
        errors = self.error_px[which]
        if len(errors) == 0:
            return self
        # The verdict's limits are in matching pixels, of which windows have a number.
        pixel = self.window_px / WINDOW_PX
        limit = USUAL_MAX_ERROR_PX if max_error_px is None else max_error_px / pixel
        area = self._window_area_px2 / pixel**2
        mixture = fit_mixture(errors / pixel, area, sigma_range_px(limit))
        counted = np.zeros(len(self), bool)
        counted[which] = mixture.inliers
        return replace(self, counted=counted)

    def summary(self) -> dict[str, Any]:
        """Return the numbers of points and the statistics, by name."""
        return {
            "points": len(self),
            "points_used": int(self.used.sum()),
            **self.in_pixels.summary("px", ("col", "row")),
            **self.in_metres.summary("m", ("x", "y")),
        }
