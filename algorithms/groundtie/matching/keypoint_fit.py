"""Fits that start from keypoints near where a coarse model puts them ([Suri2010] 6.9).

Mutual information on reduced images has found the coarse model; keypoints are matched without a
limit on the ratio, but only near their prediction. Most of these matches are outliers, which
fall anywhere in the gate; a robust fit finds the inliers. Chips may refine their places.
"""

from __future__ import annotations

from dataclasses import dataclass

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

# Chips around matches: how large, and how far they are moved: by so many standard deviations of the
# first model's predictions, within these limits.
_CHIP_PX = 81
_CHIP_SIGMAS, _CHIP_RADIUS_PX = 3.0, (4, 12)

# They are matched again from where the model is then until they move it little: at most so often in
# all.
_ROUNDS = 3

# Of the matches in each of so many cells a side the best is refined.
_CHIP_CELLS = 14

# Forests and cities have more keypoints than fields, with relief displacement. So that they do
# not outvote the ground, no cell has more than so many matches.
_CELL_PX, _PER_CELL = 64.0, 6

# Right matches lie this near a polynomial where a thin-plate spline is to bend further.
_TPS_RADIUS_PX = 5.0


@dataclass(frozen=True)
class KeypointFit:
    """Fits a model to keypoints, refined by chips.

    Parameters
    ----------
    matcher
        Matches keypoints, of which the reference's see nothing of what is held out.
    chips
        Fits a model to chips alone where too few keypoints match; its matcher has the masks.
    refinement
        What chips around the keypoints, and others between them, are matched by.
    """

    matcher: KeypointMatcher
    chips: SurfaceFit
    refinement: ChipMatcher

    def estimate(self, coarse: Model, kind: str, context: Context) -> Estimate:
        """Match keypoints near a coarse model, and fit a model to the matches.

        Parameters
        ----------
        coarse
            The misregistration on the map, a model of degree 1; it may be wrong by the gate.
        kind
            One of `models.KINDS`, or "auto" for the simplest polynomial that the matches justify.
        context
            Threads, progress and seed.

        Raises
        ------
        TooFewPointsError
            Too few matches agree on a model.
        NothingFoundError
            Many of them agree on two.
        """
        # A spline is fitted last, to what agrees with a polynomial.
        first = AUTO if kind == "tps" else kind
        try:
            matches, fit = agreeing_keypoints(self.matcher, coarse, first, context.part(0.0, 0.7))
        except TooFewPointsError:
            # What "auto" chooses among chips may bend more than matches of keypoints may.
            chips_kind = "affine" if kind == AUTO else kind
            return self.chips.estimate(coarse, chips_kind, context.part(0.7, 1.0))
        try:
            refined = self._refined(first, matches, coarse, fit, context.part(0.7, 1.0))
        except TooFewPointsError:
            # Keypoints may agree on a wrong model where few match. If chips around it do not
            # agree, the coarse model may still be right.
            known = apply_affine(on_grid(coarse, self._grid), matches.px)
            model = fit_model("affine", matches.px, known)
            # Without models of its folds: how far it may be wrong is unknown.
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
        """Return chips around keypoints, the model that they were resampled by, and their fit.

        Matches with larger errors may have led the first model, `fit`, astray: if chips show it,
        they are matched again from their own.
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
            # Peaks are those of both ways together.
            forward_backward_error_px=np.zeros(count),
            is_check=np.zeros(count, bool),
            state=np.full(count, USED),
        )
        points = points.reject(~fit.mixture.inliers, "disagrees with the model")
        return Estimate.of(kind, fit, points, pair, _TPS_RADIUS_PX)


@dataclass(frozen=True)
class GuidedFit:
    """Fits a model to chips all over a pair, around the one that keypoints agree on.

    Keypoints locate an image whose bands or light differ from a coarse model that is many pixels
    off. They lie where edges are strongest: on roofs, walls and crowns, which may be displaced
    against the ground. Chips on a regular layout show everything by its area. Source: [Patel2017]
    4, [Suri2010] 6.9.

    Parameters
    ----------
    matcher
        Matches keypoints.
    chips
        Fits the model; it sees no more than `matcher`.
    """

    matcher: KeypointMatcher
    chips: SurfaceFit

    def estimate(self, coarse: Model, kind: str, context: Context) -> Estimate:
        """Match keypoints near a coarse model and chips near theirs, and fit a model to the chips.

        Parameters and errors as `KeypointFit.estimate` has them; what "auto" chooses from is the
        chips' own.
        """
        # Keypoints need agree on no more to predict where chips match; few matches are enough.
        first, part = first_kind(kind), context.part(0.0, 0.6)
        _, fit = agreeing_keypoints(self.matcher, coarse, first, part)
        model = fit.model.on_map(self.matcher.pair.grid.centre_transform)
        return self.chips.estimate(model, kind, context.part(0.6, 1.0))


def agreeing_keypoints(
    matcher: KeypointMatcher, coarse: Model, kind: str, context: Context
) -> tuple[Correspondences, ConsensusFit]:
    """Return matches of keypoints, few enough of each place, and the model of most of them.

    Parameters and errors as `KeypointFit.estimate` has them.
    """
    everywhere = matcher.match(coarse, GATE_PX, context)
    found = everywhere.take(best_of_cells(everywhere.px, everywhere.score, _CELL_PX, _PER_CELL))
    prior = on_grid(coarse, matcher.pair.grid)
    fit = fit_matches(kind, found, prior, context.seed)
    require_no_rival(found, prior, fit.model)
    return found, fit


def far_from(px: FloatArray, others: NDArray[np.int_], reach_px: float) -> FloatArray:
    """Return those of other positions, shape (m, 2), from which all of `px` are further away."""
    from scipy.spatial import cKDTree  # takes 0.1 s to import; all tools import this module

    distance, _ = cKDTree(px).query(others)
    return others[distance > reach_px].astype(float)


def best_of_cells(
    px: FloatArray, score: FloatArray, cell_px: float, count: int
) -> NDArray[np.int_]:
    """Return which points to take: of those in each square cell the best, at most so many.

    Parameters
    ----------
    px
        Positions, shape (n, 2).
    score
        What is better, shape (n,).
    cell_px
        Side of the cells.
    count
        How many of each are taken.
    """
    cells = np.floor(px / max(cell_px, 1e-9)).astype(int)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.ravel()
    order = np.lexsort((-score, cell))
    _, first = np.unique(cell[order], return_index=True)
    rank = np.arange(len(order)) - np.repeat(first, np.diff([*first, len(order)]))
    return np.sort(order[rank < count])
