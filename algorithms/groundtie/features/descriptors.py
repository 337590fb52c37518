"""SIFT's descriptor on any gradient: 128 numbers for the surroundings of a keypoint.

Gradients around a keypoint are sampled at positions that rotate and scale with it. The shares of
the samples in the 4 × 4 cells are therefore one constant matrix for all keypoints, which are
described by one product. [Lowe2004]; [Suri2010] appendix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage
from ..similarity.orientation import compress
from .keypoints import Keypoints
from .sampling import sampled_gradient, square_samples, unit_rows
from .scale_space import Gradient, gradients_at_scales

# Cells a side, and directions in each cell ([Lowe2004] 6.1).
CELLS = 4
DIRECTIONS = 8
LENGTH = CELLS * CELLS * DIRECTIONS

# Side of a cell in scales. Width of the Gaussian window in cells: half the descriptor's side
# ([Lowe2004] 6.1).
_CELL_SCALES = 3.0
_WINDOW_CELLS = CELLS / 2

# Samples along a cell's side: they lie closer than a scale, the blur of the image.
_SAMPLES = 4

# Limit of a component before the descriptor is normalised again ([Lowe2004] 6.1).
_LARGEST_COMPONENT = 0.2


@dataclass(frozen=True)
class SiftDescriptor:
    """SIFT's descriptor without assigning orientations: upright keypoints keep the image's axes."""

    def describe(self, window: Patch, found: Keypoints) -> tuple[Keypoints, FloatImage]:
        """Return the n keypoints and their descriptors.

        Parameters
        ----------
        window
            The image; masked pixels add nothing.
        found
            Keypoints in it, shape (n,).

        Returns
        -------
        points, descriptors
            The keypoints and their descriptors of unit length (zero where there is no gradient),
            shape (n, 128) float32: rows and columns of cells, then directions from columns
            towards rows.
        """
        rows = np.empty((len(found), LENGTH), np.float32)
        for which, points, fields in gradients_at_scales(compress(window), window.valid, found):
            rows[which] = sift_rows(fields, points)
        return found, rows


@cache
def _cell_weights() -> tuple[FloatArray, FloatImage]:
    """Return the positions of m samples, in scales, and their shares in the cells, (16, m)."""
    # Cells share their samples with their neighbours, so samples reach half a cell further.
    half = (CELLS + 1) / 2
    samples = square_samples(half, _SAMPLES * (CELLS + 1))
    centres = np.arange(CELLS) - (CELLS - 1) / 2
    x, y = (np.maximum(1 - np.abs(samples[:, axis] - centres[:, None]), 0) for axis in (0, 1))
    window = np.exp(-(samples**2).sum(axis=1) / (2 * _WINDOW_CELLS**2))
    weights = (y[:, None] * x[None] * window).reshape(CELLS * CELLS, -1)
    return samples * _CELL_SCALES, weights.astype(np.float32)


def sift_rows(fields: Gradient, points: Keypoints) -> FloatImage:
    """Return the descriptors of keypoints, given in a gradient's pixels, shape (n, 128)."""
    samples, weights = _cell_weights()
    strength, direction = sampled_gradient(fields, points, samples)
    place = direction * np.float32(DIRECTIONS / (2 * np.pi))
    below = np.floor(place)
    share = place - below
    first = below.astype(np.int32) % DIRECTIONS
    spread = np.zeros((*strength.shape, DIRECTIONS), np.float32)
    for bins, part in ((first, 1 - share), ((first + 1) % DIRECTIONS, share)):
        np.put_along_axis(spread, bins[..., None], (strength * part)[..., None], axis=2)
    raw = np.matmul(weights, spread).reshape(len(points), LENGTH)
    return unit_rows(np.minimum(unit_rows(raw), np.float32(_LARGEST_COMPONENT)))
