"""The model on which the similarity surfaces of all chips agree, and the tie points near it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from ..context import Context
from ..errors import TooFewPointsError
from ..geometry.estimation import Estimate, Fitted
from ..geometry.judging import TOLERANCE_PX
from ..geometry.models import DEGREE, PARAMETERS, TERRAIN, Model
from ..geometry.robust import fit_mixture
from ..geometry.terrain import Terrain
from ..geometry.terrain_model import TerrainModel
from ..geometry.tie_points import USED, TiePoints
from ..geometry.transform import Transform
from ..kinds import AUTO
from ..rasters.grid import FloatArray, Grid
from ..rasters.pair import ImagePair
from ..similarity.peak import Peak, find_peak, find_peak_near
from .alignment import MODEL_CANDIDATES, Prior, align
from .belief_propagation import Surfaces
from .chips import ChipMatcher
from .frames import on_grid
from .layout import ChipLayout
from .matcher import ChipSurfaces
from .pooled import PooledHistogramMatcher

# A tie point of the fit is the peak within this distance from the aligned model.
_NEAR_PX = 3

# Largest shift of a chip of the fit from its position predicted by a coarse model.
FIT_RADIUS_PX = 8

# The matchers that return surfaces of chips.
SurfaceMatcher: TypeAlias = ChipMatcher | PooledHistogramMatcher


@dataclass(frozen=True)
class SurfaceFit:
    """Fits a model to the surfaces of chips.

    Parameters
    ----------
    matcher
        Matches the chips, without the held-out blocks.
    layout
        Layout of chips in the matching grid.
    candidates
        Kinds of model from which "auto" chooses, from simple to flexible.
    terrain
        Heights on the map, for the terrain model, which is then a candidate.
    """

    matcher: SurfaceMatcher
    layout: ChipLayout
    candidates: tuple[str, ...] = MODEL_CANDIDATES
    terrain: Terrain | None = None

    def estimate(self, coarse: Model, kind: str, context: Context) -> Estimate:
        """Match the chips of the fit and fit a model to their surfaces.

        Parameters
        ----------
        coarse
            The misregistration on the map, a model of degree 1; its error may be up to
            `FIT_RADIUS_PX`.
        kind
            One of `models.KINDS`, or "auto" for the simplest polynomial that the chips justify.
        context
            Threads, progress and seed.

        Raises
        ------
        TooFewPointsError
            Too few chips could be matched for the model.
        """
        pair = self.matcher.pair
        surfaces, aligned, expected = self._align(coarse, kind, context)
        is_flexible = DEGREE.get(aligned.model.kind, 1) > 1
        if not is_flexible and not self.matcher.is_settled(expected):
            coarse = aligned.model.on_map(pair.grid.centre_transform)
            if aligned.model.kind == TERRAIN:
                # The input is resampled without relief displacement now, so that its chips no
                # longer justify a terrain model.
                kind = TERRAIN
            surfaces, aligned, expected = self._align(coarse, kind, context)
        surfaces = self.matcher.for_points(surfaces)
        points = fit_points(pair, surfaces, coarse, expected)
        found = Estimate.of(kind, aligned, points, pair, _NEAR_PX)
        inliers = _without_outliers(points, found.transform, pair)
        if 2 * inliers.used.sum() < PARAMETERS[found.transform.model.kind]:
            raise TooFewPointsError(
                f"only {inliers.used.sum()} of {len(points)} points agree with a model"
            )
        return replace(found, points=inliers)

    def _align(
        self, coarse: Model, kind: str, context: Context
    ) -> tuple[ChipSurfaces, Fitted, FloatArray]:
        """Match the chips of the fit around a model, and align a better one with their surfaces.

        Returns the surfaces, the aligned model and the chips' shifts expected from it, (n, 2).
        """
        matcher = self.matcher
        places = matcher.fit_places(self.layout)
        surfaces = matcher.match(coarse, places, FIT_RADIUS_PX, context)
        centres, weighted = surfaces.centres, surfaces.weighted
        if len(centres) < 4:
            raise TooFewPointsError(f"only {len(centres)} chips could be matched")
        grid, px = matcher.pair.grid, centres.astype(float)
        prior = _prior_of(coarse, grid)
        terrain = None if self.terrain is None else self.terrain.seen_from(grid.centre_transform)
        residual = matcher.first_model(surfaces, self.layout, kind, context.seed)

        def start(px: FloatArray) -> FloatArray:
            return prior.to_nominal(residual(px))

        kind = matcher.kind_of(kind)
        kinds = self.candidates if kind in (AUTO, "tps") else (kind,)
        aligned = align(kinds, centres, weighted, prior, start, terrain)
        moved = aligned.model(px) - prior.to_nominal(px)
        return surfaces, aligned, moved @ prior.to_shift.T


def _prior_of(model: Model, grid: Grid) -> Prior:
    """Return the prior of an input resampled by a model of map positions."""
    if not isinstance(model, TerrainModel):
        return Prior.of_affine(on_grid(model, grid))

    def to_nominal(px: FloatArray) -> FloatArray:
        return grid.map_to_pixel(model(grid.pixel_to_map(px)))

    return replace(Prior.of_affine(on_grid(model.affine, grid)), to_nominal=to_nominal)


def fit_points(
    pair: ImagePair, surfaces: ChipSurfaces, model: Model, expected_px: FloatArray
) -> TiePoints:
    """Return the surfaces' peaks near expected shifts, shape (n, 2), as tie points of a fit."""

    def peaks(of: Surfaces) -> list[Peak]:
        pairs = zip(of, expected_px, strict=True)
        return [find_peak_near(surface, shift, _NEAR_PX) for surface, shift in pairs]

    points = _tie_points(pair, surfaces, model, peaks, is_check=False)
    points = points.take(points.located)
    limit = f"forward–backward error above {TOLERANCE_PX:g} px"
    return points.reject(points.forward_backward_error_px > TOLERANCE_PX, limit)


