"""Training of feature classifiers, with scikit-learn."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..geometry.model_choice import blocks_of
from ..geometry.rows import Rows
from ..rasters.grid import FloatArray
from .classifier import DEGREE, OFFSET, FeatureClassifier

# Fewer labelled points of a class are not informative.
FEWEST_POINTS = 10

# More points of a class make training longer, not better.
_MOST_POINTS = 2000

# Blocks a side into which labelled points are divided, and folds of blocks that are left out in
# turn.
_BLOCKS, _FOLDS = 6, 3


@dataclass(frozen=True)
class Training(Rows):
    """Labelled points of an image.

    Parameters
    ----------
    statistics
        Statistics of the patches around the points, shape (n, k).
    kept
        Whether the points may be matched, shape (n,).
    px
        Positions (col, row), shape (n, 2).
    bands
        Number of bands that the statistics use; 0: grey values alone.
    """

    statistics: FloatArray
    kept: NDArray[np.bool_]
    px: FloatArray
    bands: int = 0


def train_classifier(
    labelled: Training,
    statistics: str,
    kernel: str,
    pixel_size_m: float,
    seed: int,
    balanced: bool = False,
) -> FeatureClassifier:
    """Train a classifier.

    Parameters
    ----------
    labelled
        The points.
    statistics, kernel, pixel_size_m
        See `FeatureClassifier`.
    seed
        Random seed for the choice of points, if there are more than are needed.
    balanced
        Whether both classes have equal weight, whatever their numbers of points; else each is
        weighted by its frequency, as in use.

    Raises
    ------
    TooFewPointsError
        A class has too few points.
    """
    from sklearn.svm import SVC

    _require_both(labelled)
    chosen = labelled.take(_some_of_each(labelled.kept, seed))
    mean = chosen.statistics.mean(axis=0)
    spread = np.maximum(chosen.statistics.std(axis=0), 1e-12)
    gamma = 1 / chosen.statistics.shape[1]
    weights = {
        kept: (labelled.kept == kept).sum() / (chosen.kept == kept).sum() for kept in (True, False)
    }
    # C, the cost of a point on the wrong side, has its default 1.
    machine = SVC(
        kernel="poly" if kernel in DEGREE else kernel,
        degree=DEGREE.get(kernel, 1),
        gamma=gamma,
        coef0=OFFSET,
        class_weight="balanced" if balanced else weights,
    )
    scaled = (chosen.statistics - mean) / spread
    machine.fit(scaled, chosen.kept)
    return FeatureClassifier(
        statistics=statistics,
        kernel=kernel,
        gamma=gamma,
        mean=mean,
        spread=spread,
        low=scaled.min(axis=0),
        high=scaled.max(axis=0),
        vectors=np.asarray(machine.support_vectors_, float),
        weights=np.asarray(machine.dual_coef_, float)[0],
        intercept=float(machine.intercept_[0]),
        pixel_size_m=pixel_size_m,
        bands=labelled.bands,
    )


def left_out_accuracy(
    labelled: Training, statistics: str, kernel: str, seed: int, balanced: bool = False
) -> float:
    """Return the cross-validated accuracy, the mean of the shares of both classes decided right.

    Blocks of neighbouring points are left out of the training together; NaN if the points of a
    class lie too near each other for that.
    """
    folds = blocks_of(labelled.px, _BLOCKS).sum(axis=1) % _FOLDS
    decided = np.full(len(labelled), np.nan)
    for fold in range(_FOLDS):
        out = folds == fold
        with suppress(TooFewPointsError):
            rest = labelled.take(~out)
            found = train_classifier(rest, statistics, kernel, 1.0, seed, balanced)
            decided[out] = found.decide(labelled.statistics[out])
    right, known = (decided > 0) == labelled.kept, np.isfinite(decided)
    classes = [right[known & own] for own in (labelled.kept, ~labelled.kept)]
    return float(np.mean([own.mean() if len(own) else np.nan for own in classes]))


def _require_both(labelled: Training) -> None:
    for what, count in (("kept", labelled.kept.sum()), ("left out", (~labelled.kept).sum())):
        if count < FEWEST_POINTS:
            raise TooFewPointsError(
                f"only {count} labelled points are to be {what}, fewer than {FEWEST_POINTS}"
            )


def _some_of_each(kept: NDArray[np.bool_], seed: int) -> NDArray[np.intp]:
    """Return the points to train with, in their order: at most `_MOST_POINTS` of each class."""
    random = np.random.default_rng(seed)
    chosen = []
    for label in (True, False):
        own = np.nonzero(kept == label)[0]
        chosen.append(random.permutation(own)[:_MOST_POINTS])
    return np.sort(np.concatenate(chosen))
