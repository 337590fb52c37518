"""Classes of colour: what several bands show of the ground beyond how bright it is.

A joint histogram of classes needs no order among them. Grass, water and asphalt differ in colour
where they are as bright as each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .windows import FloatImage, Mask

# Equally frequent levels of brightness and of colour.
_BRIGHTNESS, _HUES = 12, 4

# Comparing pixels with so many edges, one after the other, is faster than to search among them.
_FEW_EDGES = 63

# Of so many pixels, quantiles are known to 0.2 % of all pixels.
_MOST_PIXELS = 100_000

# Values are no less than this share of the brightest before their logarithm is taken.
_DARKEST = 1e-3


@dataclass(frozen=True)
class Colours:
    """Levels of brightness, and of the component of colour that varies most.

    Parameters
    ----------
    brightness_edges
        Inner edges between levels of the mean of all bands, shape (levels - 1,).
    component
        Weights of the bands' logarithms, shape (bands,).
    hue_edges
        Inner edges between levels of that component, shape (hues - 1,).
    darkest
        Values are no less than this before their logarithm is taken.
    """

    brightness_edges: FloatImage
    component: FloatImage
    hue_edges: FloatImage
    darkest: float

    @classmethod
    def of(cls, bands: FloatImage, valid: Mask) -> Colours:
        """Return the classes of an image.

        Parameters
        ----------
        bands
            Shape (bands, h, w), two or more.
        valid
            Which pixels count, shape (h, w).
        """
        every = max(int(np.count_nonzero(valid)) // _MOST_PIXELS, 1)
        # Not by the mask, which would copy all pixels first.
        values = bands.reshape(len(bands), -1)[:, np.flatnonzero(valid)[::every]]
        darkest = max(_DARKEST * float(np.percentile(values, 99)), 1e-9)
        hues = _hues(values, darkest)
        component = np.linalg.eigh(np.cov(hues))[1][:, -1].astype(np.float32)
        return cls(
            _edges(values.mean(axis=0), _BRIGHTNESS),
            component,
            _edges(component @ hues, _HUES),
            darkest,
        )

    def classes(self, bands: FloatImage) -> FloatImage:
        """Return the numbers of the classes, from 1, of bands (bands, h, w); shape (h, w)."""
        hue = np.einsum("b,b...->...", self.component, _hues(bands, self.darkest))
        level = levels(bands.mean(axis=0), self.brightness_edges)
        return np.asarray(level * _HUES + levels(hue, self.hue_edges) + 1, np.float32)

    @property
    def edges(self) -> FloatImage:
        """Inner edges between the numbers of classes, shape (classes - 1,)."""
        return np.arange(1.5, _BRIGHTNESS * _HUES, dtype=np.float32)


def levels(values: FloatImage, edges: FloatImage) -> NDArray[np.uint8]:
    """Return how many of up to 254 rising edges lie at or below each value, same shape."""
    if len(edges) > _FEW_EDGES:
        return np.searchsorted(edges, values, side="right").astype(np.uint8)
    found = np.zeros(values.shape, np.uint8)
    for edge in edges:
        found += values >= edge
    return found


def _hues(bands: FloatImage, darkest: float) -> FloatImage:
    """Return the logarithms of bands without that of their geometric mean."""
    logarithms = np.log(np.maximum(bands, np.float32(darkest)))
    return np.asarray(logarithms - logarithms.mean(axis=0), np.float32)


def _edges(values: FloatImage, levels: int) -> FloatImage:
    shares = np.linspace(0, 100, levels + 1)[1:-1]
    return np.percentile(values, shares).astype(np.float32)
