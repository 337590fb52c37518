"""The kinds of masks, and which one is used."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

NONE, THRESHOLD = "none", "threshold"
MASKS = (NONE, THRESHOLD)

REFERENCE, INPUT = "reference", "input"


@dataclass(frozen=True)
class MaskUsed:
    """The mask that was used.

    Parameters
    ----------
    kind
        One of `MASKS`.
    image
        Which image was masked: "reference" or "input"; None without a mask.
    share
        Share of the pixels that take part.
    reason
        Why, in a sentence.
    """

    kind: str
    image: str | None
    share: float
    reason: str

    def summary(self) -> dict[str, Any]:
        """Return the mask as values that JSON can carry."""
        return asdict(self)

    def line(self) -> str:
        """Return the mask as a line of text."""
        if self.image is None:
            return f"mask: {self.kind}, {self.reason}"
        return f"mask: {self.kind}, {self.share:.0%} of the {self.image} take part; {self.reason}"
