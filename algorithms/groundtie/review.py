"""Tie points edited by hand: switched off, moved, added, and fitted again at once.

Points that a person moved or added are marked as edited in files and results. Check points stay
check points: no fit uses them, however they are edited.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike, NDArray

from .errors import NothingFoundError, TooFewPointsError
from .geometry.model_choice import left_out_blocks
from .geometry.models import KINDS, fewest_points
from .geometry.tie_point_files import read_tie_points, write_tie_points
from .geometry.tie_points import EDITED, USED, TiePoints
from .geometry.transform import Transform
from .progress import SILENT
from .rasters.atomic import Outputs
from .rasters.grid import FloatArray, Grid, compose
from .rasters.pair import Image
from .rasters.reading import open_raster
from .registration.sensor_input import Ground, open_oriented_image
from .registration.tie_point_evidence import TiePointEvidence
from .registration.verdict import decide
from .sensor.control_formats import HEIGHT
from .sensor.orientation import sensor_grid
from .similarity.description import BORDER_PX
from .similarity.peak import Peak, find_peak
from .steps import similarity_surface

SWITCHED_OFF = "rejected: by a person"

# The cost of a spline grows with the cube of its points: with more, none is offered
# (tests/test_review.py holds all other models of 2000 points to the time of a refit).
MOST_SPLINE_POINTS = 300

# Side of the chip that is compared around a click, and how far the click may be off, in pixels of
# the coarser image: a click is no better than a few pixels of the screen.
_CHIP_PX, _CLICK_PX = 48, 8


@dataclass(frozen=True)
class ModelFit:
    """A model fitted to the points that take part.

    Parameters
    ----------
    kind
        One of `geometry.models.KINDS`.
    transform
        The fitted transform.
    residuals_px
        Residuals of all points, shape (n,), in input pixels.
    left_out_px
        Root mean square error of points by models fitted without their block; None: too few.
    """

    kind: str
    transform: Transform
    residuals_px: FloatArray
    left_out_px: float | None


@dataclass(frozen=True)
class Review:
    """Tie points of an input raster in their present state; every change makes a new review.

    Parameters
    ----------
    points
        The points, with the column `edited` of 1 where a person moved or added one.
    input_grid
        The input's own grid.
    """

    points: TiePoints
    input_grid: Grid

    @classmethod
    def open(cls, path: str | Path, input: Any) -> Review:
        """Read tie points of an input raster.

        Raises
        ------
        TransformFileError
            The file cannot be read or understood.
        """
        with open_raster(input) as source:
            return cls(read_tie_points(path, source.grid), source.grid)

    @property
    def _columns(self) -> dict[str, FloatArray]:
        """The points' further columns, with a new one that marks edited points."""
        return {**self.points.more, EDITED: self.points.edited.astype(float)}

    @property
    def nominal(self) -> Transform:
        """The transform by the input's own georeferencing."""
        return Transform.nominal(self.points.crs, self.input_grid)

    @cached_property
    def nominal_xy(self) -> FloatArray:
        """Nominal positions on the reference map, shape (n, 2)."""
        return self.points.nominal_xy(self.nominal)

    def input_px(self, nominal_xy: ArrayLike) -> FloatArray:
        """Return the input pixel (col, row) at a nominal position on the reference map."""
        return self.nominal(np.asarray(nominal_xy, float).reshape(1, 2)).ravel()

    def switch(self, which: Sequence[int], on: bool) -> Review:
        """Return the review with points taking part, or not."""
        state = self.points.state.astype(object)
        state[list(which)] = USED if on else SWITCHED_OFF
        return replace(self, points=replace(self.points, state=state.astype(str)))

    def move(
        self, index: int, reference_xy: ArrayLike | None = None, input_px: ArrayLike | None = None
    ) -> Review:
        """Return the review with a point moved in the reference, in the input, or in both."""
        columns = {"reference_xy": reference_xy, "input_px": input_px}
        moved = {name: getattr(self.points, name).copy() for name in columns}
        for name, place in columns.items():
            if place is not None:
                moved[name][index] = place
        more = self._columns
        more[EDITED][index] = 1.0
        if HEIGHT in more and reference_xy is not None:  # the ground there has another height
            more[HEIGHT] = more[HEIGHT].copy()
            more[HEIGHT][index] = np.nan
        return replace(self, points=replace(self.points, **moved, more=more))

    def add(self, reference_xy: ArrayLike, input_px: ArrayLike, score: float = np.nan) -> Review:
        """Return the review with one more point, the last."""
        xy, px = (np.asarray(place, float).reshape(1, 2) for place in (reference_xy, input_px))
        point = TiePoints.unmeasured(xy, px, self.points.crs)
        more = {name: np.full(1, np.nan) for name in self.points.more} | {EDITED: np.ones(1)}
        point = replace(point, score=np.array([score]), more=more)
        mine = replace(self.points, more=self._columns)
        return replace(self, points=TiePoints.concatenate([mine, point]))

    def fit(self, kind: str) -> ModelFit:
        """Fit a model to the points that take part, as `warp` does.

        Raises
        ------
        TooFewPointsError
            There are fewer points than the model needs.
        """
        evidence = TiePointEvidence.of(self.points, kind, self.input_grid)
        residuals_px = evidence.residuals_px(evidence.transform)
        return ModelFit(kind, evidence.transform, residuals_px, self._left_out_px(kind))

    def objection(self, kind: str) -> str:
        """Return why `warp` refuses a model of these points; empty if it does not.

        Raises
        ------
        TooFewPointsError
            There are fewer points than the model needs.
        """
        return decide(TiePointEvidence.of(self.points, kind, self.input_grid)).reason

    def fits(self, kinds: Sequence[str] = KINDS) -> dict[str, ModelFit]:
        """Return the models that can be fitted at once, by their kinds."""
        found = {}
        for kind in kinds:
            if kind == "tps" and self.points.fit.sum() > MOST_SPLINE_POINTS:
                continue
            try:
                fit = self.fit(kind)
            except TooFewPointsError:
                continue
            if np.isfinite(fit.residuals_px).any():  # not of points at one place
                found[kind] = fit
        return found

    def worst(self, residuals_px: FloatArray) -> NDArray[np.int_]:
        """Return the indices of used points by decreasing residual."""
        used = np.flatnonzero(self.points.used)
        return used[np.argsort(-residuals_px[used], kind="stable")]

    def write(self, path: Path, transform: Transform) -> None:
        """Write the points, for `warp` or for a later review."""
        points = replace(self.points, more=self._columns)
        with Outputs() as outputs:
            write_tie_points(outputs.stage(path), points, transform)

    def _left_out_px(self, kind: str) -> float | None:
        """Return the error at points left out of the fit, block by block of neighbours."""
        taken = np.flatnonzero(self.points.fit)
        errors = np.full(len(taken), np.nan)
        for block in left_out_blocks(self.points.reference_xy[taken]):
            if (~block).sum() < max(fewest_points(kind), 3):
                return None
            seen = TiePointEvidence(self.points.take(taken[~block]), kind, self.input_grid)
            left = self.points.take(taken[block])
            errors[block] = np.hypot(*left.residual_px(seen.transform).T)
        return float(np.sqrt(np.mean(errors**2))) if np.isfinite(errors).all() else None


