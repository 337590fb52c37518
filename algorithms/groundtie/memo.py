"""Results that are asked for again and again, by what they are made of."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


class Memo:
    """Keeps results by the content of the arrays that they are made of.

    Nothing need be known of where arrays come from: what is equal is the same. Once it is full,
    nothing more is kept, and nothing is dropped: what is always asked for in one order would be
    dropped just before it is asked for again.

    Parameters
    ----------
    most_bytes
        How much the results may take.
    """

    def __init__(self, most_bytes: int) -> None:
        self._left = most_bytes
        self._kept: dict[bytes, Any] = {}

    def recall(self, make: Callable[[], T], size_bytes: int, *arrays: NDArray[Any]) -> T:
        """Return what `make` returns, or has returned before for equal arrays.

        Parameters
        ----------
        make
            Makes the result, of nothing but the arrays.
        size_bytes
            How much the result takes.
        arrays
            What it is made of: of always the same types.
        """
        key = blake2b()
        for array in arrays:
            key.update(repr(array.shape).encode())
            key.update(np.ascontiguousarray(array).data)
        known: T | None = self._kept.get(key.digest())
        if known is not None:
            return known
        made = make()
        if size_bytes <= self._left:
            self._left -= size_bytes
            self._kept[key.digest()] = made
        return made
