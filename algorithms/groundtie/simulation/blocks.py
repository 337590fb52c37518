"""City blocks: positions and heights of their buildings."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .cover import Cover
from .polygons import (
    Point,
    Polygon,
    area,
    contains,
    fitted_rectangle,
    inset,
    main_frame,
    moved,
    rectangle,
    subdivide,
)

HIGHEST_M = 60.0

_ROOF_BOX_M = (2.5, 4.0)
_LOT_M = 22.0


# Parts of a building, later ones drawn over earlier ones: outline in pixels, and height of the roof
# above the ground in metres.
Building = list[tuple[Polygon, float]]

Builder = Callable[[Polygon, float, np.random.Generator], list[Building]]


@dataclass(frozen=True)
class Quarter:
    """A type of city quarter.

    Attributes
    ----------
    share : float
        Share of the districts.
    block_m2 : float
        Area of a block.
    street_m : tuple of float
        Narrowest and widest streets, with pavements.
    build : function
        Returns the buildings of a block from its outline, the pixels per metre and a generator.
    ground : Cover
        Cover between the buildings.
    trees_per_m2 : float
        Trees between the buildings.
    """

    share: float
    block_m2: float
    street_m: tuple[float, float]
    build: Builder
    ground: Cover
    trees_per_m2: float


def perimeter(block: Polygon, scale: float, generator: np.random.Generator) -> list[Building]:
    """Houses side by side around a courtyard."""
    yard = inset(block, generator.uniform(11, 15) * scale)
    if yard is None:
        return lots(block, scale, generator)
    eaves_m = generator.uniform(12, 22)
    buildings = []
    for k in range(len(block)):
        after = (k + 1) % len(block)
        outer, inner = (block[k], block[after]), (yard[k], yard[after])
        count = max(round(math.dist(*outer) / (_LOT_M * scale)), 1)
        cuts = np.linspace(0, 1, count + 1)
        cuts[1:-1] += generator.uniform(-0.25, 0.25, count - 1) / count
        for start, stop in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
            house = [_at(outer, start), _at(outer, stop), _at(inner, stop), _at(inner, start)]
            if generator.random() > 0.04:
                height_m = eaves_m + generator.uniform(-4, 4)
                buildings.append(_with_roof(house, height_m, scale, generator))
    back = fitted_rectangle(yard, (0.5, 0.3))
    if back is not None and generator.random() < 0.5:
        buildings.append([(back, generator.uniform(4, 10))])
    return buildings


def lots(block: Polygon, scale: float, generator: np.random.Generator) -> list[Building]:
    """Densely built lots, mostly of medium height."""
    buildings = []
    for lot in subdivide(block, 1100 * scale**2, 0.0, generator).cells:
        fill = (generator.uniform(0.85, 0.98), generator.uniform(0.85, 0.98))
        footprint = fitted_rectangle(lot, fill)
        if footprint is not None:
            height_m = 8 + 30 * generator.random() ** 2.5
            buildings.append(_with_roof(footprint, height_m, scale, generator))
    return buildings


def towers(block: Polygon, scale: float, generator: np.random.Generator) -> list[Building]:
    """Towers on low podiums."""
    buildings = []
    for lot in subdivide(block, 3600 * scale**2, 0.0, generator).cells:
        footprint = fitted_rectangle(lot, (0.82, 0.82))
        if footprint is None:
            continue
        centre, half, angle = main_frame(footprint)
        podium_m = generator.uniform(5, 14)
        reach = [min(generator.uniform(9, 17) * scale, 0.9 * h) for h in half]
        aside = [generator.uniform(-1, 1) * (h - r) for h, r in zip(half, reach, strict=True)]
        tower = rectangle(moved(centre, aside[0], aside[1], angle), (reach[0], reach[1]), angle)
        height_m = generator.uniform(25, HIGHEST_M - _ROOF_BOX_M[1])
        parts = _with_roof(tower, height_m, scale, generator)
        buildings.append([(footprint, podium_m), *parts])
    return buildings


def slabs(block: Polygon, scale: float, generator: np.random.Generator) -> list[Building]:
    """Parallel apartment slabs, spaced for sunlight."""
    centre, half, angle = main_frame(block)
    height_m = generator.uniform(15, 36)
    depth = generator.uniform(5.5, 7.5) * scale
    pitch = 2 * depth + max(0.8 * height_m, 18) * scale
    buildings = []
    for row in np.arange(-half[1] + 1.4 * depth, half[1] - 1.3 * depth, pitch).tolist():
        reach = min(0.86 * half[0], generator.uniform(24, 45) * scale)
        for side in (-1, 1) if half[0] > 2.2 * reach else (0,):
            middle = moved(centre, side * half[0] / 2, row, angle)
            slab = rectangle(middle, (reach, depth), angle)
            if all(contains(block, corner) for corner in slab):
                high_m = height_m + generator.uniform(-3, 3)
                buildings.append(_with_roof(slab, high_m, scale, generator))
    return buildings


def halls(block: Polygon, scale: float, generator: np.random.Generator) -> list[Building]:
    """Large flat halls and department stores."""
    buildings = []
    for lot in subdivide(block, 5500 * scale**2, 0.0, generator).cells:
        fill = (generator.uniform(0.6, 0.9), generator.uniform(0.6, 0.85))
        footprint = fitted_rectangle(lot, fill)
        if footprint is not None:
            high_m = generator.uniform(6, 16)
            buildings.append(_with_roof(footprint, high_m, scale, generator))
    return buildings


QUARTERS = (
    Quarter(0.36, 10500, (13, 20), perimeter, Cover.PAVEMENT, 1 / 1500),
    Quarter(0.20, 9000, (10, 17), lots, Cover.PAVEMENT, 1 / 2500),
    Quarter(0.15, 10000, (17, 25), towers, Cover.PAVEMENT, 1 / 2000),
    Quarter(0.16, 18000, (13, 20), slabs, Cover.GRASS, 1 / 600),
    Quarter(0.13, 15000, (14, 22), halls, Cover.PAVEMENT, 1 / 2000),
)


def _with_roof(
    outline: Polygon, height_m: float, scale: float, generator: np.random.Generator
) -> Building:
    """A building with stair heads and plant rooms on its flat roof."""
    parts = [(outline, height_m)]
    centre, half, angle = main_frame(outline)
    for _ in range(int(generator.poisson(min(area(outline) / (500 * scale**2), 4)))):
        size = [min(generator.uniform(1.5, 4) * scale, 0.3 * h) for h in half]
        u, v = (generator.uniform(-0.55, 0.55) * h for h in half)
        box = rectangle(moved(centre, u, v, angle), (size[0], size[1]), angle)
        if all(contains(outline, corner) for corner in box):
            parts.append((box, height_m + generator.uniform(*_ROOF_BOX_M)))
    return parts


def _at(side: tuple[Point, Point], share: float) -> Point:
    (x, y), (x1, y1) = side
    return x + share * (x1 - x), y + share * (y1 - y)
