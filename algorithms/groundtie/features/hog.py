"""Histograms of oriented gradients as descriptors of keypoints ([Patel2017] 4.3–4.5).

The patch of 41 × 41 pixels around a keypoint is divided into 3 × 3 cells. Each has a histogram of
the directions of gradients, which is invariant to contrast and its sign: 81 values with nine
directions, 63 with seven. [Dalal2005].
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ..rasters.patch import Patch
from ..rasters.reading import FloatImage
from ..similarity.orientation import compress
from .keypoints import Keypoints
from .sampling import unit_rows
from .scale_space import Gradient, gradient_at_scale

PATCH_PX = 41
CELLS = 3

# Scale of the gradients, in pixels.
_SCALE_PX = 2.0

_REACH_PX = PATCH_PX // 2

# Number of keypoints that are described at a time: their patches fit into the last-level cache.
# Number of rows for which directions are spread at a time, so that a band is still in that cache
# when its keypoints are described.
_BLOCK = 64
_BAND_ROWS = 128


@dataclass(frozen=True)
class HogDescriptor:
    """Descriptor of keypoints by upright patches of one size.

    Parameters
    ----------
    directions
        Number of directions from 0° to 180°; descriptors have 9 times as many values.
    """

    directions: int = 9

    def describe(self, window: Patch, found: Keypoints) -> tuple[Keypoints, FloatImage]:
        """Return the n keypoints and their descriptors.

        Parameters
        ----------
        window
            The image; masked pixels add nothing.
        found
            Keypoints in it, shape (n,). Patches are centred on the nearest pixels: half a pixel is
            little in a patch, and pixels that patches share are computed once.

        Returns
        -------
        points, descriptors
            The keypoints and their descriptors of unit length (zero where there is no gradient),
            shape (n, 9 · directions) float32: rows and columns of cells, then directions from
            columns towards rows.
        """
        fields = gradient_at_scale(compress(window), window.valid, _SCALE_PX)
        height, width = fields[0].shape
        cols, rows = np.rint(found.position_px).astype(np.intp).T
        cols, rows = np.clip(cols, 0, width - 1), np.clip(rows, 0, height - 1)
        values = np.empty((len(found), CELLS, CELLS, self.directions), np.float32)
        for first in range(0, height, _BAND_ROWS):
            own = np.nonzero((rows >= first) & (rows < first + _BAND_ROWS))[0]
            if len(own) == 0:
                continue
            band = self._band(fields, first)
            for start in range(0, len(own), _BLOCK):
                block = own[start : start + _BLOCK]
                values[block] = self._in_cells(band, cols[block], rows[block] - first)
        return found, unit_rows(values.reshape(len(found), CELLS * CELLS * self.directions))

    def _band(self, fields: Gradient, first: int) -> FloatImage:
        """Return the shares of all directions at the pixels of the patches in a band of rows.

        Shape (rows, columns, directions); 0 beyond the image, where patches may reach.
        """
        height, width = fields[0].shape
        top, stop = max(first - _REACH_PX, 0), min(first + _BAND_ROWS + _REACH_PX, height)
        along_cols, along_rows = (field[top:stop] for field in fields)
        strength = np.sqrt(along_cols * along_cols + along_rows * along_rows)
        shape = _BAND_ROWS + 2 * _REACH_PX, width + 2 * _REACH_PX, self.directions
        band = np.zeros(shape, np.float32)
        inside = band[top - first + _REACH_PX :][: stop - top, _REACH_PX:-_REACH_PX]
        shares = directed_shares(strength, np.arctan2(along_rows, along_cols), self.directions)
        for number, share in enumerate(shares):
            inside[..., number] = share
        return band

    def _in_cells(
        self, band: FloatImage, cols: NDArray[np.intp], rows: NDArray[np.intp]
    ) -> FloatImage:
        """Return the cells' histograms of patches in a band, shape (n, 3, 3, directions)."""
        # A patch's row holds all directions of its pixels, side by side.
        length = PATCH_PX * self.directions
        patch_rows = sliding_window_view(band.reshape(len(band), -1), length, axis=1)
        down = rows[:, None] + np.arange(PATCH_PX)
        patches = patch_rows[down, cols[:, None] * self.directions]
        weights = weights_along()
        in_rows = (weights.T @ patches).reshape(-1, CELLS, PATCH_PX, self.directions)
        return np.asarray(weights.T @ in_rows)


def directed_shares(
    strength: FloatImage, angle: FloatImage, directions: int
) -> Iterator[FloatImage]:
    """Yield the share of gradients in each direction."""
    count = np.float32(directions)
    place = angle * (count / np.float32(np.pi))
    # Opposite directions are the same: from the first one to where it comes again.
    place -= count * np.floor(place / count)
    for number in range(directions):
        # A gradient between two directions is shared by both.
        away = np.abs(place - np.float32(number))
        if number == 0:
            np.minimum(away, count - place, out=away)
        share = np.maximum(1 - away, 0, out=away)
        share *= strength
        yield share


@cache
def weights_along() -> FloatImage:
    """Return the share of samples along a side of the patch in the cells, shape (41, 3)."""
    # Cells share their samples with their neighbours, as directions do.
    at = (np.arange(PATCH_PX) + 0.5) * CELLS / PATCH_PX - 0.5
    return np.maximum(1 - np.abs(at[:, None] - np.arange(CELLS)), 0).astype(np.float32)
