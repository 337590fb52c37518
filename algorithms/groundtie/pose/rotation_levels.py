"""Fields of both images at one pixel size, and their similarity at poses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from operator import attrgetter

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.limits import SearchLimits
from ..rasters.patch import Patch
from ..similarity.peaks import highest_peaks
from ..similarity.surface import Surface
from .pose import Pose, PoseFound
from .rotation_fields import Field, Template

# Peaks of one surface that are nearer than 4 pixels of the level are the same.
_SAME = cv2.circle(np.zeros((9, 9), np.uint8), (4, 4), 4, 1, -1) > 0

# Largest error of a candidate on the next finer level, in pixels of that level; even.
_NEAR_PX = 4

# How often the steps are halved on the finest level, and the largest number of steps of each size.
_HALVINGS = 3
_CLIMBS = 3

HEIGHT = attrgetter("height")

# Inputs are reduced in these steps of scale (log2); the rest of the scale is interpolated.
_INPUT_STEP = 0.25


@dataclass(frozen=True)
class Level:
    """The fields of both images at one pixel size.

    Parameters
    ----------
    reference
        Field of the reference.
    inputs
        Fields of the input, by the scale at which they are as fine as the reference's.
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
        context: Context,
    ) -> Level:
        """Return the level for a pixel size in reference pixels, with fields for `scales`."""
        near = sorted({_near(scale) for scale in scales})
        fields = context.map(lambda scale: Field.of(input, pixel_px * scale), near)
        return cls(Field.of(reference, pixel_px), dict(zip(near, fields, strict=True)))

    @property
    def pixel_px(self) -> float:
        """Side of the reference's pixels on this level, in reference pixels."""
        return self.reference.pixel_px

    def input(self, scale: float) -> Field:
        """Return the input's field that is nearest in fineness to the reference's at a scale."""
        return self.inputs[min(self.inputs, key=lambda known: abs(np.log(known / scale)))]

    def surface(self, template: Template, pose: Pose) -> Surface:
        """Return the similarity surface around a pose (see `Template.surface`)."""
        return template.surface(self.input(pose.scale), pose)

    def best(self, template: Template, pose: Pose) -> PoseFound:
        """Return the best shift around a pose."""
        return self.peaks(self.surface(template, pose), pose, np.inf, 1)[0]

    def peaks(self, surface: Surface, pose: Pose, radius_px: float, count: int) -> list[PoseFound]:
        """Return the poses of a surface's highest peaks, best first.

        Parameters
        ----------
        surface
            Surface around `pose`, shape (2 r + 1, 2 r + 1); it is overwritten.
        pose
            Pose to which the surface's shifts are added.
        radius_px
            Largest shift of the poses along rows and columns, in input pixels.
        count
            Number of peaks.
        """
        radius = surface.shape[0] // 2
        linear = pose.linear * self.pixel_px
        surface[~_within(linear, pose.shift_px, radius, radius_px)] = 0
        found = []
        for row, col in highest_peaks(surface, count, _SAME):
            across, down, height = _between(surface, row, col)
            shift = linear @ [col - radius + across, row - radius + down] + pose.shift_px
            moved = replace(pose, shift_px=(float(shift[0]), float(shift[1])))
            found.append(PoseFound(moved, height))
        return found


@dataclass(frozen=True)
class Climber:
    """Search for better poses nearby, in steps of rotation (degrees) and of log2 of the scale."""

    level: Level
    rotation: float
    scale: float
    limits: SearchLimits

    @cached_property
    def template(self) -> Template:
        return Template(self.level.reference, _NEAR_PX)

    def climb(self, start: PoseFound) -> PoseFound:
        """Return the best of a candidate and its neighbours on this level."""
        return max(self.around(start.pose).values(), key=HEIGHT)

    def climb_finely(self, start: PoseFound) -> PoseFound:
        """Return the best pose near a candidate of this level, between the steps."""
        best, climber = start, self
        for _ in range(_HALVINGS):
            climber = replace(climber, rotation=climber.rotation / 2, scale=climber.scale / 2)
            for _ in range(_CLIMBS):
                tried = climber.around(best.pose)
                centre, best = tried[0, 0], max(tried.values(), key=HEIGHT)
                if best is centre:
                    break
        rotation, scale = (
            parabola([tried[-i, -j].height, best.height, tried[i, j].height])[0]
            if best is centre and {(i, j), (-i, -j)} <= tried.keys()
            else 0.0
            for i, j in ((1, 0), (0, 1))
        )
        between = climber.level.best(climber.template, climber.step(best.pose, rotation, scale))
        return max(best, between, key=HEIGHT)

    def around(self, pose: Pose) -> dict[tuple[int, int], PoseFound]:
        """Return the matches at a pose and its neighbours within the limits, by steps."""
        poses = {(i, j): self.step(pose, i, j) for i, j in product((0, -1, 1), repeat=2)}
        return {
            steps: self.level.best(self.template, near)
            for steps, near in poses.items()
            if steps == (0, 0) or self.is_allowed(near)
        }

    def step(self, pose: Pose, rotation: float, scale: float) -> Pose:
        angle = (pose.rotation_deg + rotation * self.rotation + 180) % 360 - 180
        return replace(pose, rotation_deg=angle, scale=pose.scale * 2 ** (scale * self.scale))

    def is_allowed(self, pose: Pose) -> bool:
        low, high = self.limits.scale
        return abs(pose.rotation_deg) <= self.limits.rotation_deg and low <= pose.scale <= high


def _near(scale: float) -> float:
    return float(np.exp2(_INPUT_STEP * np.round(np.log2(scale) / _INPUT_STEP)))


def _within(
    linear: NDArray[np.float64], shift_px: tuple[float, float], radius: int, radius_px: float
) -> NDArray[np.bool_]:
    """Return the shifts of a surface at which the input's is within limits, to half a pixel."""
    across = np.arange(-radius, radius + 1)
    largest = radius_px + np.sqrt(np.abs(np.linalg.det(linear))) / 2
    return np.logical_and.reduce(
        [
            np.abs(a * across + b * across[:, None] + moved) <= largest
            for (a, b), moved in zip(linear, shift_px, strict=True)
        ]
    )


def _between(surface: Surface, row: int, col: int) -> tuple[float, float, float]:
    """Return the sub-pixel offset (x, y) of a peak from the highest value, and its height."""
    top, last = float(surface[row, col]), surface.shape[0] - 1
    if not (0 < row < last and 0 < col < last):
        return 0.0, 0.0, top
    right, above_x = parabola(surface[row, col - 1 : col + 2])
    down, above_y = parabola(surface[row - 1 : row + 2, col])
    return right, down, top + above_x + above_y


def parabola(values: Iterable[float]) -> tuple[float, float]:
    """Return the vertex of the parabola through three values, and its height above the middle one.

    The position is between -0.5 and 0.5 if the middle value is the largest.
    """
    before, middle, after = (float(value) for value in values)
    bend = before - 2 * middle + after
    if bend >= 0:
        return 0.0, 0.0
    return (before - after) / (2 * bend), -((before - after) ** 2) / (8 * bend)
