"""Layout of a scene's parcels: districts, streets, fields, woods, water bodies and buildings.

Parcels are drawn into one label image, later ones over earlier ones: ground, water bodies, arterial
roads (which bridge them), buildings and trees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .canvas import Canvas, Labels, Standing
from .cover import Cover
from .polygons import (
    Polygon,
    fitted_rectangle,
    main_frame,
    moved,
    rectangle,
    subdivide,
)


@dataclass(frozen=True)
class Use:
    """Land use of a district: street width, block and lot area, built share, heights, trees."""

    street_m: float
    block_m2: float
    lot_m2: float
    fill: tuple[float, float]
    height_m: tuple[float, float]
    trees_per_lot: float


FARMLAND = Use(4, 12000, 0, (0, 0), (0, 0), 0)
FOREST = Use(4, 40000, 0, (0, 0), (0, 0), 0)
PARK = Use(4, 9000, 0, (0, 0), (0, 0), 0)
HAMLET = Use(5, 5000, 800, (0.35, 0.55), (3, 8), 1.5)
HOUSES = Use(7, 7000, 620, (0.48, 0.66), (4, 12), 1.2)
DENSE = Use(11, 12000, 2200, (0.92, 1.0), (10, 60), 0.15)

DENSITIES: dict[str, tuple[tuple[Use, float], ...]] = {
    "rural": ((FARMLAND, 0.8), (FOREST, 0.18), (HAMLET, 0.02)),
    "suburban": ((HOUSES, 0.66), (FARMLAND, 0.17), (PARK, 0.09), (FOREST, 0.08)),
    "urban": ((DENSE, 0.94), (PARK, 0.06)),
}

CANOPY_M = (12.0, 24.0)

_DISTRICT_M2 = 70000
_ARTERIAL_M = {"rural": 7.0, "suburban": 12.0, "urban": 18.0}
_FARMSTEAD_CHANCE = 0.5
_LAKE_M2 = 400_000


def highest_object_m(density: str) -> float:
    """Return the greatest possible height of a building or a canopy in a scene."""
    return max(CANOPY_M[1], *(use.height_m[1] for use, _ in DENSITIES[density]))


@dataclass
class Layout(Canvas):
    """Draws the parcels of a rural, suburban or urban scene.

    Attributes
    ----------
    shape, px_per_m, generator, book, changes
        See `Canvas`; `px_per_m` scales the sizes in `Use`.
    density : str
        One of `DENSITIES`.
    """

    density: str

    def __post_init__(self) -> None:
        """Start with nothing drawn."""
        super().__post_init__()
        self._buildings: list[tuple[Polygon, float]] = []

    def draw(self) -> tuple[Labels, Labels]:
        """Draw the whole scene; see `Canvas.images`."""
        self.labels[:] = self.book.add(Cover.GRASS)
        outline = self._rotated_outline()
        arterial = _ARTERIAL_M[self.density] * self.px_per_m
        districts = subdivide(outline, _DISTRICT_M2 * self.px_per_m**2, arterial, self.generator)
        for district in districts.cells:
            if self._touches_scene(district):
                self._draw_district(district)
        self._draw_waters()
        for lane in districts.lanes:
            self._fill(lane, self.book.add(Cover.ROAD))
        self._draw_buildings()
        self._plant_trees(8, 12, 1.5, (Cover.WATER, Cover.ROAD, Cover.BUILDING))
        return self.images()

    def _draw_district(self, district: Polygon) -> None:
        uses, weights = zip(*DENSITIES[self.density], strict=True)
        use: Use = uses[int(np.searchsorted(np.cumsum(weights), self.generator.random()))]
        blocks = subdivide(
            district, use.block_m2 * self.px_per_m**2, use.street_m * self.px_per_m, self.generator
        )
        street = self.book.add(Cover.ROAD)
        for lane in blocks.lanes:
            self._fill(lane, street)
        for block in blocks.cells:
            if use.lot_m2 > 0:
                self._draw_lots(block, use)
            else:
                self._draw_open_block(block, use)
        if use is FARMLAND and self.generator.random() < _FARMSTEAD_CHANCE:
            self._place_farmstead(blocks.cells[0])

    def _draw_open_block(self, block: Polygon, use: Use) -> None:
        _, half, angle = main_frame(block)
        if use is FOREST:
            self._fill(block, self.book.add(Cover.FOREST, self.generator.uniform(*CANOPY_M)))
        elif use is PARK:
            self._fill(block, self.book.add(Cover.GRASS))
            self._scatter_trees(block, half[0] * half[1] / (120 * self.px_per_m**2))
        else:
            self._fill(block, self.book.add(Cover.FIELD, rows_rad=angle + math.pi / 2))

    def _draw_lots(self, block: Polygon, use: Use) -> None:
        ground = Cover.PAVEMENT if use is DENSE else Cover.GRASS
        self._fill(block, self.book.add(ground))
        for lot in subdivide(block, use.lot_m2 * self.px_per_m**2, 0.0, self.generator).cells:
            if ground is Cover.GRASS:
                self._fill(lot, self.book.add(Cover.GRASS))
            fill = (self.generator.uniform(*use.fill), self.generator.uniform(*use.fill))
            footprint = fitted_rectangle(lot, fill)
            if footprint is not None:
                # The exponent makes low buildings common and towers rare.
                share = self.generator.random() ** 2.5
                low, high = use.height_m
                self._buildings.append((footprint, low + (high - low) * share))
            self._scatter_trees(lot, use.trees_per_lot)

    def _place_farmstead(self, field: Polygon) -> None:
        centre, half, angle = main_frame(field)
        for k in range(3):
            u, v = (0.55 - 0.3 * k) * half[0], (0.6 - 0.2 * (k % 2)) * half[1]
            place = moved(centre, u, v, angle)
            size = (
                self.generator.uniform(6, 12) * self.px_per_m,
                self.generator.uniform(4, 7) * self.px_per_m,
            )
            self._buildings.append((rectangle(place, size, angle), self.generator.uniform(4, 8)))
            self._trees.append((place[0] + 1.4 * size[0], place[1] + 1.6 * size[1]))

    def _draw_waters(self) -> None:
        """Draw all banks before all water, so that no bank crosses another water body."""
        height, width = self.labels.shape
        shores = [self._river((6, 14), 5)]
        area_m2 = height * width / self.px_per_m**2
        for _ in range(int(self.generator.poisson(area_m2 / _LAKE_M2))):
            centre = (self.generator.uniform(0, width), self.generator.uniform(0, height))
            radius = self.generator.uniform(20, 70) * self.px_per_m
            shores.append((self._blob(centre, radius * 1.15), self._blob(centre, radius)))
        for bank, _ in shores:
            self._fill(bank, self.book.add(Cover.GRASS), convex=False)
        for _, water in shores:
            self._fill(water, self.book.add(Cover.WATER), convex=False)

    def _draw_buildings(self) -> None:
        for footprint, height_m in self._buildings:
            if not self._touches(footprint, (Cover.WATER,)):
                building = self.book.add(Cover.BUILDING, height_m)
                self._things.append(Standing(footprint, building, self.changes.draw()))
