from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from groundtie.masks.growing import Region
from groundtie.masks.range_order import RangeOrder
from groundtie.rasters.reading import Window

GROUND_DB, LAYOVER_DB, SHADOW_DB = 50.0, 60.0, 35.0
PITCH_PX, STRIP_PX, SIZE_PX = 60, 12, 480

# The building in the middle, and what lies before its layover.
FIRST = 4 * PITCH_PX
COURTYARD = slice(FIRST - PITCH_PX + 2 * STRIP_PX, FIRST)
ROWS = slice(200, 240)


def seen_from_the_left(roof_px: int = 0) -> NDArray[np.float32]:
    """Return a town in which the radar looks to the right: layover, then shadow.

    What is laid over hides all roofs but that of the building in the middle.
    """
    level = np.full((SIZE_PX, SIZE_PX), GROUND_DB, np.float32)
    for col in range(0, SIZE_PX, PITCH_PX):
        shadow = col + STRIP_PX + (roof_px if col == FIRST else 0)
        level[:, col : col + STRIP_PX] = LAYOVER_DB
        level[:, shadow : shadow + STRIP_PX] = SHADOW_DB
    level[::PITCH_PX] = GROUND_DB  # lanes
    return level


def region(rows: slice, cols: slice) -> Region:
    window = Window(cols.start, rows.start, cols.stop - cols.start, rows.stop - rows.start)
    return Region(window, np.ones((window.height, window.width), bool), GROUND_DB)


def evidence(level: NDArray[np.float32], where: Region, quarters: int) -> float:
    """Return the evidence where the scene is rotated by some quarters, counterclockwise."""
    mask = np.zeros(level.shape, bool)
    box = where.box
    mask[box.row : box.row + box.height, box.col : box.col + box.width] = where.mask
    rows, cols = np.nonzero(np.rot90(mask, quarters))
    rotated = region(slice(rows.min(), rows.max() + 1), slice(cols.min(), cols.max() + 1))
    level = np.ascontiguousarray(np.rot90(level, quarters))
    order = RangeOrder.of(level, np.ones(level.shape, bool), SHADOW_DB + 1, 1.0)
    return order.evidence_of_ground(rotated)


@pytest.mark.parametrize("quarters", range(4))
def test_between_shadow_and_layover_lies_ground(quarters: int) -> None:
    assert evidence(seen_from_the_left(), region(ROWS, COURTYARD), quarters) > 1.5


@pytest.mark.parametrize("quarters", range(4))
def test_between_layover_and_shadow_lies_a_roof(quarters: int) -> None:
    roof = region(ROWS, slice(FIRST + STRIP_PX, FIRST + STRIP_PX + 20))
    assert evidence(seen_from_the_left(roof_px=20), roof, quarters) < -1.5


def test_where_nothing_stands_there_is_no_evidence() -> None:
    level = np.random.default_rng(1).normal(GROUND_DB, 0.5, (SIZE_PX, SIZE_PX)).astype(np.float32)
    assert abs(evidence(level, region(ROWS, slice(100, 200)), 0)) < 0.1


def test_regions_at_the_borders_of_the_scene_are_looked_at() -> None:
    level = seen_from_the_left()
    order = RangeOrder.of(level, np.ones(level.shape, bool), SHADOW_DB + 1, 1.0)
    corner = order.evidence_of_ground(
        region(slice(0, 40), slice(SIZE_PX - PITCH_PX + 2 * STRIP_PX, SIZE_PX))
    )
    # Shadow lies before it, and nothing is known of what is behind.
    assert corner == pytest.approx(1.0, abs=0.1)
