"""Skeletons of regions: lines one pixel wide that keep the regions' connections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rasters.reading import Mask

# Neighbours in clockwise order from the one above, as (down, right).
_CIRCLE = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))

# Number of neighbours in each of the 256 neighbourhoods.
_NEIGHBOURS = np.array([code.bit_count() for code in range(256)])


def _removable(second: bool) -> NDArray[np.bool_]:
    """Return for each of the 256 neighbourhoods whether a subiteration may remove its centre."""
    p = [(np.arange(256) >> k) & 1 for k in range(8)]
    rises = np.sum([(p[k] == 0) & (p[(k + 1) % 8] == 1) for k in range(8)], axis=0)
    above, right, below, left = p[0], p[2], p[4], p[6]
    if second:
        corner = (above * right * left == 0) & (above * below * left == 0)
    else:
        corner = (above * right * below == 0) & (right * below * left == 0)
    return np.asarray((_NEIGHBOURS >= 2) & (_NEIGHBOURS <= 6) & (rises == 1) & corner)


_TABLES = (_removable(False), _removable(True))


def skeleton(mask: Mask) -> Mask:
    """Thin a mask to lines [Zhang1984].

    Only the current border is examined, so that each pixel is visited only a few times.

    Parameters
    ----------
    mask
        Shape (h, w).

    Returns
    -------
    Bool, shape (h, w): a part of the mask.
    """
    lines = _Lines.of(mask)
    inside = np.nonzero(lines.image)[0]
    border = inside[lines.neighbourhood(inside) != 255]
    quiet = 0
    while quiet < 2:
        for table in _TABLES:
            gone = border[table[lines.neighbourhood(border)]]
            lines.image[gone] = 0
            quiet = 0 if len(gone) else quiet + 1
            uncovered = (gone[:, None] + lines.around).ravel()
            border = np.concatenate([border, uncovered])
            border = np.unique(border[lines.image[border] > 0])
    return lines.mask


def pruned(skeleton: Mask, length_px: int) -> Mask:
    """Return a skeleton with its lines shortened by some pixels at their free ends.

    This removes spurs up to this length, which arise at every irregularity of a border.
    """
    lines = _Lines.of(skeleton)
    left = np.nonzero(lines.image)[0]
    for _ in range(length_px):
        neighbours = _NEIGHBOURS[lines.neighbourhood(left)]
        lines.image[left[neighbours <= 1]] = 0
        left = left[neighbours > 1]
    return lines.mask


@dataclass(frozen=True)
class _Lines:
    """A flattened image with a border of 0, and the offsets to a pixel's neighbours."""

    image: NDArray[np.uint8]
    around: NDArray[np.int64]
    shape: tuple[int, int]

    @classmethod
    def of(cls, mask: Mask) -> _Lines:
        padded = np.pad(mask, 1).astype(np.uint8)
        around = np.array([down * padded.shape[1] + right for down, right in _CIRCLE])
        return cls(padded.ravel(), around, padded.shape)

    def neighbourhood(self, at: NDArray[np.intp]) -> NDArray[np.int64]:
        """Return the neighbours of given pixels as bits in the order of `_CIRCLE`."""
        code = np.zeros(len(at), np.int64)
        for k, offset in enumerate(self.around):
            code |= self.image[at + offset].astype(np.int64) << k
        return code

    @property
    def mask(self) -> Mask:
        return np.asarray(self.image.reshape(self.shape)[1:-1, 1:-1] > 0)
