"""Choice of the simplest model that the points justify, by cross-validation over blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from .fitting import fit_model
from .models import PARAMETERS, Model

FloatArray = NDArray[np.float64]

# From simple to flexible. A rigid model is offered by name only: pixel sizes are known well
# enough for it seldom, and the similarity costs one parameter more.
CANDIDATES = ("translation", "similarity", "affine", "polynomial2", "polynomial3", "tps")

_FOLDS = 5

# Points for each parameter below which a model is not considered.
_POINTS_PER_PARAMETER = 1.5


@dataclass(frozen=True)
class CrossValidation:
    """Errors of the models that were compared: kind → RMSE at left-out points, pixels."""

    kind: str
    rmse: dict[str, float]


def choose_kind(
    xy: FloatArray, claimed_xy: FloatArray, weights: FloatArray, folds: NDArray[np.int_]
) -> CrossValidation:
    """Choose the simplest model whose error at left-out points is about that of the best.

    "About" means within one standard error (Breiman et al. 1984).

    Parameters
    ----------
    xy, claimed_xy
        Pairs of pixel positions that take part in the fit, shape (n, 2).
    weights
        Of the pairs, shape (n,).
    folds
        Number of the fold each pair belongs to, shape (n,); neighbours should share one, because
        their errors are alike.
    """
    losses: dict[str, FloatArray] = {}
    for kind in CANDIDATES:
        if len(xy) < _POINTS_PER_PARAMETER * PARAMETERS[kind] / 2:
            continue
        try:
            losses[kind] = _left_out_losses(kind, xy, claimed_xy, weights, folds)
        except TooFewPointsError:
            continue
    share = weights / weights.sum()
    mean = {kind: float(share @ loss) for kind, loss in losses.items()}
    if not mean:
        return CrossValidation("translation", {})
    best = min(mean, key=lambda kind: mean[kind])
    for kind in losses:
        difference = losses[kind] - losses[best]
        by_fold = np.array([share[folds == f] @ difference[folds == f] for f in np.unique(folds)])
        error = float(np.sqrt(len(by_fold)) * by_fold.std(ddof=1)) if len(by_fold) > 1 else 0.0
        if mean[kind] <= mean[best] + error:
            return CrossValidation(kind, {k: float(np.sqrt(m)) for k, m in mean.items()})
    return CrossValidation(best, {k: float(np.sqrt(m)) for k, m in mean.items()})


def _left_out_losses(
    kind: str, xy: FloatArray, claimed_xy: FloatArray, weights: FloatArray, folds: NDArray[np.int_]
) -> FloatArray:
    losses = np.zeros(len(xy))
    for fold in np.unique(folds):
        left_out = folds == fold
        model: Model = fit_model(kind, xy, claimed_xy, np.where(left_out, 0.0, weights))
        missed = claimed_xy[left_out] - model(xy[left_out])
        losses[left_out] = (missed**2).sum(axis=1)
    return losses


def block_folds(xy: FloatArray, folds: int = _FOLDS) -> NDArray[np.int_]:
    """Return fold numbers such that neighbours share one, shape (n,).

    The extent is cut into folds × folds blocks; each row and each column of blocks holds every
    fold once.
    """
    low, high = xy.min(axis=0), xy.max(axis=0)
    unit = (xy - low) / np.maximum(high - low, 1e-12)
    block = np.minimum((unit * folds).astype(int), folds - 1)
    return np.asarray((block[:, 0] + 2 * block[:, 1]) % folds)
