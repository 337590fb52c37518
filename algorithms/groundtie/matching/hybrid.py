"""The hybrid chain's tie points (thesis S 6.9): features near where a rough model puts them.

Mutual information on reduced images has found the rough model; features are matched without a
limit on the ratio, but only near their prediction. Most of these matches are wrong, and fall
anywhere in the gate; a robust fit tells the right ones. Chips around them may refine their places.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..context import Context
from ..errors import TooFewPointsError
from ..geometry.estimation import SIGMA_RANGE_PX, Estimate, fit_thin_plate, jackknife_spread
from ..geometry.fitting import fit_model
from ..geometry.models import PARAMETERS, Model
from ..geometry.robust import fit_mixture
from ..geometry.tie_points import USED, TiePoints
from ..geometry.transform import Transform
from ..progress import SILENT, Progress
from ..rasters.grid import apply_affine
from ..similarity.peak import find_peak
from ..similarity.surface import SimilaritySettings
from .chips import ChipMatcher
from .feature_fit import AUTO, Fit, fit_matches, require_no_rival
from .feature_tiles import FeatureMatcher
from .local import LocalSearch

FloatArray = NDArray[np.float64]

# A partner without a rival in its gate is as much nearer than the next as this, at most.
_LARGEST_SCORE = 10.0

# Chips around matches: how large, and how far they are moved: by so many standard deviations of the
# first model's predictions, within these limits.
_CHIP_PX = 81
_CHIP_SIGMAS, _CHIP_RADIUS_PX = 3.0, (4, 12)

# If a tenth of them moves the model by more than this, they are matched again from where it is
# then: at most so often in all.
_FAR_PX = 2.5
_ROUNDS = 3

# Of the matches in each of so many cells a side the best is refined.
_CHIP_CELLS = 14

# Forests and cities have more features than fields, and lean. So that they do not outvote the
# ground, no cell has more than so many matches.
_CELL_PX, _PER_CELL = 64.0, 6

# Right matches lie this near a polynomial where a thin-plate spline is to bend further.
_TPS_RADIUS_PX = 5.0


@dataclass(frozen=True)
class _Places:
    """Matches as they are fitted: in matching pixels, the input's as it was resampled."""

    px: FloatArray
    partner_px: FloatArray
    score: FloatArray
    window_area: float