def check_points(pair: ImagePair, surfaces: ChipSurfaces, model: Model) -> TiePoints:
    """Return the highest peaks of the surfaces, wherever they lie, as check points."""

    def peaks(of: Surfaces) -> list[Peak]:
        return [find_peak(surface) for surface in of]

    return _tie_points(pair, surfaces, model, peaks, is_check=True)


def _tie_points(
    pair: ImagePair,
    surfaces: ChipSurfaces,
    model: Model,
    peaks: Callable[[Surfaces], list[Peak]],
    is_check: bool,
) -> TiePoints:
    def shifts(of: list[Peak]) -> FloatArray:
        return np.array([peak.shift_px for peak in of]).reshape(-1, 2)

    grid = pair.grid
    found = peaks(surfaces.combined)
    centres = surfaces.centres.astype(float)
    there_and_back = shifts(peaks(surfaces.forward)) - shifts(peaks(surfaces.backward))
    points = TiePoints(
        reference_xy=grid.pixel_to_map(centres),
        input_px=pair.transform(model)(grid.pixel_to_map(centres + shifts(found))),
        score=np.array([peak.height for peak in found]),
        covariance_px2=np.array([p.covariance_px2 for p in found]).reshape(-1, 2, 2),
        forward_backward_error_px=np.hypot(*there_and_back.T),
        is_check=np.full(len(found), is_check),
        state=np.full(len(found), USED),
    )
    return points.reject(np.array([peak.at_border for peak in found], bool), "no peak")


def _without_outliers(points: TiePoints, transform: Transform, pair: ImagePair) -> TiePoints:
    """Reject the points of the fit that are more likely random outliers than inliers."""
    used = points.used
    residuals = points.take(used).residual_on(pair.grid, transform)
    mixture = fit_mixture(residuals, (2 * _NEAR_PX + 1) ** 2)
    outliers = np.zeros(len(points), bool)
    outliers[used] = ~mixture.inliers
    return points.reject(outliers, "disagrees with the model")
