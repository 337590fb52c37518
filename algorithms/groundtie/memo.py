"""A cache of results by the content of the arrays that they are computed from."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


class Memo:
    """Keeps results by the content of the arrays that they are computed from.

    The origin of arrays does not matter: equal arrays are the same. Once the cache is full, nothing
    more is kept, and nothing is dropped: in a constant order of requests, results would be dropped
    just before they are requested again.

    Parameters
    ----------
    most_bytes
        Memory that the results may take.
    """

    def __init__(self, most_bytes: int) -> None:
        self._left = most_bytes
        self._kept: dict[bytes, Any] = {}

    def recall(self, make: Callable[[], T], size_bytes: int, *arrays: NDArray[Any]) -> T:
        """Return what `make` returns, or has returned before for equal arrays.

        Parameters
        ----------
        make
            Computes the result from nothing but the arrays.
        size_bytes
            Memory that the result takes.
        arrays
            The arrays, always of the same types.
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
