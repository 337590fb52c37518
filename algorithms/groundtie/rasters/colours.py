"""Classes of colour: information of several bands on the ground beyond its brightness.

Grass, water and asphalt may be equally bright and differ in colour. A joint histogram does not need
an order of the classes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .windows import FloatImage, Mask

# Numbers of equally frequent levels of brightness and of colour.
_BRIGHTNESS, _HUES = 12, 4

# Up to this many edges, comparing all pixels with each edge is faster than a binary search.
_FEW_EDGES = 63

# With this many pixels, quantiles are accurate to 0.2 % of all pixels.
_MOST_PIXELS = 100_000

# Before logarithms are taken, values are raised to at least this share of the brightest.
_DARKEST = 1e-3


@dataclass(frozen=True)
class Colours:
    """Levels of brightness, and of the colour component with the largest variance.

    Parameters
    ----------
    brightness_edges
        Inner edges between levels of the mean of all bands, shape (levels - 1,).
    component
        Weights of the bands' logarithms, shape (bands,).
    hue_edges
        Inner edges between levels of that component, shape (hues - 1,).
    darkest
        Lower limit of values before their logarithm is taken.
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
        # Not indexed by the mask, which would first copy all pixels.
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

    def measured(self, bands: FloatImage) -> FloatImage:
        """Return the brightness, and the component of colour, of bands (bands, h, w): (2, h, w)."""
        hue = np.einsum("b,b...->...", self.component, _hues(bands, self.darkest))
        return np.stack([bands.mean(axis=0), hue])

    def classes(self, measured: FloatImage) -> FloatImage:
        """Return the numbers of the classes, from 1, by `measured`; shape (h, w)."""
        brightness, hue = measured
        level = levels(brightness, self.brightness_edges)
        return np.asarray(level * _HUES + levels(hue, self.hue_edges) + 1, np.float32)

    @property
    def edges(self) -> FloatImage:
        """Inner edges between the numbers of classes, shape (classes - 1,)."""
        return np.arange(1.5, _BRIGHTNESS * _HUES, dtype=np.float32)


def levels(values: FloatImage, edges: FloatImage) -> NDArray[np.uint8]:
    """Return the number of edges, rising and up to 254, at or below each value, same shape."""
    if len(edges) > _FEW_EDGES:
        return np.searchsorted(edges, values, side="right").astype(np.uint8)
    found = np.zeros(values.shape, np.uint8)
    for edge in edges:
        found += values >= edge
    return found


def _hues(bands: FloatImage, darkest: float) -> FloatImage:
    """Return the logarithms of bands minus that of their geometric mean."""
    logarithms = np.log(np.maximum(bands, np.float32(darkest)))
    return np.asarray(logarithms - logarithms.mean(axis=0), np.float32)


def _edges(values: FloatImage, levels: int) -> FloatImage:
    shares = np.linspace(0, 100, levels + 1)[1:-1]
    return np.percentile(values, shares).astype(np.float32)
