"""Convex polygons and their subdivision into districts, blocks, fields and lots."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

Point = tuple[float, float]
Polygon = list[Point]

_ANGLE_JITTER_RAD = math.radians(3)


@dataclass(frozen=True)
class Subdivision:
    """Cells of a subdivided polygon and the lanes that run between them."""

    cells: list[Polygon]
    lanes: list[Polygon]


def area(polygon: Polygon) -> float:
    """Return the area of a simple polygon."""
    following = polygon[1:] + polygon[:1]
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(polygon, following, strict=True)) / 2)


def clip(polygon: Polygon, point: Point, normal: Point) -> Polygon:
    """Return the part of a convex polygon on the side that `normal` points to."""
    kept: Polygon = []
    distances = [(p[0] - point[0]) * normal[0] + (p[1] - point[1]) * normal[1] for p in polygon]
    for i, (here, d) in enumerate(zip(polygon, distances, strict=True)):
        after, e = polygon[(i + 1) % len(polygon)], distances[(i + 1) % len(polygon)]
        if d >= 0:
            kept.append(here)
        if (d < 0) != (e < 0):
            t = d / (d - e)
            kept.append((here[0] + t * (after[0] - here[0]), here[1] + t * (after[1] - here[1])))
    return kept


def contains(polygon: Polygon, point: Point) -> bool:
    """Return whether a point lies inside a convex polygon."""
    signs = [
        (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]) >= 0
        for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True)
    ]
    return all(signs) or not any(signs)


def points_along(polygon: Polygon, per_side: int) -> list[Point]:
    """Return points at even distances along each side, corners included."""
    return [
        (a[0] + (b[0] - a[0]) * k / per_side, a[1] + (b[1] - a[1]) * k / per_side)
        for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True)
        for k in range(per_side)
    ]


def moved(place: Point, along: float, across: float, angle_rad: float) -> Point:
    """Return a point moved along and across the direction at an angle to the first axis."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return place[0] + along * cos - across * sin, place[1] + along * sin + across * cos


def rectangle(centre: Point, half: Point, angle_rad: float) -> Polygon:
    """Return the rectangle of half side lengths `half`, rotated by an angle."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    return [moved(centre, i * half[0], j * half[1], angle_rad) for i, j in corners]


def main_frame(polygon: Polygon) -> tuple[Point, Point, float]:
    """Return the centre, half side lengths and angle of the bounding box along the longest edge."""
    edges = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    a, b = max(edges, key=lambda e: (e[1][0] - e[0][0]) ** 2 + (e[1][1] - e[0][1]) ** 2)
    angle = math.atan2(b[1] - a[1], b[0] - a[0])
    cos, sin = math.cos(angle), math.sin(angle)
    along = [p[0] * cos + p[1] * sin for p in polygon]
    across = [p[1] * cos - p[0] * sin for p in polygon]
    u, v = (min(along) + max(along)) / 2, (min(across) + max(across)) / 2
    half = ((max(along) - min(along)) / 2, (max(across) - min(across)) / 2)
    return (u * cos - v * sin, u * sin + v * cos), half, angle


def fitted_rectangle(polygon: Polygon, fill: Point) -> Polygon | None:
    """Return a rectangle along the longest edge that fills the given shares of the box's sides.

    It is shrunk until it lies inside the polygon; None if the polygon is too pointed.
    """
    centre, half, angle = main_frame(polygon)
    for shrink in (1.0, 0.94, 0.88, 0.82, 0.7, 0.55):
        box = rectangle(centre, (half[0] * fill[0] * shrink, half[1] * fill[1] * shrink), angle)
        if all(contains(polygon, corner) for corner in box):
            return box
    return None


def subdivide(
    polygon: Polygon, cell_area: float, lane_width: float, generator: np.random.Generator
) -> Subdivision:
    """Cut a convex polygon across its longer side until cells have areas of about `cell_area`."""
    done = Subdivision([], [])
    waiting = [polygon]
    while waiting:
        cell = waiting.pop()
        stop, share, turn = generator.random(3).tolist()
        if area(cell) < cell_area * (0.8 + 1.2 * stop):
            done.cells.append(cell)
            continue
        first, second, lane = _split(cell, lane_width, 0.38 + 0.24 * share, 2 * turn - 1)
        parts = [part for part in (first, second) if len(part) >= 3]
        if len(parts) < 2:
            done.cells.append(cell)
            continue
        waiting.extend(parts)
        if lane_width > 0 and len(lane) >= 3:
            done.lanes.append(lane)
    return done


def _split(
    polygon: Polygon, gap: float, share: float, turn: float
) -> tuple[Polygon, Polygon, Polygon]:
    """Return the parts on both sides of a cut across the longer side, and the lane between."""
    centre, half, angle = main_frame(polygon)
    longer = 0 if half[0] >= half[1] else 1
    across = angle + longer * math.pi / 2
    offset = (2 * share - 1) * half[longer]
    point = moved(centre, offset, 0.0, across)
    direction = across + turn * _ANGLE_JITTER_RAD
    normal = (math.cos(direction), math.sin(direction))
    opposite = (-normal[0], -normal[1])
    far = (point[0] + normal[0] * gap / 2, point[1] + normal[1] * gap / 2)
    near = (point[0] - normal[0] * gap / 2, point[1] - normal[1] * gap / 2)
    lane = clip(clip(polygon, near, normal), far, opposite)
    return clip(polygon, far, normal), clip(polygon, near, opposite), lane


def inset(polygon: Polygon, distance: float) -> Polygon | None:
    """Move all sides of a convex polygon inwards; None if a side would vanish.

    Corners must be ordered from the first axis to the second, as in `rectangle`. Corner k of the
    result corresponds to corner k of the polygon.
    """
    corners = np.array(polygon)
    along = np.roll(corners, -1, axis=0) - corners
    length = np.hypot(*along.T)
    if length.min() < 2 * distance:
        return None
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None]
    before = np.roll(normal, 1, axis=0)
    mitre = 1 + np.sum(normal * before, axis=1)
    if mitre.min() < 0.3:
        return None
    inner = corners + distance * (normal + before) / mitre[:, None]
    left = np.sum((np.roll(inner, -1, axis=0) - inner) * along, axis=1) / length
    return None if left.min() < distance / 2 else [(x, y) for x, y in inner.tolist()]
