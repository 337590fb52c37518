"""Measures of similarity on joint histograms (thesis S 3.3)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Measure = Callable[[NDArray[np.floating]], NDArray[np.floating]]


def _entropy(histograms: NDArray[np.floating], axes: tuple[int, ...]) -> NDArray[np.floating]:
    """Return Shannon entropies in nats of histograms that need not be normalised."""
    total = histograms.sum(axis=axes)
    plogp = (histograms * np.log(np.maximum(histograms, 1e-12))).sum(axis=axes)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(total) - plogp / total)


def _entropies(
    histograms: NDArray[np.floating],
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Return H(A), H(B) and H(A, B) of joint histograms, shape (…, bins A, bins B)."""
    return (
        _entropy(histograms.sum(axis=-1), (-1,)),
        _entropy(histograms.sum(axis=-2), (-1,)),
        _entropy(histograms, (-2, -1)),
    )


def normalized_mutual_information(histograms: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return Studholme's (H(A) + H(B)) / H(A, B), between 1 and 2 (thesis S eq 3.21).

    Parameters
    ----------
    histograms
        Joint histograms, shape (…, bins A, bins B); counts or weights. Without any pixel, or
        where both images are constant, there is nothing shared: the measure is 1.
    """
    a, b, ab = _entropies(histograms)
    informative = np.isfinite(ab) & (ab > 1e-9)
    return np.where(informative, (a + b) / np.where(informative, ab, 1.0), 1.0)
