"""Simulated clouds over real images: bright, soft at their borders, with an exact mask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Spectrum of the clouds' shapes: its power falls with this power of the frequency.
_SLOPE = 3.2

# Opacity rises from nothing to this over a range of so many standard deviations of the field.
_LARGEST_OPACITY, _SOFTNESS = 0.97, 0.6

# Clouds are as bright as the brightest ground, and uneven by this share of the ground's range.
_BRIGHTNESS_QUANTILE, _UNEVENNESS = 0.99, 0.12

# From this opacity on a pixel counts as cloud.
_IS_CLOUD = 0.4


@dataclass(frozen=True)
class Clouded:
    """An image with clouds, shape (h, w) float32, and which pixels they hide, shape (h, w)."""

    image: NDArray[np.float32]
    hidden: NDArray[np.bool_]


def add_clouds(image: NDArray[np.float32], share: float, seed: int) -> Clouded:
    """Return an image with clouds over a share of it."""
    generator = np.random.default_rng(seed)
    field = fractal(image.shape, _SLOPE, generator)
    opacity = np.clip((field - np.quantile(field, 1 - share)) / _SOFTNESS + 0.5, 0, 1)
    opacity *= _LARGEST_OPACITY
    low, high = np.quantile(image, [0.01, _BRIGHTNESS_QUANTILE])
    texture = fractal(image.shape, 2.4, generator)
    cloud = high + _UNEVENNESS * (high - low) * texture
    clouded = image * (1 - opacity) + cloud * opacity
    return Clouded(clouded.astype(np.float32), opacity > _IS_CLOUD)


def fractal(
    shape: tuple[int, ...], slope: float, generator: np.random.Generator
) -> NDArray[np.float64]:
    """Return a random field of mean 0 and variance 1 whose power falls with the frequency."""
    rows, cols = (np.fft.fftfreq(size)[:, None] * size for size in shape[:2])
    frequency = np.hypot(rows / shape[0], cols.T / shape[1])
    frequency[0, 0] = np.inf
    spectrum = np.fft.fft2(generator.normal(size=shape[:2])) * frequency ** (-slope / 2)
    field = np.fft.ifft2(spectrum).real
    return np.asarray((field - field.mean()) / field.std())
