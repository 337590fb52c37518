"""Texts on the dock's third page about the points and the models fitted to them."""

from __future__ import annotations

from typing import Any

from .library import library_module
from .translation import mark, tr
from .wording import choice_label

# The tolerance of the verdict.
_TOLERANCE_PX = library_module("geometry.judging").TOLERANCE_PX

FIRST_POINTS = mark(
    "There are no points yet. Add a point by a click in each image; three are needed."
)

# Short names of models for the list.
_MODELS = {
    "translation": mark("Shift"),
    "rigid": mark("Rigid"),
    "similarity": mark("Similarity"),
    "affine": mark("Affine"),
}

# Models that are fitted to ground control, and the RPC bias that each represents.
BIASES = {"translation": "shift", "affine": "affine"}


def model_text(kind: str, fit: Any) -> str:
    """Return the list entry for a fitted model."""
    left_out = "–" if fit.left_out_px is None else f"{fit.left_out_px:.2f} px"
    model = tr(_MODELS[kind]) if kind in _MODELS else choice_label(kind)
    return tr("{model}: left-out error {error}").format(model=model, error=left_out)


def points_text(review: Any, fit: Any) -> str:
    """Return the numbers of used points and of check points that agree with a fitted model."""
    points = review.points
    edited = int(review.points.edited.sum())
    used = tr("{used} of {all} points take part")
    parts = [used.format(used=int(points.used.sum()), all=len(points))]
    parts += [tr("{} set by hand").format(edited)] if edited else []
    check = points.is_check & points.used
    if fit is not None and check.any():
        agree = int((fit.residuals_px[check] <= _TOLERANCE_PX).sum())
        agreeing = tr("{agree} of {all} check points agree within {limit} px")
        limit = f"{_TOLERANCE_PX:g}"
        parts.append(agreeing.format(agree=agree, all=check.sum(), limit=limit))
    return ", ".join(parts) + "."
