"""Parameters of the tools that register images by features, declared once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ..features.classifier import FeatureClassifier, read_classifier
from ..kinds import Choice, Distance, FileIn, Number
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
        help="Similarity by which chips around matched features refine their places; none "
        "leaves them where they were found.",
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
_INPUT_CLASSIFIER = FileIn(
    label="Classifier for the input",
    help="What train_feature_classifier has written; features of the input that it tells to leave "
    "out, those of clouds for instance, take no part.",
    suffixes=(".json",),
    advanced=True,
)
InputClassifier = Annotated[Path | None, _INPUT_CLASSIFIER]
PlainInputClassifier = Annotated[Path | None, replace(_INPUT_CLASSIFIER, advanced=False)]
ReferenceClassifier = Annotated[
    Path | None,
    FileIn(
        label="Classifier for the reference",
        help="The same for features of the reference.",
        suffixes=(".json",),
        advanced=True,
    ),
]


def classifiers(
    reference: Path | None, input: Path | None
) -> tuple[FeatureClassifier | None, FeatureClassifier | None]:
    """Return what tells which features of reference and input may be matched; None: all."""
    there, here = (None if path is None else read_classifier(path) for path in (reference, input))
    return there, here


def refinement_settings(refinement: str) -> SimilaritySettings | None:
    """Return the similarity that refines matches; None: they stay where they were found."""
    return None if refinement == _NO_REFINEMENT else SimilaritySettings(refinement)
