"""A support vector machine that decides which keypoints may be matched ([Patel2017] 5.2, 5.3).

It is stored completely as JSON; its use does not require scikit-learn.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..memory import AT_ONCE
from ..rasters.atomic import write_json
from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage
from ..strict_json import read_json
from .patch_statistics import BAND_RATIOS, NO_BANDS, STATISTICS, patch_statistics

# Degrees of the polynomial kernels (γ x·v + 1) ^ degree.
DEGREE = {"polynomial": 3, "quadratic": 2}
KERNELS = ("linear", "rbf", *DEGREE)
OFFSET = 1.0

_FORMAT = "groundtie feature classifier"
_VERSION = 1

_SCALING = ("mean", "spread", "low", "high")


@dataclass(frozen=True)
class FeatureClassifier:
    """A support vector machine on the statistics of patches.

    Parameters
    ----------
    statistics
        One of `patch_statistics.STATISTICS`.
    kernel
        One of `KERNELS`.
    gamma
        Factor of the kernel.
    mean, spread
        Offset and divisor that scale the statistics, shape (k,).
    low, high
        Range of the scaled statistics in the training, shape (k,). Values beyond it, where a
        polynomial is unbounded, are clipped to it.
    vectors
        Support vectors of scaled statistics, shape (n, k).
    weights
        Weights of the support vectors, shape (n,).
    intercept
        Constant that is added to the weighted sum.
    pixel_size_m
        Pixel size of the training image.
    bands
        Number of an image's bands that it uses; 0: its grey values alone.
    """

    statistics: str
    kernel: str
    gamma: float
    mean: FloatArray
    spread: FloatArray
    low: FloatArray
    high: FloatArray
    vectors: FloatArray
    weights: FloatArray
    intercept: float
    pixel_size_m: float
    bands: int = 0

    def decide(self, statistics: FloatArray) -> FloatArray:
        """Return decision values, (m,), for statistics, (m, k); positive: kept."""
        scaled = np.clip((statistics - self.mean) / self.spread, self.low, self.high)
        found = np.empty(len(scaled))
        step = max(AT_ONCE // len(self.vectors), 1)
        for start in range(0, len(scaled), step):
            block = slice(start, start + step)
            found[block] = self._kernel(scaled[block]) @ self.weights + self.intercept
        return found

    def keep(
        self, window: Patch, px: FloatArray, bands: FloatImage = NO_BANDS
    ) -> NDArray[np.bool_]:
        """Return which positions of a window may be matched, shape (n,).

        Parameters
        ----------
        window, px, bands
            As in `patch_statistics`.
        """
        return np.asarray(self.decide(patch_statistics(self.statistics, window, px, bands)) > 0)

    def _kernel(self, scaled: FloatArray) -> FloatArray:
        products = scaled @ self.vectors.T
        if self.kernel == "linear":
            return products
        if self.kernel == "rbf":
            own, other = (scaled**2).sum(axis=1), (self.vectors**2).sum(axis=1)
            return np.asarray(np.exp(-self.gamma * (own[:, None] + other - 2 * products)))
        return np.asarray((self.gamma * products + OFFSET) ** DEGREE[self.kernel])

    def write(self, path: Path) -> None:
        """Write the classifier as JSON."""
        values = {name: np.asarray(value).tolist() for name, value in vars(self).items()}
        write_json(path, {"format": _FORMAT, "version": _VERSION, **values}, indent=None)


def read_classifier(path: Path) -> FeatureClassifier:
    """Read a classifier from its JSON.

    Raises
    ------
    ParameterError
        The file is no classifier, or cannot be read.
    """
    try:
        return _from_json(read_json(path))
    except OSError as error:
        raise ParameterError(f"{path} cannot be read: {error.strerror}") from error
    except KeyError as error:
        raise ParameterError(f"{path} is no feature classifier: {error} is missing") from error
    except (ValueError, TypeError, OverflowError) as error:
        raise ParameterError(f"{path} is no feature classifier: {error}") from error


def _from_json(values: dict[str, Any]) -> FeatureClassifier:
    if values["format"] != _FORMAT or values["version"] != _VERSION:
        raise ValueError(f"format {values['format']!r} of version {values['version']!r}")
    if values["statistics"] not in STATISTICS or values["kernel"] not in KERNELS:
        raise ValueError(f"statistics {values['statistics']!r}, kernel {values['kernel']!r}")
    numbers: dict[str, Any] = {
        name: float(values[name]) for name in ("gamma", "intercept", "pixel_size_m")
    }
    arrays: dict[str, Any] = {
        name: np.array(values[name], float) for name in (*_SCALING, "vectors", "weights")
    }
    found = FeatureClassifier(
        statistics=values["statistics"],
        kernel=values["kernel"],
        bands=int(values["bands"]),
        **numbers,
        **arrays,
    )
    if (found.bands > 0) != (found.statistics == BAND_RATIOS):
        raise ValueError(f"statistics {found.statistics!r} of {found.bands} bands")
    bands = np.zeros((found.bands, 1, 1), np.float32)
    count = len(patch_statistics(found.statistics, _NOTHING, np.zeros((1, 2)), bands)[0])
    if found.vectors.shape != (len(found.weights), count) or len(found.vectors) == 0:
        raise ValueError("support vectors of the wrong shape")
    if any(arrays[name].shape != (count,) for name in _SCALING):
        raise ValueError("scaling of the wrong shape")
    if not all(np.isfinite(each).all() for each in (*numbers.values(), *arrays.values())):
        raise ValueError("a number is not finite")
    return found


_NOTHING = Patch(np.zeros((1, 1), np.float32), np.zeros((1, 1), bool))
