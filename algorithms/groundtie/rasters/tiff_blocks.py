"""Encoding of a block of pixels in a TIFF file: predictor and compression.

Source: [Adobe1992] section 14, [Adobe2005].
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .metadata import rounded
from .tiff_directories import BLOCK
from .windows import Mask

_NO_PREDICTOR, _DIFFERENCES, _FLOATS = 1, 2, 3

# Complex integers, which numpy lacks, are pairs of these.
_PAIRS = {"complex_int16": "<i2", "complex_int32": "<i4"}


@dataclass(frozen=True)
class PixelType:
    """Type of pixels, in the file and in memory.

    Parameters
    ----------
    name
        rasterio's name of the type.
    memory
        Type in memory.
    """

    name: str
    memory: np.dtype[Any]

    @property
    def predictor(self) -> int:
        """Predictor: none, differences of integers, or differences of the bytes of floats."""
        kind, bits = self.memory.kind, self.memory.itemsize * 8
        if kind == "f":
            return _FLOATS
        return _DIFFERENCES if kind in "iu" and bits < 64 else _NO_PREDICTOR

    def encoded(self, values: NDArray[Any]) -> bytes:
        """Return a block, shape (h, w, samples), at most `BLOCK` high and wide, as stored."""
        values = _whole(values)
        if self.name in _PAIRS:
            parts = np.stack([values.real, values.imag], axis=-1)
            stored = rounded(parts, np.dtype(_PAIRS[self.name]))
        else:
            stored = np.ascontiguousarray(values, self.memory.newbyteorder("<"))
        if self.predictor == _DIFFERENCES:
            stored = _differences(stored.view(f"<u{stored.dtype.itemsize}"))
        elif self.predictor == _FLOATS:
            stored = _split(stored)
        # Differences of images contain only runs of equal bytes: run-length encoding takes half the
        # time of searching for other matches, and the result is no larger.
        strategy = zlib.Z_DEFAULT_STRATEGY if self.predictor == _NO_PREDICTOR else zlib.Z_RLE
        return _compressed(stored, strategy)


def encoded_mask(valid: Mask) -> bytes:
    """Return a block of a mask, shape (h, w), as stored: one bit a pixel."""
    return _compressed(np.packbits(_whole(valid), axis=1), zlib.Z_DEFAULT_STRATEGY)


def _compressed(values: NDArray[Any], strategy: int) -> bytes:
    # The next levels take twice the time and save a few percent.
    compressor = zlib.compressobj(zlib.Z_BEST_SPEED, strategy=strategy)
    return compressor.compress(values.data) + compressor.flush()


def _whole(values: NDArray[Any]) -> NDArray[Any]:
    """Return a block at the image's border extended to full size with values that compress well."""
    height, width = values.shape[:2]
    out = np.zeros((BLOCK, BLOCK, *values.shape[2:]), values.dtype)
    out[:height, :width] = values
    out[:height, width:] = values[:, -1:]
    return out


def _differences(values: NDArray[Any]) -> NDArray[Any]:
    """Return each pixel minus the one left of it, shape (h, w, samples)."""
    out = values.copy()
    out[:, 1:] -= values[:, :-1]
    return out


def _split(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Return rows of floats as byte planes, most significant bytes first, as differences."""
    height, width, samples = values.shape
    parts = values.view(np.uint8).reshape(height, width * samples, -1)
    planes = parts[:, :, ::-1].transpose(0, 2, 1).reshape(height, -1, samples)
    return _differences(np.ascontiguousarray(planes))
