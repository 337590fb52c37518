"""The ground mask that a registration used."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

# Kinds of masks: none; the ground of a town, found in the radar image of a radar and a camera
# image; the ground between forests and settlements of two radar images; the area that a vector
# layer covers; the ground that both images show according to a surface model.
NONE, GROUND, OPEN = "none", "ground", "open ground"
LAYER, SURFACE = "layer", "surface"

# If less than this share takes part, chips have too few pixels for a joint histogram of their own.
# Up to 42 % of simulated cities is ground, in pixels of 2 m and 3 m. Median errors: 1.3 px with a
# histogram for each chip, 0.5 px with a pooled histogram (suite calibration, class city, 2 m).
LITTLE_SHARE = 0.5

REFERENCE, INPUT = "reference", "input"


@dataclass(frozen=True)
class MaskUsed:
    """The ground mask that was used; masks given by users are recorded with their images.

    Parameters
    ----------
    kind
        `NONE`, `GROUND`, `OPEN`, `LAYER` or `SURFACE`.
    image
        The image that was masked: "reference" or "input"; None without a mask.
    share
        Share of the pixels that take part.
    reason
        The reason for the choice, in a sentence.
    is_reliable
        Whether the image shows the elevated objects of the surface model, if that was used.
    elevated_px
        Common displacement of all points by elevated objects that take part, as far as known: the
        standard deviation along an axis, in matching pixels.
    """

    kind: str
    image: str | None
    share: float
    reason: str
    is_reliable: bool = True
    elevated_px: float = 0.0

    @classmethod
    def none(cls, reason: str, elevated_px: float = 0.0) -> MaskUsed:
        """Return the record of a registration without a mask, with the reason."""
        return cls(NONE, None, 1.0, reason, elevated_px=elevated_px)

    @property
    def is_ground(self) -> bool:
        """Whether only ground takes part, if the mask is right."""
        return self.kind in (GROUND, LAYER, SURFACE)

    @property
    def leaves_little(self) -> bool:
        """Whether too few pixels of a chip take part to match each chip by itself."""
        return self.share < LITTLE_SHARE

    def summary(self) -> dict[str, Any]:
        """Return the mask as values that JSON can carry."""
        return asdict(self)

    def line(self) -> str:
        """Return the mask as a line of text."""
        if self.image is None:
            return f"mask of the ground: {self.kind}, {self.reason}"
        share = f"{self.share:.0%} of the {self.image} take part"
        return f"mask of the ground: {self.kind}, {share}; {self.reason}"
