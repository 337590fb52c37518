"""Parameters of the tools that match an image with RPCs with a reference, declared once."""

from __future__ import annotations

from typing import Annotated

from ..kinds import Band, Choice, Distance, Number
from ..masks.choice import MASKS
from ..similarity.surface import SIMILARITIES

SearchRadius = Annotated[
    float | None,
    Distance(
        label="Search radius",
        help="How far the RPCs may be wrong on the ground. By default 100 m or 20 pixels of the "
        "coarser image, whichever is larger.",
    ),
]
Similarity = Annotated[
    str,
    Choice(
        label="Similarity",
        help="What tells that two windows show the same place; see coregister.",
        choices=SIMILARITIES,
        advanced=True,
    ),
]
ImageBand = Annotated[
    int | None,
    Band(
        label="Band of the image",
        help="The band that is matched; by default the mean of all bands.",
        of="image",
        advanced=True,
    ),
]
MaskKind = Annotated[
    str,
    Choice(
        label="Mask",
        help="What of the radar reference takes no part: nothing; what is brighter or darker than "
        "thresholds; all but homogeneous ground, for dense towns "
        "(regions); auto chooses by what the image shows.",
        choices=MASKS,
        advanced=True,
    ),
]
TwoWayError = Annotated[
    float,
    Number(
        label="Largest two-way error",
        help="A point is rejected if the match back misses its start by more.",
        unit="px",
        minimum=0,
        maximum=100,
        advanced=True,
    ),
]
