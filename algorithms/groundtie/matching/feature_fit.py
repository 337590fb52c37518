"""The model on which keypoint matches agree: its kind, its fit, and its variation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from affine import Affine

from ..errors import NothingFoundError, TooFewPointsError
from ..geometry.chance import log10_false_alarms
from ..geometry.estimation import Fitted, fit_without_blocks
from ..geometry.fitting import fit_model
from ..geometry.model_choice import (
    MATCHES_PER_PARAMETER,
    choose_simplest,
    left_out_blocks,
    left_out_scores,
)
from ..geometry.models import PARAMETERS, Model
from ..geometry.robust import CONSENSUS_PX, Mixture, distances, find_consensus, fit_robustly
from ..kinds import AUTO
from ..rasters.grid import FloatArray, apply_affine
from .alignment import LINEAR_CANDIDATES
from .matcher import Correspondences

# Matches farther than this from a model of any kind are outliers, in pixels.
_FAR_PX = 3.0

# Outliers of a model that agree with one another make a rival if there are at least this many, they
# are this share of those that agree on the model, and random matches would hardly ever (log10)
# agree so. Real pairs: -1.2 at most.
_FEWEST_RIVALS = 10
_RIVAL_SHARE = 0.1
_RIVAL_ALARMS = -10.0


@dataclass(frozen=True)
class ConsensusFit(Fitted):
    """A model on which matches agree; `mixture` marks the inliers."""

    mixture: Mixture


def fit_matches(kind: str, matches: Correspondences, prior: Affine, seed: int) -> ConsensusFit:
    """Fit a model to matches, most of which may be outliers.

    Parameters
    ----------
    kind
        One of `models.KINDS`, or "auto" for the simplest linear model that the matches justify.
    matches
        The matches, in matching pixels.
    prior
        The transform by which the input was resampled for matching, from matching pixels to
        nominal ones.
    seed
        Seed of the random samples.

    Raises
    ------
    TooFewPointsError
        Too few matches agree.
    """
    px, window_area = matches.px, matches.window_area_px2
    if len(px) <= PARAMETERS["affine"] // 2:
        raise TooFewPointsError(f"only {len(px)} features were matched")
    # If most matches are outliers, samples of two are free of them far more often than samples of
    # three. A similarity is enough, as the prior has removed the rest of the distortion.
    residual = find_consensus(px, matches.partner_px, CONSENSUS_PX, first_kind(kind), seed)
    start = fit_model("affine", px, apply_affine(prior, residual(px)))
    nominal_px = apply_affine(prior, matches.partner_px)
    if kind == AUTO:
        kind = _choose(px, nominal_px, start, window_area)
    model, mixture = fit_robustly(kind, px, nominal_px, 0.0, start, window_area)
    agreeing = int(mixture.inliers.sum())
    if 2 * agreeing <= PARAMETERS[kind]:
        raise TooFewPointsError(f"only {agreeing} of {len(px)} features agree with a model")
    weights = np.where(mixture.inliers, mixture.probability, 0.0)
    return ConsensusFit(model, fit_without_blocks(kind, px, nominal_px, weights), mixture)


def first_kind(kind: str) -> str:
    """Return the kind of the first model, at most a similarity, for a requested kind."""
    return kind if kind in ("translation", "rigid") else "similarity"


def require_no_rival(matches: Correspondences, prior: Affine, model: Model) -> None:
    """Refuse a model if many of its outliers agree on a shift from it.

    Between radar images of different incidence angles, forests and cities follow other transforms
    than the ground, each as consistent in itself as the ground.

    Parameters
    ----------
    matches, prior
        See `fit_matches`.
    model
        The model that was fitted to the matches.

    Raises
    ------
    NothingFoundError
        Outliers agree on such a shift.
    """
    residual = apply_affine(prior, matches.partner_px) - model(matches.px)
    length = np.hypot(*residual.T)
    far = length > _FAR_PX + CONSENSUS_PX
    if far.sum() < _FEWEST_RIVALS:
        return
    at, residual = matches.px[far], residual[far]
    rival = find_consensus(at, at + residual, CONSENSUS_PX, "translation")
    shift = rival([[0.0, 0.0]])[0]

    def agreeing(on: FloatArray) -> int:
        return int((np.hypot(*(residual - on).T) <= CONSENSUS_PX).sum())

    others = agreeing(shift)
    # Along roads and between tree crowns, matches slip to both sides alike; elevated objects are
    # displaced to one side.
    displaced = others - agreeing(-shift)
    probability = np.pi * CONSENSUS_PX**2 / matches.window_area_px2
    alarms = log10_false_alarms(others, len(at), probability, 1)
    if alarms < _RIVAL_ALARMS and displaced >= _RIVAL_SHARE * (length <= _FAR_PX).sum():
        apart = float(np.hypot(*shift))
        raise NothingFoundError(
            f"{others} features agree {apart:.0f} px beside the others: ground and elevated "
            "objects; give a mask of the ground"
        )


def _choose(px: FloatArray, nominal_px: FloatArray, start: Model, window_area: float) -> str:
    """Return the simplest kind of model that the matches justify.

    A match scores minus its squared distance from a model fitted without it, limited to that of
    an outlier.
    """

    def fit(kind: str) -> tuple[str, FloatArray]:
        models = [
            fit_robustly(kind, px[~block], nominal_px[~block], 0.0, start, window_area)[0]
            for block in left_out_blocks(px)
        ]
        distance = left_out_scores(
            px, models, lambda model, block: distances(model, px[block], nominal_px[block])
        )
        agreeing = int((distance < _FAR_PX).sum())
        if agreeing < MATCHES_PER_PARAMETER * PARAMETERS[kind]:
            raise TooFewPointsError(f"only {agreeing} of {len(px)} features agree with a model")
        return kind, -(np.minimum(distance, _FAR_PX) ** 2)

    # Linear models only: bending between radar images of different incidence angles is mostly
    # relief displacement of forests and cities, not of the ground.
    return choose_simplest(LINEAR_CANDIDATES, fit, px, np.full(len(px), -(_FAR_PX**2)))[0]
