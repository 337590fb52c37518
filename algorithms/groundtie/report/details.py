"""Chips of both images at full resolution, before and after, at the most informative places."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..assessment.point_errors import PointErrors
from ..geometry.transform import Transform
from ..rasters.grid import FloatArray, Grid, mesh
from ..rasters.pair import ImagePair
from . import pictures

# Side of a chip, in matching pixels: about twenty chips stay well below a megabyte.
SIDE_PX = 128

# Number of best and of worst check points.
_EXTREMES = 2

_CORNERS = ("upper left", "upper right", "lower left", "lower right")


def extremes(error_px: FloatArray, most: int) -> list[tuple[str, int]]:
    """Return labels and indices of the best and the worst check points, at most `most` of each."""
    order = error_px.argsort()
    best, worst = order[:most], order[most:][-most:]
    labels = ["best check point"] * len(best) + ["worst check point"] * len(worst)
    return list(zip(labels, [*best, *worst], strict=True))


def places(errors: PointErrors, grid: Grid) -> list[tuple[str, FloatArray]]:
    """Return labels and positions (col, row): best and worst check points, and the corners."""
    check = np.flatnonzero(errors.check)
    found = [
        (label, errors.position_px[check[k]])
        for label, k in extremes(errors.length_px[check], _EXTREMES)
    ]
    half = min(SIDE_PX, *grid.size) / 2
    corners = mesh((half, grid.width - half), (half, grid.height - half))
    return found + list(zip((f"{name} corner" for name in _CORNERS), corners, strict=True))


def shown(pair: ImagePair, transform: Transform, errors: PointErrors) -> list[dict[str, Any]]:
    """Return the template's values for chips at these places of a pair without masks."""
    grid = pair.grid
    side = min(SIDE_PX, *grid.size)
    made = []
    for label, at in places(errors, grid):
        col, row = (round(float(k) - side / 2) for k in at)
        piece = grid.window(col, row, side, side)
        patches = {
            "reference": pair.reference_patch(piece),
            "input before": pair.input_patch(piece, pair.nominal_px),
            "input after": pair.input_patch(piece, pictures.overview_positions(transform, piece)),
        }
        chips = [
            (name, pictures.jpeg_uri(pictures.grey_picture(patch)))
            for name, patch in patches.items()
        ]
        made.append({"label": label, "at": at, "side": side, "chips": chips})
    return made
