from __future__ import annotations

import cv2
import numpy as np
import pytest

from groundtie.masks.cast_shadow import SHADOW_M, out_of_shadow, shadow_azimuth_deg
from groundtie.rasters.patch import Patch

LENGTH = 9


def town_with_shadows(
    azimuth_deg: float, size: int = 300
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return an image of houses whose shadows fall towards an azimuth, the houses, the shadows."""
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
    return image.astype(np.float32), houses > 0, shadow


@pytest.mark.parametrize("azimuth", [0.0, 25.0, 90.0, 155.0, 250.0, 335.0])
def test_the_azimuth_is_inferred_from_the_image(azimuth: float) -> None:
    image, _, _ = town_with_shadows(azimuth)
    found = shadow_azimuth_deg(Patch(image, np.ones(image.shape, bool)))
    assert abs((found - azimuth + 180) % 360 - 180) < 15


def test_what_is_not_valid_does_not_matter() -> None:
    image, _, _ = town_with_shadows(155.0)
    valid = np.ones(image.shape, bool)
    valid[:, 220:] = False
    image[~valid] = 0
    found = shadow_azimuth_deg(Patch(image, valid))
    assert abs(found - 155) < 15


@pytest.mark.parametrize("azimuth", [0.0, 25.0, 250.0])
def test_no_shadow_is_left_on_the_ground(azimuth: float) -> None:
    _, houses, shadow = town_with_shadows(azimuth)
    left = out_of_shadow(~houses, azimuth, 1.0)
    assert (left & shadow).sum() < 0.01 * shadow.sum()
    # Ground on the sunny side stays.
    along = np.deg2rad(azimuth + 180)
    moved = np.float32([[1, 0, np.sin(along) * 2], [0, 1, -np.cos(along) * 2]])
    sunny = cv2.warpAffine(houses.astype(np.uint8), moved, houses.shape) > 0
    sunny &= ~houses & ~shadow
    assert (left & sunny).sum() > 0.8 * sunny.sum()


def test_the_reach_is_in_metres() -> None:
    ground = np.ones((1, 60), bool)
    ground[0, 20] = False
    for pixel_m in (0.5, 1.0, 2.0):
        left = out_of_shadow(ground, 90.0, pixel_m)
        assert (~left).sum() == SHADOW_M / pixel_m + 1
        assert left[0, :20].all()
