"""Parameters of the tools that register images by features, declared once."""

from __future__ import annotations

from typing import Annotated

from ..kinds import Choice, Distance, Number
from ..similarity.surface import SIMILARITIES, SimilaritySettings

_NO_REFINEMENT = "none"

FreeSearchRadius = Annotated[
    float | None,
    Distance(
        label="Search radius",
        help="How far the input may lie from its right place. By default 100 m or 20 pixels "
        "of the coarser image, whichever is larger; without georeferencing a quarter of the "
        "input's longer side.",
    ),
]
LargestRatio = Annotated[
    float,
    Number(
        label="Largest ratio",
        help="Largest ratio of the distances to the nearest and to the next best feature of "
        "the input; 1 keeps the nearest one in any case.",
        minimum=0.1,
        maximum=1.0,
        advanced=True,
    ),
]
Gate = Annotated[
    float,
    Number(
        label="Gate",
        help="How far a feature's partner may lie from where the rough search puts it.",
        unit="px",
        minimum=1,
        maximum=64,
        advanced=True,
    ),
]
Refinement = Annotated[
    str,
    Choice(
        label="Refinement",
        help="Similarity by which chips refine what matched features tell; none takes the "
        "features as they are.",
        choices=(_NO_REFINEMENT, *SIMILARITIES),
        advanced=True,
    ),
]
CheckSimilarity = Annotated[
    str,
    Choice(
        label="Similarity",
        help="What the rough shift is searched for and check points are matched by; see "
        "coregister.",
        choices=SIMILARITIES,
        advanced=True,
    ),
]
FreeSearchRotation = Annotated[
    float | None,
    Number(
        label="Largest rotation",
        help="How far the input may be turned, either way, against where it claims to lie. By "
        "default not at all; without georeferencing any rotation.",
        unit="°",
        minimum=0,
        maximum=180,
        advanced=True,
    ),
]


def refinement_settings(refinement: str) -> SimilaritySettings | None:
    """Return the similarity that refines matches; None: they stay where they were found."""
    return None if refinement == _NO_REFINEMENT else SimilaritySettings(refinement)
