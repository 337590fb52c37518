"""Rotation, scale and shift between two images, and the candidates of a search for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from affine import Affine
from numpy.typing import NDArray


@dataclass(frozen=True)
class Pose:
    """Pose of an image relative to another: rotation and scale about its centre, then a shift.

    A point that lies (x, y) pixels right of and below the reference's centre lies at
    scale · R (x, y) + shift right of and below the input's centre.

    Parameters
    ----------
    rotation_deg
        Rotation of the input's content relative to the reference's, counter-clockwise as seen on
        the screen.
    scale
        Length of a reference pixel in input pixels.
    shift_px
        (right, down), in input pixels.
    """

    rotation_deg: float = 0.0
    scale: float = 1.0
    shift_px: tuple[float, float] = (0.0, 0.0)

    @property
    def linear(self) -> NDArray[np.float64]:
        """Matrix of rotation and scale in (right, down), shape (2, 2)."""
        cosine, sine = np.cos(np.radians(self.rotation_deg)), np.sin(np.radians(self.rotation_deg))
        return self.scale * np.array([[cosine, sine], [-sine, cosine]])

    def between(self, reference: tuple[int, int], input: tuple[int, int]) -> Affine:
        """Return the affine transform from reference to input pixels of arrays of these shapes.

        Pixel centres are at integers.
        """
        (a, b), (d, e) = self.linear
        centres = [
            np.array([(shape[1] - 1) / 2, (shape[0] - 1) / 2]) for shape in (reference, input)
        ]
        c, f = centres[1] + self.shift_px - self.linear @ centres[0]
        return Affine(a, b, float(c), d, e, float(f))


@dataclass(frozen=True)
class PoseFound:
    """A candidate of a search.

    Parameters
    ----------
    pose
        Pose of the input.
    height
        Height of the peak, in robust standard deviations of its background.
    evaluations
        Number of similarity evaluations until it was found; 0 if the search does not count them.
    """

    pose: Pose
    height: float
    evaluations: int = 0
