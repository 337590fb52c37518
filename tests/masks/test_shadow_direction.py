from __future__ import annotations

import cv2
import numpy as np
import pytest

from groundtie.masks.shadow_direction import shadow_azimuth_deg
from groundtie.rasters.patch import Patch

LENGTH = 9
# The outer percentages of the histogram that are dark and bright; the farthest of these, in pixels.
SHADOWS = 15.0, 14


def town_with_shadows(azimuth_deg: float, size: int = 300) -> np.ndarray:
    """Return an image of houses whose shadows fall towards an azimuth."""
    random = np.random.default_rng(1)
    houses = np.zeros((size, size), np.uint8)
    for row in range(25, size - 50, 55):
        for col in range(25, size - 50, 55):
            rotation = random.uniform(0, 90)
            box = cv2.boxPoints(((col + 14.0, row + 14.0), (22.0, 15.0), rotation))
            cv2.fillConvexPoly(houses, np.rint(box).astype(np.int32), 1)
    along = np.deg2rad(azimuth_deg)
    shadows = np.zeros_like(houses)
    for step in range(1, LENGTH + 1):
        moved = np.float32([[1, 0, np.sin(along) * step], [0, 1, -np.cos(along) * step]])
        shadows |= cv2.warpAffine(houses, moved, houses.shape[::-1], flags=cv2.INTER_NEAREST)
    shadow = (shadows > 0) & (houses == 0)
    image = np.where(houses > 0, random.uniform(400, 900), 400.0)
    image = np.where(shadow, 120.0, image) + random.normal(0, 20, houses.shape)
    return image.astype(np.float32)


@pytest.mark.parametrize("azimuth", [0.0, 25.0, 90.0, 155.0, 250.0, 335.0])
def test_the_azimuth_is_inferred_from_the_image(azimuth: float) -> None:
    image = town_with_shadows(azimuth)
    found = shadow_azimuth_deg(Patch(image, np.ones(image.shape, bool)), *SHADOWS)
    assert abs((found - azimuth + 180) % 360 - 180) < 15


def test_what_is_not_valid_does_not_matter() -> None:
    image = town_with_shadows(155.0)
    valid = np.ones(image.shape, bool)
    valid[:, 220:] = False
    image[~valid] = 0
    found = shadow_azimuth_deg(Patch(image, valid), *SHADOWS)
    assert abs(found - 155) < 15
