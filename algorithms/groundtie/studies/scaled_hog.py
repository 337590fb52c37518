"""HOG on patches that grow with their keypoints, and may rotate with them ([Patel2017] 4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..features.hog import CELLS, PATCH_PX, directed_shares, weights_along
from ..features.keypoints import Keypoints
from ..features.sampling import sampled_gradient, square_lattice, unit_rows
from ..features.scale_space import Gradient
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage
from ..similarity.orientation import compress
from .orientation import describe_at_scales

# A patch has a sample every so many scales: it is as wide as SURF's descriptor.
_SAMPLE_SCALES = 0.5


@dataclass(frozen=True)
class ScaledHogDescriptor:
    """How keypoints are described.

    Parameters
    ----------
    directions
        Number of directions from 0° to 180°; descriptors have 9 times as many values.
    upright
        Whether keypoints keep the image's axes; else each is rotated by its own orientation, and
        one with several is repeated.
    """

    directions: int = 9
    upright: bool = True

    @property
    def length(self) -> int:
        """How many values a descriptor has."""
        return CELLS * CELLS * self.directions

    def describe(self, window: Patch, found: Keypoints) -> tuple[Keypoints, FloatImage]:
        """Return m keypoints, m ≥ n unless upright, and their descriptors, shape (m, length)."""
        return describe_at_scales(
            compress(window),
            window.valid,
            found,
            self._described,
            self.length,
            self.upright,
        )

    def _described(self, fields: Gradient, points: Keypoints) -> FloatImage:
        """Return the descriptors of keypoints in pixels of the gradient."""
        lattice = square_lattice(_SAMPLE_SCALES * PATCH_PX / 2, PATCH_PX)
        strength, direction = sampled_gradient(fields, points, lattice)
        weights = np.kron(weights_along(), weights_along())
        values = np.empty((len(points), CELLS * CELLS, self.directions), np.float32)
        for number, share in enumerate(directed_shares(strength, direction, self.directions)):
            values[:, :, number] = share @ weights
        return unit_rows(values.reshape(len(points), self.length))
