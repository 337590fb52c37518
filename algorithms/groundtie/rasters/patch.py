"""A piece of an image: grey values and which of them count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Patch:
    """Grey values, shape (h, w) float32, and which of them are valid, shape (h, w) bool."""

    values: NDArray[np.float32]
    valid: NDArray[np.bool_]

    @property
    def all_valid(self) -> bool:
        """Whether no pixel is masked."""
        return bool(self.valid.all())

    @property
    def valid_share(self) -> float:
        """Share of valid pixels, 0 to 1."""
        return float(self.valid.mean())

    @property
    def is_flat(self) -> bool:
        """Whether the valid pixels, if any, are all the same."""
        values = self.values[self.valid]
        return values.size == 0 or bool(values.min() == values.max())

    def inner(self, border: int) -> Patch:
        """Return this patch without a border on each side."""
        inside = slice(border, -border or None)
        return Patch(self.values[inside, inside], self.valid[inside, inside])
