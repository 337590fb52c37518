"""The models that are fitted to points on the dock's third page, in words."""

from __future__ import annotations

from typing import Any

from .translation import mark, tr
from .wording import choice_label

FIRST_POINTS = mark(
    "There are no points yet. Add a point by a click in each image; three are needed."
)

# Words of models are long: the list shows what they begin with.
_MODELS = {
    "translation": mark("Shift"),
    "rigid": mark("Rigid"),
    "similarity": mark("Similarity"),
    "affine": mark("Affine"),
}

# Models that are fitted to ground control, and the bias of RPCs that they stand for.
BIASES = {"translation": "shift", "affine": "affine"}


def model_text(kind: str, fit: Any) -> str:
    """Return what the list shows for a fitted model."""
    left_out = "–" if fit.left_out_px is None else f"{fit.left_out_px:.2f} px"
    model = tr(_MODELS[kind]) if kind in _MODELS else choice_label(kind)
    return tr("{model}: left-out error {error}").format(model=model, error=left_out)
