"""The support that the similarity surfaces of neighbouring chips give each other."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..similarity.surface import normalise

Surfaces = NDArray[np.float32]

# Neighbours' surfaces are blurred by this before they are added: their shifts differ a little.
_SUPPORT_BLUR_PX = 1.0
_SUPPORT_PASSES = 2


def support(surfaces: Surfaces, centres: NDArray[np.int_], reach_px: float) -> Surfaces:
    """Add to each surface those of its neighbours, so that weak peaks that agree are found.

    Neighbouring places are misregistered by nearly the same shift. Supported surfaces are no
    longer independent of each other: a verdict must not count them.

    Parameters
    ----------
    surfaces
        Shape (n, 2 r + 1, 2 r + 1), in robust standard deviations.
    centres
        The chips' centres, shape (n, 2).
    reach_px
        Distance up to which chips are neighbours.
    """
    if len(surfaces) == 0:
        return surfaces
    pairs = cKDTree(centres).query_pairs(reach_px, output_type="ndarray")
    for _ in range(_SUPPORT_PASSES):
        blurred = np.stack([cv2.GaussianBlur(s, (0, 0), _SUPPORT_BLUR_PX) for s in surfaces])
        total = surfaces.copy()
        np.add.at(total, pairs[:, 0], blurred[pairs[:, 1]])
        np.add.at(total, pairs[:, 1], blurred[pairs[:, 0]])
        surfaces = normalise_each(total)
    return surfaces


def normalise_each(surfaces: Surfaces) -> Surfaces:
    """Return surfaces, shape (n, 2 r + 1, 2 r + 1), each in its robust standard deviations."""
    return np.stack([normalise(s) for s in surfaces]) if len(surfaces) else surfaces
