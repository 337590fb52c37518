"""Simulated clouds over real images: bright, colourless and soft, with an exact mask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Exponent of the power spectrum of the clouds' shapes.
_SLOPE = 3.2

# Largest opacity, and the range over which it rises, in standard deviations of the field.
_LARGEST_OPACITY, _SOFTNESS = 0.97, 0.6

# Clouds are as bright as this quantile of the image; they vary by this share of its range.
_BRIGHTNESS_QUANTILE, _UNEVENNESS = 0.99, 0.12

# Opacity beyond which a pixel counts as cloud.
_IS_CLOUD = 0.4


@dataclass(frozen=True)
class Clouds:
    """Clouds over an image: their opacity, 0 to 1, and their brightness, both of shape (h, w)."""

    opacity: NDArray[np.float64]
    brightness: NDArray[np.float64]

    @property
    def hidden(self) -> NDArray[np.bool_]:
        """Pixels that count as cloud."""
        return self.opacity > _IS_CLOUD

    def over(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return an image under the clouds, which are equally bright in all of its bands."""
        clouded = image * (1 - self.opacity) + self.brightness * self.opacity
        return clouded.astype(np.float32)


def clouds_over(image: NDArray[np.float32], share: float, seed: int) -> Clouds:
    """Return clouds over a share of a grey image of shape (h, w), matched to its brightness."""
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
    """Return a random field of mean 0 and variance 1; its power falls as frequency^-slope."""
    rows, cols = (np.fft.fftfreq(size)[:, None] * size for size in shape[:2])
    frequency = np.hypot(rows / shape[0], cols.T / shape[1])
    frequency[0, 0] = np.inf
    spectrum = np.fft.fft2(generator.normal(size=shape[:2])) * frequency ** (-slope / 2)
    field = np.fft.ifft2(spectrum).real
    return np.asarray((field - field.mean()) / field.std())