@dataclass(frozen=True)
class FeatureSearch:
    """Finds the model of a pair by features, refined by chips if asked to.

    Parameters
    ----------
    matcher
        Matches features, of which the reference's see nothing of what is held out.
    local
        Knows the grid and what is held out.
    refinement
        Similarity by which chips refine the matches, and others between them; where too few match,
        chips alone are taken. None: matches stay where they were found.
    """

    matcher: FeatureMatcher
    local: LocalSearch
    refinement: SimilaritySettings | None = None

    def estimate(
        self, coarse: Model, kind: str, seed: int, executor: Executor, progress: Progress = SILENT
    ) -> Estimate:
        """Match features near a rough model, and fit a model to the matches.

        Parameters
        ----------
        coarse
            The misregistration on the map, a model of degree 1; it may be wrong by the gate.
        kind
            One of `models.KINDS`, or "auto" for the simplest polynomial that the matches justify.
        seed
            Of random samples.
        executor
            Threads to work in.
        progress
            Is told of every tile and chip.

        Raises
        ------
        TooFewPointsError
            Too few matches agree on a model.
        NothingFoundError
            Many of them agree on two.
        """
        try:
            places, fit = self._match(coarse, kind, seed, executor, progress.part(0.0, 0.7))
        except TooFewPointsError:
            if self.refinement is None:
                raise
            # What "auto" chooses among chips may bend more than matches of features may.
            chips_kind = "affine" if kind == AUTO else kind
            return self.local.estimate(coarse, chips_kind, seed, executor, progress.part(0.7, 1.0))
        if self.refinement is not None:
            part = progress.part(0.7, 1.0)
            places, coarse, fit = self._refined(kind, places, coarse, fit, seed, executor, part)
        return self._estimate(kind, places, coarse, fit)

    def _match(
        self, coarse: Model, kind: str, seed: int, executor: Executor, progress: Progress
    ) -> tuple[_Places, Fit]:
        """Return matches of features, few enough of each place, and the model of most of them."""
        matches = self.matcher.match(coarse, Context(executor, progress, seed))
        score = 1 / np.maximum(matches.ratio, 1 / _LARGEST_SCORE)
        area = float(np.pi * self.matcher.gate_px**2)
        kept = best_of_cells(matches.reference.position_px, score, _CELL_PX, _PER_CELL)
        px, partner_px = matches.reference.position_px[kept], matches.input.position_px[kept]
        places = _Places(px, partner_px, score[kept], area)
        fit = self._fit(kind, places, coarse, seed)
        require_no_rival(px, partner_px, self.local.prior(coarse), fit.model, area)
        return places, fit

    def _refined(
        self,
        kind: str,
        matches: _Places,
        coarse: Model,
        fit: Fit,
        seed: int,
        executor: Executor,
        progress: Progress,
    ) -> tuple[_Places, Model, Fit]:
        """Return chips around features, the model that they were resampled by, and their fit.

        Features may agree on a wrong model where few match. If chips around it do not agree, the
        rough model may still be right.
        """
        try:
            return self._in_rounds(kind, matches, coarse, fit, seed, executor, progress)
        except TooFewPointsError:
            rough = self.local.prior(coarse)
            model = fit_model("affine", matches.px, apply_affine(rough, matches.px))
            # Without models of its folds: nobody knows how far it may be wrong.
            start = Fit(model, (), fit.mixture)
            return self._in_rounds(kind, matches, coarse, start, seed, executor, progress)

    def _in_rounds(
        self,
        kind: str,
        matches: _Places,
        coarse: Model,
        fit: Fit,
        seed: int,
        executor: Executor,
        progress: Progress,
    ) -> tuple[_Places, Model, Fit]:
        """Return what `_refined` does, from a first model.

        Matches with larger errors may have led it astray: if chips show it, they are matched
        again from their own.
        """
        claimed_px = apply_affine(self.local.prior(coarse), matches.partner_px)
        for _ in range(_ROUNDS):
            first = fit.model
            residuals = claimed_px - first(matches.px)
            right = fit_mixture(residuals, matches.window_area, SIGMA_RANGE_PX).inliers
            if 2 * right.sum() <= PARAMETERS["affine"]:
                raise TooFewPointsError(f"only {right.sum()} of {len(right)} features agree")
            px, score = matches.px[right], matches.score[right]
            coarse = self.local.on_map(fit_model("affine", px, first(px)))
            side = float(np.ptp(matches.px, axis=0).max()) / _CHIP_CELLS
            picked = px[best_of_cells(px, score, side, 1)]
            between = far_from(picked, self.local.layout.fit_centres, side)
            picked = np.concatenate([picked, between])
            reach = _CHIP_SIGMAS * jackknife_spread(fit.fold_models, picked)
            reach = np.clip(np.ceil(reach), *_CHIP_RADIUS_PX)
            radius = int(np.quantile(reach, 0.9))
            chips = self._chips(picked, coarse, radius, executor, progress)
            fit = self._fit(kind, chips, coarse, seed)
            moved = np.hypot(*(fit.model(picked) - first(picked)).T)
            if np.quantile(moved, 0.9) <= _FAR_PX:
                break
        return chips, coarse, fit

    def _fit(self, kind: str, places: _Places, coarse: Model, seed: int) -> Fit:
        polynomial = AUTO if kind == "tps" else kind
        prior = self.local.prior(coarse)
        return fit_matches(
            polynomial, places.px, places.partner_px, prior, places.window_area, seed
        )

    def _chips(
        self, px: FloatArray, model: Model, radius_px: int, executor: Executor, progress: Progress
    ) -> _Places:
        """Return chips around features and where they lie by their similarity."""
        assert self.refinement is not None
        pair = self.local.pair
        chips = ChipMatcher(
            pair,
            pair.grid,
            lambda xy: pair.claimed_px(model(xy)),
            self.refinement,
            self.local.held_out,
        )
        centres = np.unique(np.rint(px).astype(int), axis=0)
        surfaces = chips.match(centres, _CHIP_PX, radius_px, executor, progress)
        peaks = [find_peak(surface) for surface in surfaces.both]
        inside = np.array([not peak.at_border for peak in peaks], bool)
        shifts = np.array([peak.shift_px for peak in peaks]).reshape(-1, 2)[inside]
        heights = np.array([peak.height for peak in peaks])[inside]
        where = surfaces.centres[inside].astype(float)
        return _Places(where, where + shifts, heights, (2 * radius_px + 1.0) ** 2)

    def _estimate(self, kind: str, places: _Places, coarse: Model, fit: Fit) -> Estimate:
        pair = self.local.pair
        grid = pair.grid
        there = coarse(grid.pixel_to_map(places.partner_px))
        count, sigma = len(places.px), fit.mixture.sigma
        points = TiePoints(
            reference_xy=grid.pixel_to_map(places.px),
            input_px=pair.claimed_px(there),
            score=places.score,
            covariance_px2=np.broadcast_to(np.eye(2) * sigma**2, (count, 2, 2)).copy(),
            # Partners are each other's nearest.
            two_way_error_px=np.zeros(count),
            is_check=np.zeros(count, bool),
            state=np.full(count, USED),
        )
        points = points.reject(~fit.mixture.inliers, "disagrees with the model")
        as_claimed = Transform.as_claimed(grid.crs, pair.input.source.grid)
        model, fold_models = fit.model, fit.fold_models
        if kind == "tps":
            model, fold_models = fit_thin_plate(points, as_claimed, grid, model, _TPS_RADIUS_PX)
        transform = Transform(self.local.on_map(model), as_claimed.crs, as_claimed.input_grid)
        return Estimate(transform, points, fold_models)


def far_from(px: FloatArray, others: NDArray[np.int_], reach_px: float) -> FloatArray:
    """Return those of other positions, shape (m, 2), from which all of `px` are further away."""
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
