"""The picture of the result of `estimate_rotation`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..context import Context
from ..geometry.limits import SearchLimits
from ..pose.pose import Pose
from ..pose.search import scan, shift_surface
from ..rasters.atomic import write_figure
from ..rasters.patch import Patch
from .pictures import grey_picture

# Squares along the longer side of the checkerboard.
_SQUARES = 8


def draw_rotation(
    path: Path,
    reference: Patch,
    input: Patch,
    limits: SearchLimits,
    pose: Pose | None,
    title: str,
    context: Context,
) -> None:
    """Draw the similarity of all rotations, scales and shifts, and both images, as a PNG.

    Parameters
    ----------
    path
        The file.
    reference, input
        The windows.
    limits
        Rotations and scales that are shown.
    pose
        The pose that was found; None if none was.
    title
        Heading of the picture.
    context
        Threads to work in.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 9))
    figure.set_layout_engine("constrained", wspace=0.08)
    axes = figure.subplots(2, 2)
    figure.suptitle(title)
    _draw_scan(figure, axes[0, 0], reference, input, limits, pose, context)
    _draw_image(axes[1, 0], grey_picture(reference), "reference")
    if pose is None:
        axes[0, 1].set_axis_off()
        _draw_image(axes[1, 1], grey_picture(input), "input")
    else:
        _draw_shifts(figure, axes[0, 1], reference, input, pose, context)
        _draw_image(
            axes[1, 1], checkerboard(reference, input, pose), "reference and input, in squares"
        )
    write_figure(path, figure, 110)


def checkerboard(reference: Patch, input: Patch, pose: Pose) -> NDArray[np.uint8]:
    """Return alternate squares of the reference and of the input placed by a pose."""
    rows, cols = reference.values.shape
    to_input: Affine = pose.between((rows, cols), input.values.shape[:2])
    matrix = np.array([[to_input.a, to_input.b, to_input.c], [to_input.d, to_input.e, to_input.f]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    values: NDArray[np.float32] = np.asarray(
        cv2.warpAffine(input.values, matrix, (cols, rows), flags=flags), np.float32
    )
    valid = cv2.warpAffine(input.valid.astype(np.float32), matrix, (cols, rows), flags=flags) > 0.99
    side = max(rows, cols) / _SQUARES
    down, across = np.ogrid[:rows, :cols]
    odd = (down // side + across // side) % 2 == 1
    return np.where(odd, grey_picture(Patch(values, valid)), grey_picture(reference))


def _draw_scan(
    figure: Any,
    axes: Any,
    reference: Patch,
    input: Patch,
    limits: SearchLimits,
    pose: Pose | None,
    context: Context,
) -> None:
    scanned = scan(reference, input, limits, context)
    rotations, scales = scanned.rotations_deg, np.log2(scanned.scales)
    extent = (*_ends(rotations), *_ends(scales))
    shown = axes.imshow(
        scanned.heights, extent=extent, origin="lower", aspect="auto", interpolation="nearest"
    )
    figure.colorbar(shown, ax=axes, label="height of the best shift")
    if pose is not None:
        place = pose.rotation_deg, np.log2(pose.scale)
        axes.plot(*place, "o", mfc="none", mec="red", ms=14, mew=1.8)
    axes.set(xlabel="rotation (°)", ylabel="log₂ of the scale", title="on small images")


def _draw_shifts(
    figure: Any, axes: Any, reference: Patch, input: Patch, pose: Pose, context: Context
) -> None:
    surface, pixel = shift_surface(reference, input, pose, context)
    edge = surface.shape[0] / 2 * pixel
    shown = axes.imshow(surface, extent=(-edge, edge, edge, -edge), interpolation="nearest")
    figure.colorbar(shown, ax=axes, label="robust standard deviations")
    axes.set(xlabel="to the right (px)", ylabel="downwards (px)", title="further shift")


def _draw_image(axes: Any, picture: NDArray[np.uint8], title: str) -> None:
    axes.imshow(picture, cmap="gray", vmin=0, vmax=255)
    axes.set_title(title)
    axes.set_axis_off()


def _ends(steps: NDArray[np.float64]) -> tuple[float, float]:
    half = float(steps[1] - steps[0]) / 2 if len(steps) > 1 else 0.5
    return float(steps[0]) - half, float(steps[-1]) + half
