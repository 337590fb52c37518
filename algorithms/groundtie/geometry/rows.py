"""Tables of arrays with one row for each tie point, keypoint or match."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from typing import Self  # Python 3.11; annotations alone need it


@dataclass(frozen=True)
class Rows:
    """A table: the arrays among a dataclass's fields are its columns, shape (n, …) each."""

    def __len__(self) -> int:
        return len(next(iter(self._columns.values())))

    def take(self, which: Any) -> Self:
        """Return the rows that the index or mask `which` selects."""
        return replace(self, **{name: values[which] for name, values in self._columns.items()})

    @classmethod
    def concatenate(cls, tables: Sequence[Self]) -> Self:
        """Return the rows of all tables in order; all other fields are those of the first table."""
        first = tables[0]
        names = first._columns
        return replace(
            first, **{name: np.concatenate([getattr(t, name) for t in tables]) for name in names}
        )

    @property
    def _columns(self) -> dict[str, NDArray[Any]]:
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
