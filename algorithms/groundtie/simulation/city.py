"""A dense city: boulevards, streets with cars and trees, blocks, squares, a river, a railway."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .blocks import QUARTERS, Building, Quarter
from .canvas import BOTH, Acquisition, Canvas, Labels, Standing
from .cover import Cover
from .polygons import (
    Point,
    Polygon,
    area,
    main_frame,
    moved,
    rectangle,
    subdivide,
)

CITY = "city"

_DISTRICT_M2 = 90_000
_BOULEVARD_M = (24.0, 30.0)
_KERB_M = 2.5
_OPEN_BLOCK_SHARE = 0.14
_RIVER_CHANCE = 0.7
_RAILWAY_CHANCE = 0.6
_TRAINS = 3
_CAR_M = (4.6, 1.9)
_PARKING_PITCH_M = 6.0
_MOVING_PITCH_M = 22.0
_PARKED_SHARE = 0.45
_TREE_PITCH_M = 14.0
_KINDS = 10
_WINDOW_M = (2.8, 4.5)


@dataclass(frozen=True)
class _Street:
    lane: Polygon
    half_width: float
    trees: bool

    def carriageway(self, kerb: float) -> Polygon:
        """Return the carriageway, which extends into the streets at both ends."""
        centre, half, angle = main_frame(self.lane)
        return rectangle(centre, (half[0] + (kerb + 1), self.half_width - kerb), angle)


@dataclass
class CityLayout(Canvas):
    """Draws the parcels of a dense city.

    Attributes
    ----------
    shape, px_per_m, generator, book, changes
        See `Canvas`.
    traffic : numpy.random.Generator
        Source of cars and trains, which differ between the acquisitions.
    """

    traffic: np.random.Generator

    def __post_init__(self) -> None:
        """Start with nothing drawn."""
        super().__post_init__()
        self._buildings: list[Building] = []

    def draw(self) -> tuple[Labels, Labels]:
        """Draw the whole city; see `Canvas.images`."""
        self.labels[:] = self.book.add(Cover.PAVEMENT)
        outline = self._rotated_outline()
        boulevard = self.generator.uniform(*_BOULEVARD_M) * self.px_per_m
        parts = subdivide(outline, _DISTRICT_M2 * self.px_per_m**2, boulevard, self.generator)
        streets: list[_Street] = []
        for district in parts.cells:
            if self._touches_scene(district):
                streets += self._draw_district(district)
        self._draw_streets(streets)
        self._draw_river()
        trains = self._draw_railway()
        boulevards = [_Street(lane, boulevard / 2, True) for lane in parts.lanes]
        self._draw_streets(boulevards)
        self._plant_trees(_KINDS, 11, 1.6, (Cover.WATER, Cover.ASPHALT, Cover.RAIL))
        self._put_up_buildings()
        self._park_cars(streets + boulevards)
        self._things += trains
        return self.images()

    def _draw_district(self, district: Polygon) -> list[_Street]:
        shares = np.cumsum([quarter.share for quarter in QUARTERS])
        quarter = QUARTERS[int(np.searchsorted(shares, self.generator.random() * shares[-1]))]
        street = self.generator.uniform(*quarter.street_m) * self.px_per_m
        parts = subdivide(district, quarter.block_m2 * self.px_per_m**2, street, self.generator)
        for block in parts.cells:
            if self.generator.random() < _OPEN_BLOCK_SHARE:
                self._draw_open_block(block)
            else:
                self._draw_block(block, quarter)
        trees = bool(self.generator.random() < 0.3)
        return [_Street(lane, street / 2, trees) for lane in parts.lanes]

    def _draw_open_block(self, block: Polygon) -> None:
        park = self.generator.random() < 0.6
        self._fill(block, self.book.add(Cover.GRASS if park else Cover.PAVEMENT))
        self._scatter_over(block, 1 / 300 if park else 1 / 1500)

    def _draw_block(self, block: Polygon, quarter: Quarter) -> None:
        green = self.generator.random() < 0.3
        self._fill(block, self.book.add(Cover.GRASS if green else quarter.ground))
        self._buildings += quarter.build(block, self.px_per_m, self.generator)
        self._scatter_over(block, quarter.trees_per_m2)

    def _draw_streets(self, streets: list[_Street]) -> None:
        """Draw pavements before carriageways, so that no pavement crosses a junction."""
        for street in streets:
            self._fill(street.lane, self.book.add(Cover.PAVEMENT))
        asphalt = [self.book.add(Cover.ASPHALT) for _ in range(_KINDS)]
        for number, street in enumerate(streets):
            self._fill(street.carriageway(_KERB_M * self.px_per_m), asphalt[number % _KINDS])
            if street.trees:
                for side in (-1, 1):
                    offset = side * (street.half_width - 0.5 * _KERB_M * self.px_per_m)
                    self._trees += self._places(street.lane, offset, _TREE_PITCH_M)

    def _draw_river(self) -> None:
        if self.generator.random() < _RIVER_CHANCE:
            quay, water = self._river((14, 28), 8)
            self._fill(quay, self.book.add(Cover.PAVEMENT), convex=False)
            self._fill(water, self.book.add(Cover.WATER), convex=False)

    def _draw_railway(self) -> list[Standing]:
        """Draw the tracks and return the trains."""
        if self.generator.random() >= _RAILWAY_CHANCE:
            return []
        height, width = self.labels.shape
        angle = self.generator.uniform(0, math.pi)
        half_width = self.generator.uniform(12, 26) * self.px_per_m
        aside = self.generator.uniform(-0.35, 0.35) * min(height, width)
        centre = moved((width / 2, height / 2), 0.0, aside, angle)
        tracks = rectangle(centre, (math.hypot(height, width), half_width), angle)
        self._fill(tracks, self.book.add(Cover.RAIL, rows_rad=angle + math.pi / 2))
        coach = self.book.add(Cover.CAR, 4.0)
        trains = []
        for when in Acquisition:
            for _ in range(_TRAINS):
                along, across = self.traffic.uniform(-1, 1, 2).tolist()
                u, v = along * width / 2, across * (half_width - 3 * self.px_per_m)
                half_train = (70 * self.px_per_m, 1.5 * self.px_per_m)
                train = rectangle(moved(centre, u, v, angle), half_train, angle)
                trains.append(Standing(train, coach, (when,)))
        return trains

    def _put_up_buildings(self) -> None:
        keep_off = (Cover.WATER, Cover.RAIL, Cover.ASPHALT)
        for building in self._buildings:
            outline, _ = building[0]
            if self._touches(outline, keep_off):
                continue
            when = self.changes.draw()
            window_m = self.generator.uniform(*_WINDOW_M)
            for part, height_m in building:
                roof = self.book.add(Cover.BUILDING, height_m, window_m=window_m)
                self._things.append(Standing(part, roof, when))

    def _park_cars(self, streets: list[_Street]) -> None:
        """Add cars along the kerbs and on the lanes, different ones at each acquisition."""
        if self.px_per_m * _CAR_M[1] < 1:
            return
        kinds = [self.book.add(Cover.CAR, 1.5) for _ in range(_KINDS)]
        # Filling includes all touched pixels: outlines are reduced by 0.4 px on all sides.
        half_car = (_CAR_M[0] / 2 * self.px_per_m - 0.4, _CAR_M[1] / 2 * self.px_per_m - 0.4)
        for street in streets:
            *_, angle = main_frame(street.lane)
            kerb = street.half_width - (_KERB_M + 1.2) * self.px_per_m
            for offset, pitch_m in (
                *((side * kerb, _PARKING_PITCH_M) for side in (-1, 1)),
                *((side * kerb / 2, _MOVING_PITCH_M) for side in (-1, 1)),
            ):
                for place in self._places(street.lane, offset, pitch_m):
                    for when in BOTH:
                        drawn, kind = self.traffic.random(2).tolist()
                        if drawn < _PARKED_SHARE and self._cover_at(place) == Cover.ASPHALT:
                            car = rectangle(place, half_car, angle)
                            self._things.append(Standing(car, kinds[int(kind * _KINDS)], (when,)))

    def _places(self, lane: Polygon, offset: float, pitch_m: float) -> list[Point]:
        """Return evenly spaced places along a lane, within the scene."""
        centre, half, angle = main_frame(lane)
        cos, sin = math.cos(angle), math.sin(angle)
        along = np.arange(-half[0], half[0], pitch_m * self.px_per_m)
        x, y = centre[0] + along * cos - offset * sin, centre[1] + along * sin + offset * cos
        height, width = self.labels.shape
        inside = (x > 0) & (x < width - 1) & (y > 0) & (y < height - 1)
        return list(zip(x[inside].tolist(), y[inside].tolist(), strict=True))

    def _scatter_over(self, block: Polygon, per_m2: float) -> None:
        self._scatter_trees(block, area(block) / self.px_per_m**2 * per_m2, 0.92)
