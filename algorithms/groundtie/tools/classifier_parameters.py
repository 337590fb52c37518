"""Parameters of the tools that take classifiers, declared once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ..kinds import FileIn

_INPUT_CLASSIFIER = FileIn(
    label="Classifier for the input",
    help="What train_feature_classifier has written; what it tells to leave out of the input, "
    "clouds for instance, takes no part.",
    suffixes=(".json",),
    advanced=True,
)
InputClassifier = Annotated[Path | None, _INPUT_CLASSIFIER]
PlainInputClassifier = Annotated[Path | None, replace(_INPUT_CLASSIFIER, advanced=False)]
ReferenceClassifier = Annotated[
    Path | None,
    FileIn(
        label="Classifier for the reference",
        help="The same for the reference.",
        suffixes=(".json",),
        advanced=True,
    ),
]
