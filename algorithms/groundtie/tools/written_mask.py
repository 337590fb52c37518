"""What tools that write a mask return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class WrittenMask:
    """A mask that was written.

    Parameters
    ----------
    share
        Share of the pixels that take part.
    numbers
        What else is known of it, by name; None: there is none.
    words
        The same in words.
    asked
        The files, by name; None: not asked for.
    """

    share: float
    numbers: Mapping[str, Any]
    words: str
    asked: Mapping[str, Path | None]

    @property
    def files(self) -> dict[str, str]:
        """What was written, by name."""
        return {name: str(path) for name, path in self.asked.items() if path is not None}

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {"share": self.share, **self.numbers, "files": self.files}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return [
            f"{self.share:.1%} of the pixels take part; {self.words}",
            *(f"{name}: {path}" for name, path in self.files.items()),
        ]
