from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import write_raster

from groundtie.masks.radar import (
    LEAST_VARIATION2,
    LEAST_VARIATION2_RATIO,
    power,
    variation2_of,
)
from groundtie.rasters.pair import Image
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster


def variation2(path: Path, values: np.ndarray) -> float:
    with open_raster(write_raster(path, values.astype(np.float32))) as source:
        return variation2_of(Image(source))


@pytest.mark.parametrize("looks", [1, 4, 20])
def test_speckle_varies_more_than_the_grain_of_a_camera(tmp_path: Path, looks: int) -> None:
    random = np.random.default_rng(0)
    scene = np.kron(random.uniform(20, 200, (25, 25)), np.ones((8, 8)))
    radar = variation2(
        tmp_path / "a.tif", scene * np.sqrt(random.gamma(looks, 1 / looks, scene.shape))
    )
    camera = variation2(tmp_path / "b.tif", scene + random.normal(0, 3, scene.shape))
    assert radar > LEAST_VARIATION2_RATIO * camera
    # Twenty looks are as homogeneous as a camera's grain.
    assert (radar >= LEAST_VARIATION2) == (looks < 20)
    # Most homogeneous windows are so by chance, too.
    assert 0.3 < radar * looks < 1.2


def test_power_is_zero_where_invalid() -> None:
    patch = Patch(np.array([[3, 4]], np.float32), np.array([[True, False]]))
    np.testing.assert_array_equal(power(patch), [[9, 0]])
