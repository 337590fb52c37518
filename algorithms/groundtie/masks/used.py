"""Which mask of the ground a registration used."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

# Kinds of masks: none, the ground of a town that its radar image shows beside a camera's, the
# ground between forests and settlements of two radar images, what a vector layer covers, and the
# ground that both images show by a surface model.
NONE, GROUND, OPEN = "none", "ground", "open ground"
LAYER, SURFACE = "layer", "surface"

# Where less than this share takes part, chips have too few pixels for a joint histogram of their
# own. Of simulated cities up to 42 % is ground, in pixels of 2 m and 3 m: each chip by itself was
# 1.3 px off (median), one histogram of all 0.5 px (suite calibration, class city, 2 m).
_LITTLE = 0.5

REFERENCE, INPUT = "reference", "input"


@dataclass(frozen=True)
class MaskUsed:
    """The mask of the ground that was used; what users mask besides is noted at their images.

    Parameters
    ----------
    kind
        `NONE`, `GROUND`, `OPEN`, `LAYER` or `SURFACE`.
    image
        Which image was masked: "reference" or "input"; None without a mask.
    share
        Share of the pixels that take part.
    reason
        Why, in a sentence.
    is_reliable
        Whether the image shows the elevated objects of the surface model, if that was used.
    elevated_px
        What elevated objects among what takes part displace all points alike by, as far as that is
        known: the standard deviation along an axis, in matching pixels.
    """

    kind: str
    image: str | None
    share: float
    reason: str
    is_reliable: bool = True
    elevated_px: float = 0.0

    @classmethod
    def none(cls, reason: str, elevated_px: float = 0.0) -> MaskUsed:
        """Return that no mask was used, and why."""
        return cls(NONE, None, 1.0, reason, elevated_px=elevated_px)

    @property
    def is_ground(self) -> bool:
        """Whether nothing but ground takes part, as far as the mask is right."""
        return self.kind in (GROUND, LAYER, SURFACE)

    @property
    def leaves_little(self) -> bool:
        """Whether chips of what takes part are too poor to be matched each by itself."""
        return self.share < _LITTLE

    def summary(self) -> dict[str, Any]:
        """Return the mask as values that JSON can carry."""
        return asdict(self)

    def line(self) -> str:
        """Return the mask as a line of text."""
        if self.image is None:
            return f"mask of the ground: {self.kind}, {self.reason}"
        share = f"{self.share:.0%} of the {self.image} take part"
        return f"mask of the ground: {self.kind}, {share}; {self.reason}"
