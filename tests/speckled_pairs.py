"""Pairs of radar images of one texture, each with its own speckle, and a known misregistration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from textured_pairs import TexturedPair, rewritten, texture, write_textured_pair

from groundtie.geometry.models import Model
from groundtie.rasters.patch import Patch

LOOKS = 4.0


def speckled(image: NDArray[Any], looks: float, seed: int) -> NDArray[np.float32]:
    """Return an amplitude image with speckle of so many looks."""
    if np.isinf(looks):
        return image.astype(np.float32)
    rng = np.random.default_rng(seed)
    return (image * np.sqrt(rng.gamma(looks, 1 / looks, image.shape))).astype(np.float32)


def radar_image(
    height: int, width: int, seed: int = 0, looks: float = LOOKS, speckle_seed: int = 0
) -> NDArray[np.float32]:
    """Return an amplitude image of a random texture."""
    return speckled(300 * np.exp(0.6 * texture(height, width, seed)), looks, speckle_seed)


def whole(image: NDArray[Any]) -> Patch:
    """Return an image as a patch without masked pixels."""
    return Patch(np.asarray(image, np.float32), np.ones(image.shape, bool))


def write_speckled_pair(
    folder: Path, size: tuple[int, int], model: Model, looks: float = LOOKS, **options: Any
) -> TexturedPair:
    """Write a pair of amplitude images; options are those of `write_textured_pair`."""
    pair = write_textured_pair(folder, size, model, noise=0.0, **options)

    def as_radar(seed: int, low: float, high: float) -> Any:
        def change(values: NDArray[Any]) -> NDArray[Any]:
            # The texture has mean 0 and standard deviation 1.
            amplitude = 300 * np.exp(0.6 * (values.astype(float) - low) / high)
            return np.clip(speckled(amplitude, looks, seed), 1, 65_535).astype(np.uint16)

        return change

    changed = rewritten(
        pair, folder, reference=as_radar(1, 1000, 200), input=as_radar(2, 2000, -300)
    )
    return changed
