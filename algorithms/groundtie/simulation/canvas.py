"""A label image to draw parcels into, and shapes that all layouts share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
import numpy.typing as npt

from .cover import Cover, ParcelBook
from .polygons import Point, Polygon, main_frame, moved, points_along, rectangle

Labels = npt.NDArray[np.int32]

_SUBPIXEL_BITS = 4
_PROBES_PER_SIDE = 6


class Acquisition(IntEnum):
    """The acquisition of one of the two images."""

    RADAR = 0
    CAMERA = 1


BOTH = (Acquisition.RADAR, Acquisition.CAMERA)

When = tuple[Acquisition, ...]


@dataclass(frozen=True)
class Standing:
    """An object on the ground.

    Attributes
    ----------
    outline : list of points
        Convex outline in pixels (column, row).
    parcel : int
        Number of its parcel.
    when : tuple of Acquisition
        Acquisitions at which it stands.
    """

    outline: Polygon
    parcel: int
    when: When = BOTH


@dataclass(frozen=True)
class Tree:
    """A tree, which is drawn unless its root is on one of the covers `keep_off`."""

    outline: Polygon
    parcel: int
    root: Point
    keep_off: tuple[Cover, ...]


@dataclass(frozen=True)
class Changes:
    """Draws the buildings that stand at only one acquisition.

    Attributes
    ----------
    share : float
        Share of such buildings: half stand only at the radar's acquisition, half only at the
        camera's.
    generator : numpy.random.Generator
        Source of the changes.
    """

    share: float
    generator: np.random.Generator

    def draw(self) -> When:
        """Draw the acquisitions at which the next building stands."""
        drawn = self.generator.random()
        if drawn >= self.share:
            return BOTH
        return (Acquisition.RADAR,) if drawn < self.share / 2 else (Acquisition.CAMERA,)


@dataclass
class Canvas:
    """Draws parcels: the ground once, the objects on it for each acquisition.

    Attributes
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
        Changes between the acquisitions.
    """

    shape: tuple[int, int]
    px_per_m: float
    generator: np.random.Generator
    book: ParcelBook
    changes: Changes

    def __post_init__(self) -> None:
        """Start with nothing drawn."""
        self.labels: Labels = np.zeros(self.shape, np.int32)
        self._things: list[Standing | Tree] = []
        self._trees: list[Point] = []

    def images(self) -> tuple[Labels, Labels]:
        """Return the label images at the radar's and at the camera's acquisition.

        Returns
        -------
        two int32 arrays (rows, columns)
            Both are the same array if nothing has changed.
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

    def _rotated_outline(self) -> Polygon:
        """Draw a rotated square that covers the scene and gives the direction of streets."""
        height, width = self.labels.shape
        half = math.hypot(height, width) / 2
        angle = self.generator.uniform(0, math.pi / 2)
        return rectangle((width / 2, height / 2), (half, half), angle)

    def _touches(self, outline: Polygon, covers: tuple[Cover, ...]) -> bool:
        """Whether the ground has one of the covers anywhere along an outline."""
        return any(self._cover_at(p) in covers for p in points_along(outline, _PROBES_PER_SIDE))

    def _scatter_trees(self, polygon: Polygon, mean_count: float, share: float = 0.9) -> None:
        """Draw positions of trees in the central `share` of the box around a polygon."""
        centre, half, angle = main_frame(polygon)
        for _ in range(int(self.generator.poisson(mean_count))):
            u, v = (self.generator.uniform(-share, share) * h for h in half)
            self._trees.append(moved(centre, u, v, angle))

    def _plant_trees(
        self, kinds: int, highest_m: float, crown_m: float, keep_off: tuple[Cover, ...]
    ) -> None:
        """Add trees at the drawn positions, with crown radii of `crown_m` to 4 m."""
        parcels = [
            self.book.add(Cover.FOREST, self.generator.uniform(4, highest_m)) for _ in range(kinds)
        ]
        for place in self._trees:
            kind, size = self.generator.random(2).tolist()
            radius = (crown_m + (4.0 - crown_m) * size) * self.px_per_m
            if radius >= 1:
                crown = self._blob(place, radius)
                self._things.append(Tree(crown, parcels[int(kind * kinds)], place, keep_off))

    def _river(self, half_m: Point, bank_m: float) -> tuple[Polygon, Polygon]:
        """Draw the outlines of the banks and of the water of a winding river across the scene."""
        height, width = self.labels.shape
        angle = self.generator.uniform(0, math.pi)
        length = math.hypot(height, width)
        s = np.linspace(-length / 2, length / 2, max(int(length / (8 * self.px_per_m)), 20))
        wave = np.zeros_like(s)
        for wavelength, amplitude in ((900.0, 70.0), (380.0, 28.0), (170.0, 7.0)):
            phase = self.generator.uniform(0, 2 * math.pi)
            wave += amplitude * np.sin(2 * math.pi * s / (wavelength * self.px_per_m) + phase)
        wave = wave * self.px_per_m + self.generator.uniform(-0.2, 0.2) * min(height, width)
        widest = self.generator.uniform(*half_m) * self.px_per_m
        half = widest * (1 + 0.25 * np.sin(s / (60 * self.px_per_m)))

        def outline(reach: npt.NDArray[np.float64]) -> Polygon:
            along = np.concatenate([s, s[::-1]])
            across = np.concatenate([wave - reach, (wave + reach)[::-1]])
            x = width / 2 + along * math.cos(angle) - across * math.sin(angle)
            y = height / 2 + along * math.sin(angle) + across * math.cos(angle)
            return list(zip(x.tolist(), y.tolist(), strict=True))

        return outline(half + bank_m * self.px_per_m), outline(half)

    def _blob(self, centre: Point, radius: float) -> Polygon:
        turn = np.linspace(0, 2 * math.pi, 60, endpoint=False)
        # The phase depends only on the centre, so that the bank runs parallel to the shore.
        wobble = 0.22 * np.sin(2 * turn + centre[0]) + 0.12 * np.sin(3 * turn + centre[1])
        reach = radius * (1 + wobble)
        x, y = centre[0] + reach * np.cos(turn), centre[1] + 0.8 * reach * np.sin(turn)
        return list(zip(x.tolist(), y.tolist(), strict=True))

    def _touches_scene(self, polygon: Polygon) -> bool:
        height, width = self.labels.shape
        x, y = zip(*polygon, strict=True)
        return min(x) < width and max(x) > 0 and min(y) < height and max(y) > 0

    def _cover_at(self, point: Point) -> Cover:
        height, width = self.labels.shape
        column = min(max(round(point[0]), 0), width - 1)
        row = min(max(round(point[1]), 0), height - 1)
        return self.book.cover(self.labels[row, column])

    def _fill(self, polygon: Polygon, label: int, *, convex: bool = True) -> None:
        corners = np.rint(np.array(polygon) * (1 << _SUBPIXEL_BITS)).astype(np.int32)
        if convex:
            cv2.fillConvexPoly(self.labels, corners, label, cv2.LINE_8, _SUBPIXEL_BITS)
        else:
            cv2.fillPoly(self.labels, [corners], label, cv2.LINE_8, _SUBPIXEL_BITS)
