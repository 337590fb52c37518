"""Windows of one image in a known relative pose: rotation, scale and shift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from groundtie.pose.pose import Pose
from groundtie.rasters.grid import mesh
from groundtie.rasters.kernels import interpolate
from groundtie.rasters.patch import Patch

Image = NDArray[np.float32]

# The input's corners that the reference's window does not cover: more of the ground; black and
# masked; black and unmasked ([Patel2017]).
WHOLE = "whole"
MASKED = "black corners, masked"
BLACK = "black corners"
CORNERS = (WHOLE, MASKED, BLACK)


@dataclass(frozen=True)
class Injection:
    """A pose between two windows of an image, and the degradations.

    Parameters
    ----------
    pose
        Pose of the input relative to the reference.
    corners
        One of `CORNERS`.
    noise_variance
        Variance of the Gaussian noise that is added to both, for grey values 0 to 1.
    seed
        Seed of the noise.
    """

    pose: Pose
    corners: str = WHOLE
    noise_variance: float = 0.0
    seed: int = 0

    def windows(self, image: Image, shape: tuple[int, int]) -> tuple[Patch, Patch]:
        """Return reference and input; the reference is the middle of the image, without resampling.

        Parameters
        ----------
        image
            Grey values 0 to 1, shape (h, w).
        shape
            Rows and columns of the reference; the input has `scale` times as many.
        """
        top, left = ((n - m) // 2 for n, m in zip(image.shape, shape, strict=True))
        reference = image[top : top + shape[0], left : left + shape[1]]
        size = [max(round(side * self.pose.scale), 1) for side in shape]
        on_image = ~self.pose.between(shape, (size[0], size[1]))
        rows, cols = np.indices(size, float)
        px = np.stack(
            [
                on_image.a * cols + on_image.b * rows + on_image.c + left,
                on_image.d * cols + on_image.e * rows + on_image.f + top,
            ]
        )
        finest = self.pose.scale
        if finest < 1:
            # Remove the detail that the input's larger pixels cannot resolve.
            image = gaussian_filter(image, 0.5 * np.sqrt(1 / finest**2 - 1))
        low, high = (0, 0), image.shape[::-1]
        if self.corners != WHOLE:
            low, high = (left, top), (left + shape[1], top + shape[0])
        inside = np.logical_and.reduce(
            [(a >= first) & (a <= last - 1) for a, first, last in zip(px, low, high, strict=True)]
        )
        input = np.where(inside, interpolate(image, px, "lanczos"), np.float32(0))
        random = np.random.default_rng(self.seed)
        known = np.ones_like(inside) if self.corners == BLACK else inside
        return (
            Patch(self._spoilt(reference, random), np.ones(shape, bool)),
            Patch(np.where(inside, self._spoilt(input, random), np.float32(0)), known),
        )

    def _spoilt(self, image: Image, random: np.random.Generator) -> Image:
        noise = random.normal(0, np.sqrt(self.noise_variance), image.shape)
        return np.clip(image + noise, 0, 1).astype(np.float32)


def unit_range(bands: NDArray[np.generic]) -> Image:
    """Return the mean of bands, shape (bands, h, w), scaled to 0 to 1 with clipped extremes."""
    grey = bands.astype(np.float32).mean(axis=0)
    low, high = np.percentile(grey, (0.1, 99.9))
    return np.clip((grey - low) / (high - low), 0, 1).astype(np.float32)


def pose_errors(found: Pose, truth: Pose, shape: Sequence[int]) -> tuple[float, float]:
    """Return the error of the rotation in degrees, and the root mean square error in pixels.

    The latter is taken over a whole reference of the given shape, in its pixels.
    """
    turned = abs((found.rotation_deg - truth.rotation_deg + 180) % 360 - 180)
    sides = [np.linspace(-0.5, 0.5, 21) * n for n in shape[::-1]]
    px = mesh(*sides)
    shift = np.subtract(found.shift_px, truth.shift_px)
    off = px @ (found.linear - truth.linear).T + shift
    return turned, float(np.sqrt((off**2).sum(axis=1).mean())) / truth.scale