def without_points(reference: Any, input: Any) -> Review:
    """Return the review of two images between which there are no points yet."""
    with open_raster(reference) as one, open_raster(input) as other:
        return Review(replace(TiePoints.none(), crs=one.grid.crs), other.grid)


def of_sensor_image(
    reference: Any, image: Any, rpc: Path, dem: Path | None, datum: str | None, path: Path | None
) -> Review:
    """Return the review of an image with RPCs, located by RPCs in a file and a terrain model.

    Parameters
    ----------
    reference
        The reference, which gives the map.
    image, rpc, dem, datum
        The image, its RPCs, a terrain model and its vertical datum.
    path
        Ground control; None: there is none yet.

    Raises
    ------
    GroundTieError
        Image, heights or points cannot be used.
    """
    with ExitStack() as stack:
        crs = stack.enter_context(open_raster(reference)).grid.crs
        ground = Ground(dem, datum)
        oriented = open_oriented_image(image, rpc, ground, crs, stack, SILENT)
        grid = sensor_grid(oriented.source, oriented.orientation)
        if path is None:
            return Review(replace(TiePoints.none(), crs=crs), grid)
        return Review(read_tie_points(path, grid, (HEIGHT,)), grid)


def refine_click(
    reference: Any, input: Any, reference_xy: ArrayLike, input_px: ArrayLike, transform: Transform
) -> tuple[FloatArray, Peak]:
    """Return the input position at which a clicked pair's surroundings match best, and the peak.

    Parameters
    ----------
    reference, input
        The images, as `rasters.reading.open_raster` takes them.
    reference_xy, input_px
        The clicked pair: position on the reference map, pixel (col, row) of the input.
    transform
        Relation of the images around the pair: rotation and scale are taken from it.

    Raises
    ------
    NothingFoundError
        There is no peak within the distance that a click may be off.
    """
    xy, px = np.asarray(reference_xy, float), np.asarray(input_px, float)
    offset = px - transform(xy)
    with open_raster(reference) as one, open_raster(input, allow_sensor_geometry=True) as other:
        factor = max(1.0, transform.input_grid.pixel_size_m / one.grid.pixel_size_m)
        grid = one.grid if factor < 1.01 else one.grid.scaled(factor)
        side = _CHIP_PX + 2 * (_CLICK_PX + BORDER_PX) + 1
        here = grid.map_to_pixel(xy).ravel()
        # A grid of the reference's pixels, centred on the clicked position.
        corner = Affine.translation(*(here + 0.5 - side / 2))
        around = grid.on_same_map(compose(grid.transform, corner), side, side)
        middle = (side - 1) / 2
        windows = [
            Image(source, None).read_onto(around, to_px)
            for source, to_px in (
                (one, one.grid.map_to_pixel),
                (other, lambda places: transform(places) + offset),
            )
        ]
    masked = [np.ma.masked_array(window.values, ~window.valid) for window in windows]
    peak = find_peak(similarity_surface(masked[0], masked[1], _CLICK_PX))
    if peak.at_border or not np.isfinite(peak.height):
        raise NothingFoundError("the surroundings of the two clicks do not match: click again")
    found = around.pixel_to_map(np.array([middle, middle]) + peak.shift_px)
    return (transform(found) + offset).ravel(), peak
