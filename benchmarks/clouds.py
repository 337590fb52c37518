"""Simulated clouds over real images: bright and without colour, soft, with an exact mask."""

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
class Clouds:
    """Clouds over an image: how much they hide, 0 to 1, and how bright they are, shape (h, w)."""

    opacity: NDArray[np.float64]
    brightness: NDArray[np.float64]

    @property
    def hidden(self) -> NDArray[np.bool_]:
        """Which pixels they hide."""
        return self.opacity > _IS_CLOUD

    def over(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return an image under the clouds, which are as bright in all of its bands."""
        clouded = image * (1 - self.opacity) + self.brightness * self.opacity
        return clouded.astype(np.float32)


def clouds_over(image: NDArray[np.float32], share: float, seed: int) -> Clouds:
    """Return clouds over a share of a grey image, shape (h, w), and as bright as it is."""
    generator = np.random.default_rng(seed)
    field = fractal(image.shape, _SLOPE, generator)
    opacity = np.clip((field - np.quantile(field, 1 - share)) / _SOFTNESS + 0.5, 0, 1)
    opacity *= _LARGEST_OPACITY
    low, high = np.quantile(image, [0.01, _BRIGHTNESS_QUANTILE])
    texture = fractal(image.shape, 2.4, generator)
    return Clouds(opacity, high + _UNEVENNESS * (high - low) * texture)


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
