"""Keypoints: where they are, how large, which way they point and how strong they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.rows import Rows
from ..rasters.grid import FloatArray


@dataclass(frozen=True)
class Keypoints(Rows):
    """A table of keypoints, one row a keypoint.

    Parameters
    ----------
    position_px
        Position (col, row), pixel centres at integers, shape (n, 2).
    scale_px
        Characteristic scale: standard deviation of the Gaussian at which the keypoint stands out
        most, in pixels, shape (n,).
    orientation_rad
        Direction of the gradients around it, from columns towards rows, shape (n,); 0 for upright
        ones.
    response
        How far it stands out; larger is stronger, shape (n,).
    """

    position_px: FloatArray
    scale_px: FloatArray
    orientation_rad: FloatArray
    response: FloatArray

    @classmethod
    def none(cls) -> Keypoints:
        """Return an empty table."""
        nothing = np.zeros(0)
        return cls(np.zeros((0, 2)), nothing, nothing, nothing)

    def strongest(self, count: int) -> Keypoints:
        """Return at most so many keypoints: those with the largest response, in their order."""
        if len(self) <= count:
            return self
        # Among equals the first are kept.
        return self.take(np.sort(np.argsort(-self.response, kind="stable")[:count]))
