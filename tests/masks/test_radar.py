from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import rasterio
from raster_files import write_raster

from groundtie.masks.radar import are_both_radar, is_radar_and_camera, is_rather_radar
from groundtie.rasters.pair import Image
from groundtie.rasters.radar_tags import SPECKLE_FILTER
from groundtie.rasters.reading import open_raster


@pytest.mark.parametrize("looks", [1, 4, 20])
def test_speckle_tells_the_radar_from_the_camera(tmp_path: Path, looks: int) -> None:
    random = np.random.default_rng(0)
    scene = np.kron(random.uniform(20, 200, (25, 25)), np.ones((8, 8)))
    radar = scene * np.sqrt(random.gamma(looks, 1 / looks, scene.shape))
    camera = scene + random.normal(0, 3, scene.shape)
    with ExitStack() as stack:
        one, other = (
            Image(
                stack.enter_context(
                    open_raster(write_raster(tmp_path / name, image.astype(np.float32)))
                )
            )
            for name, image in (("radar.tif", radar), ("camera.tif", camera))
        )
        assert is_rather_radar(one, other)
        assert not is_rather_radar(other, one)
        # Twenty looks are as calm as a camera's grain.
        assert is_radar_and_camera(one, other) == (looks < 20)
        assert not is_radar_and_camera(other, one)
        assert not are_both_radar(one, other)
        assert are_both_radar(one, one) == (looks < 20)


def test_metadata_tell_before_speckle(tmp_path: Path) -> None:
    """The filtered image is the calmer one."""
    random = np.random.default_rng(0)
    filtered = np.full((100, 100), 50) + random.normal(0, 0.1, (100, 100))
    camera = np.full((100, 100), 50) + random.normal(0, 2, (100, 100))
    radar = 50 * np.sqrt(random.gamma(2, 1 / 2, (100, 100)))
    with ExitStack() as stack:
        paths = {"filtered": filtered, "camera": camera, "radar": radar}
        images = {}
        for name, values in paths.items():
            path = write_raster(tmp_path / f"{name}.tif", values.astype(np.float32))
            if name == "filtered":
                with rasterio.open(path, "r+") as dataset:
                    dataset.update_tags(**{SPECKLE_FILTER: "a filter"})
            images[name] = Image(stack.enter_context(open_raster(path)))
        one, other, speckled = images["filtered"], images["camera"], images["radar"]
        assert is_rather_radar(one, other) and not is_rather_radar(other, one)
        assert is_radar_and_camera(one, other) and not is_radar_and_camera(other, one)
        # Two radar images, of which one is filtered: neither is a camera's.
        for pair in ((one, speckled), (speckled, one), (one, one)):
            assert not is_radar_and_camera(*pair)
            assert are_both_radar(*pair)
        assert not are_both_radar(one, other)


@pytest.mark.slow
def test_the_radar_image_of_every_real_pair_is_found(real_data: Path) -> None:
    cases = json.loads((real_data / "cases.json").read_text())
    pairs = [case for case in cases if case["kind"].startswith("sar-optical")]
    assert len(pairs) >= 10
    for case in pairs:
        with ExitStack() as stack:
            radar, camera = (
                Image(
                    stack.enter_context(
                        open_raster(real_data / case[which], allow_sensor_geometry=True)
                    )
                )
                for which in ("reference", "input")
            )
            assert is_rather_radar(radar, camera), case["id"]
