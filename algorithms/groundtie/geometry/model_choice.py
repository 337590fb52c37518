"""The choice of a model: the simplest that predicts well the points left out of its fit.

The errors of neighbouring points are correlated. The cross-validation therefore leaves out blocks
of points, and judges the gain of a more flexible model by its scatter between blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..rasters.grid import FloatArray
from ..rasters.reading import Mask

T = TypeVar("T")

# A more flexible model must raise the left-out scores by this many of their standard errors. One is
# usual ([Hastie2009] 7.10); models that bend extrapolate badly and need two. A shift needs only
# some gain. Measured with `make bench`.
STANDARD_ERRORS = {
    "translation": 0.0,
    "shift_drift": 1.0,
    "similarity": 1.0,
    "affine": 1.0,
    "terrain": 1.0,
    "polynomial2": 2.0,
    "polynomial3": 2.0,
}

# Fewest points for each parameter of a model: chips, each with a whole similarity surface; keypoint
# matches that agree with the model; control points, two coordinates each.
CHIPS_PER_PARAMETER = 2
MATCHES_PER_PARAMETER = 3
CONTROL_PER_PARAMETER = 1.5

# The usual number ([Hastie2009] 7.10).
_FOLDS = 5


def choose_simplest(
    kinds: Iterable[str],
    fit: Callable[[str], tuple[T, FloatArray]],
    px: FloatArray,
    baseline: FloatArray | None = None,
    is_held: Callable[[T], bool] = lambda tried: True,
) -> tuple[T, list[T]]:
    """Fit models from simple to flexible and choose the simplest that the points justify.

    Parameters
    ----------
    kinds
        Kinds of models, from simple to flexible.
    fit
        Fits a kind, one of `models.PARAMETERS` or of `bias.KINDS`. Returns the model, in any form,
        and the score of each point by a model fitted without it, shape (n,): larger is better.
        Raises TooFewPointsError if the points are too few or disagree.
    px
        Positions of the points, shape (n, 2).
    baseline
        Scores without any model, shape (n,), which the first model must exceed; None: no condition.
    is_held
        Whether the points support a model that would replace a simpler one, apart from its gain.

    Returns
    -------
    The chosen model, and all fitted models.

    Raises
    ------
    TooFewPointsError
        No model could be fitted or exceeds the baseline.
    """
    chosen: T | None = None
    scores = baseline
    fitted: list[T] = []
    failure: TooFewPointsError | None = None
    for kind in kinds:
        try:
            tried, left_out = fit(kind)
        except TooFewPointsError as error:
            failure = failure or error
            continue
        fitted.append(tried)
        if scores is not None:
            gains = standard_errors(left_out - scores, px) > STANDARD_ERRORS.get(kind, 0.0)
            if not gains or (chosen is not None and not is_held(tried)):
                continue
        chosen, scores = tried, left_out
    if chosen is None:
        raise failure or TooFewPointsError(f"too few of {len(px)} points agree with a model")
    return chosen, fitted


def left_out_scores(
    px: FloatArray, models: Iterable[T], score: Callable[[T, Mask], FloatArray]
) -> FloatArray:
    """Return each point's score by the model that has not seen its block, shape (n,).

    Parameters
    ----------
    px
        Positions of the points, shape (n, 2).
    models
        One model for each of `left_out_blocks`.
    score
        Returns the scores, shape (m,), of the m points that a mask of shape (n,) selects.
    """
    scores = np.zeros(len(px))
    for model, block in zip(models, left_out_blocks(px), strict=True):
        scores[block] = score(model, block)
    return scores


def left_out_blocks(px: FloatArray) -> list[Mask]:
    """Return masks of the points that each fold leaves out, shape (n,) each; every point once.

    Neighbours share a fold; each row and each column of blocks holds every fold once. If all points
    lie in blocks of one fold, each block becomes a fold: no model can be fitted to no points.
    """
    block = blocks_of(px)
    folds = (block[:, 0] + 2 * block[:, 1]) % _FOLDS
    if len(np.unique(folds)) == 1:
        folds = np.asarray(block @ [1, _FOLDS], int)
    return [folds == fold for fold in np.unique(folds)]


def standard_errors(rise: FloatArray, px: FloatArray) -> float:
    """Return the sum of a rise in units of its standard error.

    The standard error comes from the sums of blocks, since neighbouring points are correlated.

    Parameters
    ----------
    rise
        Rise at each point, shape (n,).
    px
        Positions of the points, shape (n, 2).
    """
    block = blocks_of(px) @ [1, _FOLDS]
    sums = np.array([rise[block == b].sum() for b in np.unique(block)])
    error = sums.std(ddof=1) * np.sqrt(len(sums)) if len(sums) > 1 else np.inf
    return float(sums.sum() / max(error, 1e-12))


def blocks_of(px: FloatArray, side: int = _FOLDS) -> NDArray[np.int_]:
    """Return the column and row of the block that each point lies in, shape (n, 2).

    The points' extent is divided into `side` blocks a side, by default as many as there are folds.
    """
    low, high = px.min(axis=0), px.max(axis=0)
    unit = (px - low) / np.maximum(high - low, 1e-12)
    return np.minimum((unit * side).astype(int), side - 1)
