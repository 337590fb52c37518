"""The model that feature matches agree on: its kind, its fit, and how it varies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..errors import NothingFoundError, TooFewPointsError
from ..geometry.chance import log10_false_alarms
from ..geometry.estimation import SIGMA_RANGE_PX
from ..geometry.fitting import fit_model
from ..geometry.models import PARAMETERS, Frame, Model
from ..geometry.robust import (
    Mixture,
    block_folds,
    distances,
    find_consensus,
    fit_robustly,
    standard_errors,
)
from ..rasters.grid import apply_affine

FloatArray = NDArray[np.float64]

AUTO = "auto"

# Matches agree with a first model of degree 1 within this.
_CONSENSUS_PX = 3.0

# Right matches for each parameter below which a model is not considered.
_MATCHES_PER_PARAMETER = 3

# What "auto" chooses from, and by how many standard errors a more flexible model must bring
# matches nearer that were left out of its fit. What bends between radar images of other incidence
# angles are mostly forests and cities, which lean, and not the ground.
_STANDARD_ERRORS = {"translation": 0.0, "similarity": 1.0, "affine": 1.0}

# Matches further off than this are wrong whatever the model, in pixels.
_FAR_PX = 3.0

# So many matches that agree elsewhere make a rival, if they are this share of those that agree on
# the model, and random ones would hardly ever (log10) agree so. Real pairs: -1.2 at most.
_FEWEST_RIVALS = 10
_RIVAL_SHARE = 0.1
_RIVAL_ALARMS = -10.0


@dataclass(frozen=True)
class Fit:
    """A model that matches agree on.

    Parameters
    ----------
    model
        From pixel positions of the matching grid to where the input claims them to be, in pixels
        of the same grid.
    fold_models
        The same fitted without one block of matches after the other.
    mixture
        Which matches are right.
    """

    model: Model
    fold_models: tuple[Model, ...]
    mixture: Mixture


def fit_matches(
    kind: str,
    px: FloatArray,
    partner_px: FloatArray,
    prior: Affine,
    window_area: float,
    seed: int,
) -> Fit:
    """Fit a model to matches of which most may be wrong.

    Parameters
    ----------
    kind
        One of `models.KINDS`, or "auto" for the simplest polynomial that the matches justify.
    px, partner_px
        Positions that belong together, in matching pixels, those of the input as it was resampled
        for matching, shape (n, 2).
    prior
        What it was resampled by: from such positions to claimed ones.
    window_area
        Area over which wrong partners fall, px².
    seed
        Of random samples.

    Raises
    ------
    TooFewPointsError
        Too few matches agree.
    """
    if len(px) <= PARAMETERS["affine"] // 2:
        raise TooFewPointsError(f"only {len(px)} features were matched")
    # Where most are wrong, samples of two matches are right far more often than those of three;
    # the prior has taken out what a similarity cannot tell.
    first_kind = kind if kind in ("translation", "rigid") else "similarity"
    residual = find_consensus(px, partner_px, _CONSENSUS_PX, first_kind, seed)
    start = fit_model("affine", px, apply_affine(prior, residual(px)))
    claimed_px = apply_affine(prior, partner_px)
    if kind == AUTO:
        kind = _choose(px, claimed_px, start, window_area)
    model, mixture = _fit(kind, px, claimed_px, start, window_area)
    right = int(mixture.inliers.sum())
    if 2 * right <= PARAMETERS[kind]:
        raise TooFewPointsError(f"only {right} of {len(px)} features agree with a model")
    weights = np.where(mixture.inliers, mixture.probability, 0.0)
    folds = block_folds(px)
    fold_models = tuple(
        fit_model(kind, px, claimed_px, np.where(folds == fold, 0.0, weights), Frame.around(px))
        for fold in np.unique(folds)
    )
    return Fit(model, fold_models, mixture)


def require_no_rival(
    px: FloatArray, partner_px: FloatArray, prior: Affine, model: Model, window_area: float
) -> None:
    """Refuse a model if many of the matches that it calls wrong agree on a shift from it.

    Forests and cities lie on other transforms than the ground between radar images of different
    incidence angles, each as firm in itself as the ground.

    Parameters
    ----------
    px, partner_px, prior, window_area
        See `fit_matches`.
    model
        What was fitted to them.

    Raises
    ------
    NothingFoundError
        There is such a shift.
    """
    residual = apply_affine(prior, partner_px) - model(px)
    length = np.hypot(*residual.T)
    far = length > _FAR_PX + _CONSENSUS_PX
    if far.sum() < _FEWEST_RIVALS:
        return
    at, residual = px[far], residual[far]
    rival = find_consensus(at, at + residual, _CONSENSUS_PX, "translation")
    shift = rival([[0.0, 0.0]])[0]

    def agreeing(on: FloatArray) -> int:
        return int((np.hypot(*(residual - on).T) <= _CONSENSUS_PX).sum())

    others = agreeing(shift)
    # Along roads and between crowns features slip to both sides alike; what stands leans to one.
    leaning = others - agreeing(-shift)
    probability = np.pi * _CONSENSUS_PX**2 / window_area
    alarms = log10_false_alarms(others, len(at), probability, 1)
    if alarms < _RIVAL_ALARMS and leaning >= _RIVAL_SHARE * (length <= _FAR_PX).sum():
        apart = float(np.hypot(*shift))
        raise NothingFoundError(
            f"{others} features agree {apart:.0f} px beside the others: ground and what stands on "
            "it; give a mask of the ground"
        )


def _fit(
    kind: str, px: FloatArray, partner_px: FloatArray, start: Model, window_area: float
) -> tuple[Model, Mixture]:
    none = np.zeros(len(px))
    return fit_robustly(kind, px, partner_px, none, start, window_area, SIGMA_RANGE_PX)


def _choose(px: FloatArray, partner_px: FloatArray, start: Model, window_area: float) -> str:
    """Return the simplest kind of model that the matches justify."""
    chosen, lowest = "", np.full(len(px), _FAR_PX**2)
    for kind, errors in _STANDARD_ERRORS.items():
        try:
            costs = _left_out_costs(kind, px, partner_px, start, window_area)
        except TooFewPointsError:
            # Too simple, as a shift is for a turned image, or too flexible.
            continue
        enough = (costs < _FAR_PX**2).sum() >= _MATCHES_PER_PARAMETER * PARAMETERS[kind]
        if enough and standard_errors(lowest - costs, px) > errors:
            chosen, lowest = kind, costs
    if not chosen:
        raise TooFewPointsError(f"too few of {len(px)} matched features agree with a model")
    return chosen


def _left_out_costs(
    kind: str, px: FloatArray, partner_px: FloatArray, start: Model, window_area: float
) -> FloatArray:
    """Return squared distances from a model without these matches, at most a wrong one's, (n,)."""
    folds = block_folds(px)
    costs = np.zeros(len(px))
    for fold in np.unique(folds):
        out = folds == fold
        model, _ = _fit(kind, px[~out], partner_px[~out], start, window_area)
        costs[out] = distances(model, px[out], partner_px[out])
    return np.asarray(np.minimum(costs, _FAR_PX) ** 2)
