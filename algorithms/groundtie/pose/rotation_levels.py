"""Both images at one pixel size, and how well they match at poses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch
from ..similarity.surface import Surface
from .pose import Pose, PoseFound
from .rotation_fields import Field, Template

T = TypeVar("T")
U = TypeVar("U")

# Peaks of one surface that are nearer than this are the same, in pixels of the level.
_SAME_PX = 4

# Inputs are reduced to these steps of scale (log2); what is left of it is interpolated.
_INPUT_STEP = 0.25


@dataclass(frozen=True)
class Level:
    """The fields of both images at one pixel size.

    Parameters
    ----------
    reference
        Field of the reference.
    inputs
        Fields of the input by the scales at which they are as fine as the reference's.
    """

    reference: Field
    inputs: Mapping[float, Field]

    @classmethod
    def of(
        cls,
        reference: Patch,
        input: Patch,
        pixel_px: float,
        scales: Iterable[float],
        executor: Executor | None = None,
    ) -> Level:
        """Return the level for a pixel size in reference pixels; `scales` will be asked for."""
        near = sorted({_near(scale) for scale in scales})
        fields = in_threads(executor, lambda scale: Field.of(input, pixel_px * scale), near)
        return cls(Field.of(reference, pixel_px), dict(zip(near, fields, strict=True)))

    @property
    def pixel_px(self) -> float:
        """Side of the reference's pixels on this level, in reference pixels."""
        return self.reference.pixel_px

    def input(self, scale: float) -> Field:
        """Return the input's field that is as fine as the reference's at a scale, or nearly so."""
        return self.inputs[min(self.inputs, key=lambda known: abs(np.log(known / scale)))]

    def surface(self, template: Template, pose: Pose) -> Surface:
        """Return how well the images match around a pose (see `Template.surface`)."""
        return template.surface(self.input(pose.scale), pose)

    def best(self, template: Template, pose: Pose) -> PoseFound:
        """Return the best shift around a pose."""
        return self.peaks(self.surface(template, pose), pose, np.inf, 1)[0]

    def peaks(self, surface: Surface, pose: Pose, radius_px: float, count: int) -> list[PoseFound]:
        """Return the poses of a surface's highest peaks, best first.

        Parameters
        ----------
        surface
            Matches around `pose`, shape (2 r + 1, 2 r + 1); it is overwritten.
        pose
            What the surface's shifts are added to.
        radius_px
            Largest shift of the poses along rows and columns, in input pixels.
        count
            How many peaks are wanted.
        """
        radius = surface.shape[0] // 2
        linear = pose.linear * self.pixel_px
        if np.isfinite(radius_px):
            surface[~_within(linear, pose.shift_px, radius, radius_px)] = 0
        found = []
        for _ in range(count):
            (x, y), height = _peak(surface)
            shift = linear @ [x, y] + pose.shift_px
            moved = replace(pose, shift_px=(float(shift[0]), float(shift[1])))
            found.append(PoseFound(moved, height, 1))
            if len(found) < count:
                cv2.circle(surface, (round(x) + radius, round(y) + radius), _SAME_PX, 0.0, -1)
        return found


def in_threads(
    executor: Executor | None, call: Callable[[T], U], values: Iterable[T]
) -> Iterable[U]:
    """Return what `call` returns for each value, in order."""
    return map(call, values) if executor is None else executor.map(call, values)


def _near(scale: float) -> float:
    return float(np.exp2(_INPUT_STEP * np.round(np.log2(scale) / _INPUT_STEP)))


def _within(
    linear: NDArray[np.float64], shift_px: tuple[float, float], radius: int, radius_px: float
) -> NDArray[np.bool_]:
    """Tell at which shifts of a surface the input's shift is within limits, to half a pixel."""
    across = np.arange(-radius, radius + 1)
    largest = radius_px + np.sqrt(np.abs(np.linalg.det(linear))) / 2
    return np.logical_and.reduce(
        [
            np.abs(a * across + b * across[:, None] + moved) <= largest
            for (a, b), moved in zip(linear, shift_px, strict=True)
        ]
    )


def _peak(surface: Surface) -> tuple[tuple[float, float], float]:
    """Return shift (x, y) and height of the highest peak, both between the surface's values."""
    radius = surface.shape[0] // 2
    row, col = (int(i) for i in np.unravel_index(surface.argmax(), surface.shape))
    top = float(surface[row, col])
    if not (0 < row < 2 * radius and 0 < col < 2 * radius):
        return (float(col - radius), float(row - radius)), top
    right, above_x = parabola(surface[row, col - 1 : col + 2])
    down, above_y = parabola(surface[row - 1 : row + 2, col])
    return (col - radius + right, row - radius + down), top + above_x + above_y


def parabola(values: Iterable[float]) -> tuple[float, float]:
    """Return where the parabola through three values has its top, and how far above the middle.

    The position is between -0.5 and 0.5 if the middle value is the largest.
    """
    before, middle, after = (float(value) for value in values)
    bend = before - 2 * middle + after
    if bend >= 0:
        return 0.0, 0.0
    return (before - after) / (2 * bend), -((before - after) ** 2) / (8 * bend)
