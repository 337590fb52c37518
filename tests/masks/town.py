"""A drawn town whose ground is known: what a radar would see of it, with speckle."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

# Backscatter in decibels.
SHADOW_DB, ROAD_DB, WATER_DB, GRASS_DB, ROOF_DB = -25.0, -18.5, -22.0, -13.0, -6.0


@dataclass(frozen=True)
class Town:
    """Amplitudes, and where there are a road, a river, a park, shadows and roofs."""

    amplitude: np.ndarray
    road: np.ndarray
    river: np.ndarray
    park: np.ndarray
    shadow: np.ndarray

    @property
    def ground(self) -> np.ndarray:
        return self.road | self.river | self.park

    @property
    def roofs(self) -> np.ndarray:
        return ~self.ground & ~self.shadow


def draw_town(size: int = 400, looks: float = 3.0, seed: int = 0) -> Town:
    """Draw blocks of houses with their shadows, crossed by a road and a river, around a park."""
    random = np.random.default_rng(seed)
    level = np.full((size, size), ROOF_DB, np.float32)
    # Roofs and walls are anything but homogeneous.
    grains = random.normal(0, 4, (size // 3 + 1, size // 3 + 1)).astype(np.float32)
    level += np.kron(grains, np.ones((3, 3), np.float32))[:size, :size]
    shadow = np.zeros((size, size), np.uint8)
    for row in range(10, size, 60):
        for col in range(10, size, 70):
            cv2.rectangle(shadow, (col, row), (col + 26, row + 40), 1, -1)
    road, river, park = (np.zeros((size, size), np.uint8) for _ in range(3))
    cv2.line(road, (0, 60), (size, 120), 1, 12)
    cv2.polylines(river, [np.array([[0, 300], [150, 330], [size, 260]])], False, 1, 30)
    cv2.rectangle(park, (220, 150), (310, 230), 1, -1)
    for mask, value in ((shadow, SHADOW_DB), (park, GRASS_DB), (river, WATER_DB), (road, ROAD_DB)):
        level[mask > 0] = value
    drawn = (road | river | park) > 0
    speckle = random.gamma(looks, 1 / looks, level.shape)
    amplitude = 2000 * np.sqrt(10 ** (level / 10) * speckle)
    return Town(amplitude.astype(np.float32), road > 0, river > 0, park > 0, (shadow > 0) & ~drawn)
