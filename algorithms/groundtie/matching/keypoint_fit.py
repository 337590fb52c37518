"""Fits that start from keypoints near their positions predicted by a coarse model.

Mutual information on reduced images has found the coarse model. Keypoints are matched without a
limit on the ratio, but only near their predicted positions ([Suri2010] 6.9). Most matches are
outliers anywhere in the gate; a robust fit finds the inliers, which chips may refine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..errors import TooFewPointsError
from ..features.matching import GATE_PX
from ..geometry.estimation import Estimate, jackknife_spread
from ..geometry.fitting import fit_model
from ..geometry.models import PARAMETERS, Model
from ..geometry.robust import fit_mixture
from ..geometry.tie_points import USED, TiePoints
from ..kinds import AUTO
from ..rasters.grid import FloatArray, Grid, apply_affine
from .chips import ChipMatcher
from .feature_fit import ConsensusFit, first_kind, fit_matches, require_no_rival
from .frames import on_grid
from .keypoints import KeypointMatcher
from .matcher import Correspondences, Places
from .surface_fit import SurfaceFit

# Chips around matches: their side, and their search radius in standard deviations of the first
# model's predictions, within these limits.
_CHIP_PX = 81
_CHIP_SIGMAS, _CHIP_RADIUS_PX = 3.0, (4, 12)

# Chips are matched again from the updated model until it hardly changes, at most this many times in
# all.
_ROUNDS = 3

# Number of cells along the longer side; the best match of each cell is refined.
_CHIP_CELLS = 14

# Forests and cities have more keypoints than fields, and relief displacement. To keep them from
# outvoting the ground, the number of matches per cell is limited.
_CELL_PX, _PER_CELL = 64.0, 6

_CHIPS_ALONE = "too few keypoints match: the model is that of chips alone"

# Correct matches lie within this distance of the polynomial that a thin-plate spline refines.
_TPS_RADIUS_PX = 5.0


@dataclass(frozen=True)
class KeypointFit:
    """Fits a model to keypoints, refined by chips.

    Parameters
    ----------
    matcher
        Matches keypoints, without the held-out blocks of the reference.
    chips
        Fits a model to chips alone where too few keypoints match; its matcher has the masks.
    refinement
        Matches chips around the keypoints, and others between them.
    """

    matcher: KeypointMatcher
    chips: SurfaceFit
    refinement: ChipMatcher

    def estimate(self, coarse: Model, kind: str, context: Context) -> Estimate:
        """Match keypoints near a coarse model, and fit a model to the matches.

        Parameters
        ----------
        coarse
            The misregistration on the map, a model of degree 1; its error may be up to the gate.
        kind
            One of `models.KINDS`, or "auto" for the simplest linear model that the matches justify.
        context
            Threads, progress and seed.

        Raises
        ------
        TooFewPointsError
            Too few matches agree on a model.
        NothingFoundError
            Many matches agree on a second model.
        """
        # A spline is fitted last, to the matches that agree with a polynomial.
        first = AUTO if kind == "tps" else kind
        try:
            matches, fit = agreeing_keypoints(self.matcher, coarse, first, context.part(0.0, 0.7))
        except TooFewPointsError:
            # With chips, "auto" could choose a more flexible model than keypoints may have.
            chips_kind = "affine" if kind == AUTO else kind
            found = self.chips.estimate(coarse, chips_kind, context.part(0.7, 1.0))
            return replace(found, notes=(_CHIPS_ALONE,))
        try:
            refined = self._refined(first, matches, coarse, fit, context.part(0.7, 1.0))
        except TooFewPointsError:
            # Keypoints may agree on a wrong model where few match. If chips around it do not
            # agree, the coarse model may still be right.
            known = apply_affine(on_grid(coarse, self._grid), matches.px)
            model = fit_model("affine", matches.px, known)
            # No fold models: the uncertainty of the coarse model is unknown.
            start = ConsensusFit(model, (), fit.mixture)
            refined = self._refined(first, matches, coarse, start, context.part(0.7, 1.0))
        return self._estimate(kind, *refined)

    @property
    def _grid(self) -> Grid:
        return self.matcher.pair.grid

    def _refined(
        self,
        kind: str,
        matches: Correspondences,
        coarse: Model,
        fit: ConsensusFit,
        context: Context,
    ) -> tuple[Correspondences, Model, ConsensusFit]:
        """Return matches of chips around keypoints, the model used for resampling, and the fit.

        Matches with larger errors may have biased the first model, `fit`. If the chips move it
        much, they are matched again from their own model.
        """
        chips = self.refinement
        nominal_px = apply_affine(on_grid(coarse, self._grid), matches.partner_px)
        for _ in range(_ROUNDS):
            first = fit.model
            residuals = nominal_px - first(matches.px)
            inliers = fit_mixture(residuals, matches.window_area_px2).inliers
            if 2 * inliers.sum() <= PARAMETERS["affine"]:
                raise TooFewPointsError(f"only {inliers.sum()} of {len(inliers)} features agree")
            px, score = matches.px[inliers], matches.score[inliers]
            coarse = fit_model("affine", px, first(px)).on_map(self._grid.centre_transform)
            side = float(np.ptp(matches.px, axis=0).max()) / _CHIP_CELLS
            picked = px[best_of_cells(px, score, side, 1)]
            between = far_from(picked, self.chips.layout.fit_centres, side)
            picked = np.concatenate([picked, between])
            reach = _CHIP_SIGMAS * jackknife_spread(fit.fold_models, picked)
            reach = np.clip(np.ceil(reach), *_CHIP_RADIUS_PX)
            radius = int(np.quantile(reach, 0.9))
            centres = np.unique(np.rint(picked).astype(int), axis=0)
            places = Places(self._grid, centres, _CHIP_PX)
            found = chips.match(coarse, places, radius, context).correspondences()
            fit = fit_matches(kind, found, on_grid(coarse, self._grid), context.seed)
            if chips.is_settled(fit.model(picked) - first(picked)):
                break
        return found, coarse, fit

    def _estimate(
        self, kind: str, matches: Correspondences, coarse: Model, fit: ConsensusFit
    ) -> Estimate:
        pair, grid = self.matcher.pair, self._grid
        count, sigma = len(matches.px), fit.mixture.sigma
        points = TiePoints(
            reference_xy=grid.pixel_to_map(matches.px),
            input_px=pair.transform(coarse)(grid.pixel_to_map(matches.partner_px)),
            score=matches.score,
            covariance_px2=np.broadcast_to(np.eye(2) * sigma**2, (count, 2, 2)).copy(),
            # Peaks are those of both directions together.
            forward_backward_error_px=np.zeros(count),
            is_check=np.zeros(count, bool),
            state=np.full(count, USED),
        )
        points = points.reject(~fit.mixture.inliers, "disagrees with the model")
        return Estimate.of(kind, fit, points, pair, _TPS_RADIUS_PX)


@dataclass(frozen=True)
class GuidedFit:
    """Fits a model to chips all over a pair, starting from the model that keypoints agree on.

    Keypoints locate images of different bands or illumination even if the coarse model is many
    pixels off. They lie where edges are strongest: on roofs, walls and tree crowns, which may be
    displaced against the ground. Chips on a regular layout weight everything by its area. Source:
    [Patel2017] 4, [Suri2010] 6.9.

    Parameters
    ----------
    matcher
        Matches keypoints.
    chips
        Fits the model; its matcher sees no more than `matcher`.
    """

    matcher: KeypointMatcher
    chips: SurfaceFit

    def estimate(self, coarse: Model, kind: str, context: Context) -> Estimate:
        """Match keypoints near a coarse model, and fit a model to chips near the keypoints' model.

        Parameters and errors as in `KeypointFit.estimate`; "auto" chooses from the candidates of
        `chips`.
        """
        # A simple model of the keypoints, for which few matches are enough, predicts the chips.
        first, part = first_kind(kind), context.part(0.0, 0.6)
        _, fit = agreeing_keypoints(self.matcher, coarse, first, part)
        model = fit.model.on_map(self.matcher.pair.grid.centre_transform)
        return self.chips.estimate(model, kind, context.part(0.6, 1.0))


def agreeing_keypoints(
    matcher: KeypointMatcher, coarse: Model, kind: str, context: Context
) -> tuple[Correspondences, ConsensusFit]:
    """Return keypoint matches, limited in number per cell, and the model that most agree on.

    Parameters and errors as in `KeypointFit.estimate`.
    """
    everywhere = matcher.match(coarse, GATE_PX, context)
    found = everywhere.take(best_of_cells(everywhere.px, everywhere.score, _CELL_PX, _PER_CELL))
    prior = on_grid(coarse, matcher.pair.grid)
    fit = fit_matches(kind, found, prior, context.seed)
    require_no_rival(found, prior, fit.model)
    return found, fit


def far_from(px: FloatArray, others: NDArray[np.int_], reach_px: float) -> FloatArray:
    """Return the positions of `others`, shape (m, 2), farther than `reach_px` from all of `px`."""
    from scipy.spatial import cKDTree  # takes 0.1 s to import; all tools import this module

    distance, _ = cKDTree(px).query(others)
    return others[distance > reach_px].astype(float)


def best_of_cells(
    px: FloatArray, score: FloatArray, cell_px: float, count: int
) -> NDArray[np.int_]:
    """Return the indices of the best points of each square cell.

    Parameters
    ----------
    px
        Positions, shape (n, 2).
    score
        Quality of the points, larger is better, shape (n,).
    cell_px
        Side of the cells.
    count
        Most points taken per cell.
    """
    cells = np.floor(px / max(cell_px, 1e-9)).astype(int)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.ravel()
    order = np.lexsort((-score, cell))
    _, first = np.unique(cell[order], return_index=True)
    rank = np.arange(len(order)) - np.repeat(first, np.diff([*first, len(order)]))
    return np.sort(order[rank < count])
