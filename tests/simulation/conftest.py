"""Scenes of known geometry, made by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from groundtie.simulation.cover import PLAIN_WALL, Cover, ParcelTable
from groundtie.simulation.scene import Scene

GROUND_DB = -20.0
ROOF_DB = -3.0
GROUND_REFLECTANCE = 0.1
ROOF_REFLECTANCE = 0.5

Box = tuple[slice, slice, float]


def build_scene(
    shape: tuple[int, int],
    boxes: tuple[Box, ...] = (),
    *,
    terrain_m: np.ndarray | None = None,
    parcel: np.ndarray | None = None,
    pixel_size_m: float = 1.0,
    margin_px: int = 0,
    seed: int = 0,
) -> Scene:
    """Return a bare plain with box buildings.

    Parcel 0 is dark road, 1 the roofs, 2 a field ten times as bright to the radar as the road and
    three times to the camera. Classes with little texture keep geometry easy to measure.
    """
    labels = np.zeros(shape, np.int32) if parcel is None else parcel.astype(np.int32)
    objects = np.zeros(shape, np.float32)
    for rows, columns, height_m in boxes:
        labels[rows, columns] = 1
        objects[rows, columns] = height_m
    spectra = np.array([GROUND_REFLECTANCE, ROOF_REFLECTANCE, 3 * GROUND_REFLECTANCE], np.float32)
    return Scene(
        pixel_size_m=pixel_size_m,
        margin_px=margin_px,
        seed=seed,
        terrain_m=np.zeros(shape, np.float32) if terrain_m is None else terrain_m.astype("f4"),
        object_m=objects,
        parcel=labels,
        parcels=ParcelTable(
            cover=np.array([Cover.ROAD, Cover.BUILDING, Cover.FIELD], np.uint8),
            height_m=np.zeros(3, np.float32),
            backscatter_db=np.array([GROUND_DB, ROOF_DB, GROUND_DB + 10], np.float32),
            reflectance=np.repeat(spectra[:, None], 4, axis=1),
            rows_rad=np.zeros(3, np.float32),
            window_m=np.zeros(3, np.float32),
            wall_reflectance=np.full(3, PLAIN_WALL, np.float32),
        ),
    )


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., Scene]:
    return build_scene
