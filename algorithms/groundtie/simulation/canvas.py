"""A label image that parcels are drawn into, and shapes that all layouts share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
import numpy.typing as npt

from .cover import Cover, ParcelBook
from .polygons import Point, Polygon

Labels = npt.NDArray[np.int32]

_SUBPIXEL_BITS = 4


class Acquisition(IntEnum):
    """Which of the two images of a place is taken."""

    RADAR = 0
    CAMERA = 1


BOTH = (Acquisition.RADAR, Acquisition.CAMERA)

When = tuple[Acquisition, ...]


@dataclass(frozen=True)
class Standing:
    """Something on the ground.

    Attributes
    ----------
    outline : list of points
        Convex outline in pixels (column, row).
    parcel : int
        Its number.
    when : tuple of Acquisition
        In which images it stands.
    """

    outline: Polygon
    parcel: int
    when: When = BOTH


@dataclass(frozen=True)
class Tree:
    """A tree, which grows where its root is not on certain covers."""

    outline: Polygon
    parcel: int
    root: Point
    keep_off: tuple[Cover, ...]


@dataclass(frozen=True)
class Changes:
    """Draws which buildings stand in one of the images only.

    Attributes
    ----------
    share : float
        How many of them: half are pulled down after the radar's image, half are new by then.
    generator : numpy.random.Generator or None
        None if the share is 0.
    """

    share: float
    generator: np.random.Generator | None

    def draw(self) -> When:
        """Draw when the next building stands."""
        if self.generator is None:
            return BOTH
        drawn = self.generator.random()
        if drawn >= self.share:
            return BOTH
        return (Acquisition.RADAR,) if drawn < self.share / 2 else (Acquisition.CAMERA,)


NO_CHANGES = Changes(0.0, None)


class Canvas:
    """Draws parcels: the ground at once, what stands on it for each of the images.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the label image.
    px_per_m : float
        Horizontal scale.
    generator : numpy.random.Generator
        Source of the layout.
    book : ParcelBook
        Receives the parcels.
    changes : Changes
        What changes between the images.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        px_per_m: float,
        generator: np.random.Generator,
        book: ParcelBook,
        changes: Changes,
    ) -> None:
        self.labels: Labels = np.zeros(shape, np.int32)
        self._scale = px_per_m
        self._random = generator
        self._book = book
        self._changes = changes
        self._cover_of: list[Cover] = []
        self._things: list[Standing | Tree] = []

    def images(self) -> tuple[Labels, Labels]:
        """Return the label images at the radar's and at the camera's acquisition.

        Returns
        -------
        two int32 arrays (rows, columns)
            One and the same if nothing has changed.
        """
        radar = self._with_things(Acquisition.RADAR)
        if all(isinstance(thing, Tree) or thing.when == BOTH for thing in self._things):
            return radar, radar
        return radar, self._with_things(Acquisition.CAMERA)

    def _with_things(self, acquisition: Acquisition) -> Labels:
        ground = self.labels
        self.labels = ground.copy()
        for thing in self._things:
            if isinstance(thing, Standing):
                if acquisition in thing.when:
                    self._fill(thing.outline, thing.parcel)
            elif self._cover_at(thing.root) not in thing.keep_off:
                self._fill(thing.outline, thing.parcel, convex=False)
        drawn, self.labels = self.labels, ground
        return drawn

    def _stand(self, thing: Standing | Tree) -> None:
        self._things.append(thing)

    def _river(
        self, height: int, width: int, half_m: Point, bank_m: float
    ) -> tuple[Polygon, Polygon]:
        """Outlines of the banks and of the water of a winding river across the scene."""
        angle = self._uniform(0, math.pi)
        length = math.hypot(height, width)
        s = np.linspace(-length / 2, length / 2, max(int(length / (8 * self._scale)), 20))
        wave = np.zeros_like(s)
        for wavelength, amplitude in ((900.0, 70.0), (380.0, 28.0), (170.0, 7.0)):
            phase = self._uniform(0, 2 * math.pi)
            wave += amplitude * np.sin(2 * math.pi * s / (wavelength * self._scale) + phase)
        wave = wave * self._scale + self._uniform(-0.2, 0.2) * min(height, width)
        half = self._uniform(*half_m) * self._scale * (1 + 0.25 * np.sin(s / (60 * self._scale)))

        def outline(reach: npt.NDArray[np.float64]) -> Polygon:
            along = np.concatenate([s, s[::-1]])
            across = np.concatenate([wave - reach, (wave + reach)[::-1]])
            x = width / 2 + along * math.cos(angle) - across * math.sin(angle)
            y = height / 2 + along * math.sin(angle) + across * math.cos(angle)
            return list(zip(x.tolist(), y.tolist(), strict=True))

        return outline(half + bank_m * self._scale), outline(half)

    def _blob(self, centre: Point, radius: float) -> Polygon:
        turn = np.linspace(0, 2 * math.pi, 60, endpoint=False)
        # The outline follows the place, so that the bank runs along the shore.
        wobble = 0.22 * np.sin(2 * turn + centre[0]) + 0.12 * np.sin(3 * turn + centre[1])
        reach = radius * (1 + wobble)
        x, y = centre[0] + reach * np.cos(turn), centre[1] + 0.8 * reach * np.sin(turn)
        return list(zip(x.tolist(), y.tolist(), strict=True))

    def _add(
        self, cover: Cover, height_m: float = 0.0, rows_rad: float = 0.0, window_m: float = 0.0
    ) -> int:
        self._cover_of.append(cover)
        return self._book.add(cover, height_m, rows_rad, window_m)

    def _touches_scene(self, polygon: Polygon) -> bool:
        height, width = self.labels.shape
        x, y = zip(*polygon, strict=True)
        return min(x) < width and max(x) > 0 and min(y) < height and max(y) > 0

    def _cover_at(self, point: Point) -> Cover:
        height, width = self.labels.shape
        column = min(max(round(point[0]), 0), width - 1)
        row = min(max(round(point[1]), 0), height - 1)
        return self._cover_of[self.labels[row, column]]

    def _fill(self, polygon: Polygon, label: int, *, convex: bool = True) -> None:
        corners = np.rint(np.array(polygon) * (1 << _SUBPIXEL_BITS)).astype(np.int32)
        if convex:
            cv2.fillConvexPoly(self.labels, corners, label, cv2.LINE_8, _SUBPIXEL_BITS)
        else:
            cv2.fillPoly(self.labels, [corners], label, cv2.LINE_8, _SUBPIXEL_BITS)

    def _uniform(self, low: float, high: float) -> float:
        return low + (high - low) * float(self._random.random())
