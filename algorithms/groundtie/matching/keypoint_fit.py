"""The hybrid chain's tie points ([Suri2010] 6.9): keypoints near where a coarse model puts them.

Mutual information on reduced images has found the coarse model; keypoints are matched without a
limit on the ratio, but only near their prediction. Most of these matches are outliers, which
fall anywhere in the gate; a robust fit finds the inliers. Chips may refine their places.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..errors import TooFewPointsError
from ..features.matching import GATE_PX
from ..geometry.estimation import Estimate, fit_thin_plate, jackknife_spread
from ..geometry.fitting import fit_model
from ..geometry.models import PARAMETERS, Model
from ..geometry.robust import fit_mixture
from ..geometry.tie_points import USED, TiePoints
from ..geometry.transform import Transform
from ..kinds import AUTO
from ..rasters.grid import FloatArray, Grid, apply_affine
from .chips import ChipMatcher
from .feature_fit import Fit, fit_matches, require_no_rival
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
    """Fits a model to keypoints, refined by chips if asked to.

    Parameters
    ----------
    matcher
        Matches keypoints, of which the reference's see nothing of what is held out.
    chips
        Fits a model to chips alone where too few keypoints match; its matcher has the masks.
    refinement
        What chips around the keypoints, and others between them, are matched by. None: matches
        stay where they were found.
    """

    matcher: KeypointMatcher
    chips: SurfaceFit
    refinement: ChipMatcher | None = None

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
        AmbiguousPlaceError
            Many of them agree on two.
        """
        try:
            matches, fit = self._match(coarse, kind, context.part(0.0, 0.7))
        except TooFewPointsError:
            if self.refinement is None:
                raise
            # What "auto" chooses among chips may bend more than matches of keypoints may.
            chips_kind = "affine" if kind == AUTO else kind
            return self.chips.estimate(coarse, chips_kind, context.part(0.7, 1.0))
        if self.refinement is not None:
            refining = self.refinement, kind, matches, coarse
            try:
                refined = self._refined(*refining, fit, context.part(0.7, 1.0))
            except TooFewPointsError:
                # Keypoints may agree on a wrong model where few match. If chips around it do not
                # agree, the coarse model may still be right.
                known = apply_affine(on_grid(coarse, self._grid), matches.px)
                model = fit_model("affine", matches.px, known)
                # Without models of its folds: how far it may be wrong is unknown.
                start = Fit(model, (), fit.mixture)
                refined = self._refined(*refining, start, context.part(0.7, 1.0))
            matches, coarse, fit = refined
        return self._estimate(kind, matches, coarse, fit)

    @property
    def _grid(self) -> Grid:
        return self.matcher.pair.grid

    def _match(self, coarse: Model, kind: str, context: Context) -> tuple[Correspondences, Fit]:
        """Return matches of keypoints, few enough of each place, and the model of most of them."""
        everywhere = self.matcher.match(coarse, GATE_PX, context)
        found = everywhere.take(best_of_cells(everywhere.px, everywhere.score, _CELL_PX, _PER_CELL))
        fit = self._fit(kind, found, coarse, context.seed)
        require_no_rival(found, on_grid(coarse, self._grid), fit.model)
        return found, fit

    def _refined(
        self,
        chips: ChipMatcher,
        kind: str,
        matches: Correspondences,
        coarse: Model,
        fit: Fit,
        context: Context,
    ) -> tuple[Correspondences, Model, Fit]:
        """Return chips around keypoints, the model that they were resampled by, and their fit.

        Matches with larger errors may have led the first model, `fit`, astray: if chips show it,
        they are matched again from their own.
        """
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
            fit = self._fit(kind, found, coarse, context.seed)
            if chips.is_settled(fit.model(picked) - first(picked)):
                break
        return found, coarse, fit

    def _fit(self, kind: str, matches: Correspondences, coarse: Model, seed: int) -> Fit:
        first_kind = AUTO if kind == "tps" else kind
        return fit_matches(first_kind, matches, on_grid(coarse, self._grid), seed)

    def _estimate(self, kind: str, matches: Correspondences, coarse: Model, fit: Fit) -> Estimate:
        pair, grid = self.matcher.pair, self._grid
        count, sigma = len(matches.px), fit.mixture.sigma
        points = TiePoints(
            reference_xy=grid.pixel_to_map(matches.px),
            input_px=pair.nominal_px(coarse(grid.pixel_to_map(matches.partner_px))),
            score=matches.score,
            covariance_px2=np.broadcast_to(np.eye(2) * sigma**2, (count, 2, 2)).copy(),
            # Partners are each other's nearest.
            forward_backward_error_px=np.zeros(count),
            is_check=np.zeros(count, bool),
            state=np.full(count, USED),
        )
        points = points.reject(~fit.mixture.inliers, "disagrees with the model")
        nominal = Transform.nominal(grid.crs, pair.input.source.grid)
        model, fold_models = fit.model, fit.fold_models
        if kind == "tps":
            model, fold_models = fit_thin_plate(points, nominal, grid, model, _TPS_RADIUS_PX)
        transform = replace(nominal, model=model.on_map(grid.centre_transform))
        return Estimate(transform, points, fold_models)


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
