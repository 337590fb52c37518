"""Keypoints: their positions, scales, orientations and strengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.rows import Rows
from ..rasters.grid import FloatArray


@dataclass(frozen=True)
class Keypoints(Rows):
    """A table of keypoints, one per row.

    Parameters
    ----------
    position_px
        Position (col, row), pixel centres at integers, shape (n, 2).
    scale_px
        Characteristic scale: standard deviation of the Gaussian with the keypoint's strongest
        response, in pixels, shape (n,).
    orientation_rad
        Direction of the gradients around it, from columns towards rows, shape (n,); 0 for upright
        keypoints.
    response
        Strength of the response, larger is stronger, shape (n,).
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
        """Return at most `count` keypoints with the largest responses, in their order."""
        if len(self) <= count:
            return self
        # The first of equal responses are kept.
        return self.take(np.sort(np.argsort(-self.response, kind="stable")[:count]))
