from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from brightness_classifiers import bright_is_left_out
from raster_files import utm_grid, write_raster

from groundtie.features.classified import ClassifiedScene
from groundtie.features.classifier import read_classifier
from groundtie.masks.scene import Scene
from groundtie.rasters.reading import Window, open_raster

WIDTH, HEIGHT = 203, 131

# What lies right of this column is bright.
BORDER = 120


@pytest.fixture
def classified(tmp_path: Path) -> ClassifiedScene:
    random = np.random.default_rng(0)
    values = random.normal(1000, 30, (HEIGHT, WIDTH))
    values[:, BORDER:] += 1000
    values[:20, :20] = 0
    path = write_raster(tmp_path / "a.tif", values.astype(np.uint16), utm_grid(WIDTH, HEIGHT))
    with open_raster(write_raster(path, values.astype(np.uint16), nodata=0)) as source:
        scene = Scene.of(source)
    classifier = read_classifier(bright_is_left_out(tmp_path / "c.json", 1250))
    return ClassifiedScene(scene, lambda window: np.zeros((0, 1, 1), np.float32), classifier)


def test_what_is_bright_is_masked_and_what_lies_beside_it_is_not(
    classified: ClassifiedScene,
) -> None:
    part, valid = classified.select(Window(0, 0, WIDTH, HEIGHT))
    # To a cell: patches of which a quarter is bright are left out, and lie 10 px beside it.
    assert part[30:, : BORDER - 8].all()
    assert not part[:, BORDER + 8 :].any()
    assert not valid[:20, :20].any()
    assert not part[:20, :20].any()
    assert valid[20:, 20:].all()


@pytest.mark.parametrize("window", [Window(0, 0, 61, 70), Window(61, 35, 142, 96)])
def test_it_is_the_same_in_every_window(classified: ClassifiedScene, window: Window) -> None:
    whole = classified.select(Window(0, 0, WIDTH, HEIGHT))
    piece = classified.select(window)
    inside = (
        slice(window.row, window.row + window.height),
        slice(window.col, window.col + window.width),
    )
    np.testing.assert_array_equal(piece.part, whole.part[inside])
    np.testing.assert_array_equal(piece.valid, whole.valid[inside])
