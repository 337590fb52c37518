"""Pairs of windows of one texture, opposite in contrast, one of which has a pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates
from textured_pairs import texture

from groundtie.pose.pose import Pose
from groundtie.rasters.grid import apply_affine
from groundtie.rasters.patch import Patch

# The texture goes on beyond the reference, so that a turned input is filled to its corners.
_CANVAS_PX = 700


def patch(values: NDArray[np.floating], valid: NDArray[np.bool_] | None = None) -> Patch:
    """Return a patch; all of it is valid unless told otherwise."""
    return Patch(
        np.asarray(values, np.float32), np.ones(values.shape, bool) if valid is None else valid
    )


def turned_pair(
    pose: Pose,
    reference: tuple[int, int] = (150, 160),
    input: tuple[int, int] = (170, 150),
    noise: float = 0.3,
    seed: int = 0,
    input_seed: int | None = None,
) -> tuple[Patch, Patch]:
    """Return a reference and an input with a pose; `input_seed` makes it show another place."""
    rng = np.random.default_rng(seed + 1000)
    canvas = texture(_CANVAS_PX, _CANVAS_PX, seed)
    height, width = reference
    top, left = (_CANVAS_PX - height) // 2, (_CANVAS_PX - width) // 2
    shown = canvas[top : top + height, left : left + width]
    if input_seed is not None:
        canvas = texture(_CANVAS_PX, _CANVAS_PX, input_seed)
    # Pixels larger than the texture's see it averaged.
    canvas = gaussian_filter(canvas, 0.5 * np.sqrt(max(1 / pose.scale**2 - 1, 0)))
    rows, cols = np.mgrid[: input[0], : input[1]]
    px = np.column_stack([cols.ravel(), rows.ravel()])
    across, down = apply_affine(~pose.between(reference, input), px).T
    seen = map_coordinates(canvas, [down + top, across + left], order=3, mode="nearest")
    seen = seen.reshape(input)
    return (
        patch(1000 + 200 * (shown + noise * rng.normal(size=shown.shape))),
        patch(2000 - 300 * (seen + noise * rng.normal(size=seen.shape))),
    )


def error_px(found: Pose, truth: Pose, reference: Patch, input: Patch) -> float:
    """Return the root mean square error of a pose over the reference, in reference pixels."""
    rows, cols = reference.values.shape
    px = np.stack(np.meshgrid(np.linspace(0, cols - 1, 9), np.linspace(0, rows - 1, 9)), -1)
    places = [
        apply_affine(pose.between((rows, cols), input.values.shape[:2]), px)
        for pose in (found, truth)
    ]
    return float(np.sqrt(((places[0] - places[1]) ** 2).sum(axis=1).mean()) / truth.scale)
