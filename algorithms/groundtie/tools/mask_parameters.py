"""Parameters of the tools that mask the radar image, declared once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..kinds import Choice, VectorIn
from ..masks.choice import MASKS
from ..registration.masking import MASK_IMAGES

Mask = Annotated[
    str,
    Choice(
        label="Mask",
        help="What takes part, for scenes with high buildings, which lean over their "
        "surroundings: threshold leaves out what shines in the radar image, regions all "
        "but homogeneous ground: roads, waters, squares; auto chooses by what the image shows.",
        choices=MASKS,
        advanced=True,
    ),
]
MaskImage = Annotated[
    str,
    Choice(
        label="Image that is masked",
        help="The radar's; by default it is told by its metadata or its speckle.",
        choices=MASK_IMAGES,
        advanced=True,
    ),
]
MaskLayer = Annotated[
    Path | None,
    VectorIn(
        label="Layer that is the mask",
        help="Vector layer of what lies on the ground, as roads and waters: of the reference, "
        "nothing else takes part. Polygons, and lines as wide as told below.",
        advanced=True,
    ),
]
