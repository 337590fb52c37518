"""What the tool `register` leaves beside the registered image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster
from rpc_models import camera_rpc, to_rasterio
from textured_pairs import TexturedPair, texture

import groundtie
from groundtie.errors import NotRegisteredError, ParameterError
from groundtie.registration import automatic
from groundtie.registration.registration import Registration


@pytest.mark.slow
def test_the_displacement_is_written(textured: TexturedPair, tmp_path: Path) -> None:
    path = tmp_path / "moved.tif"
    groundtie.register(textured.reference, textured.input, displacement=path)
    with rasterio.open(path) as raster:
        dx, dy, sigma = raster.read()
        assert raster.units == ("m", "m", "m")
    known = np.isfinite(dx)
    assert known.mean() > 0.5
    # The input claims to lie 70 m too far east and 45 m too far south; pixels have 10 m.
    error = np.array([dx[known] + 70, dy[known] - 45])
    assert np.abs(error).max() < 1.5
    assert (sigma[known] > 0).all()


@pytest.mark.parametrize("name", ["transform", "displacement"])
def test_an_image_with_rpcs_has_none_to_write(
    textured: TexturedPair, tmp_path: Path, name: str
) -> None:
    image = write_raster(tmp_path / "image.tif", np.ones((50, 60), np.uint8))
    with rasterio.open(image, "r+") as dataset:
        dataset.rpcs = to_rasterio(camera_rpc((60, 50)))
    suffix = ".json" if name == "transform" else ".tif"
    with pytest.raises(ParameterError, match=f"there is no {name} to write"):
        groundtie.register(
            textured.reference,
            image,
            tmp_path / "out.tif",
            **{name: tmp_path / f"other{suffix}"},
        )
    assert not (tmp_path / "out.tif").exists()


def test_what_matches_at_two_places_is_not_tried_in_another_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same ground every 51 pixels: a search of rotations would find one of the places."""
    tried: list[str] = []

    def run(*arguments: Any) -> Registration:
        found = automatic_run(*arguments)
        tried.append(found.verdict.rule)
        return found

    automatic_run = automatic.run
    monkeypatch.setattr(automatic, "run", run)
    ground = np.tile(texture(51, 51), (9, 9))
    paths = []
    for name, first in (("reference.tif", 20), ("input.tif", 30)):
        noise = np.random.default_rng(first).normal(size=(400, 400))
        view = ground[first : first + 400, first : first + 400] + 0.2 * noise
        image = np.clip(120 + 30 * view, 1, 255).astype(np.float32)
        paths.append(write_raster(tmp_path / name, image, utm_grid(400, 400, 1.0)))
    with pytest.raises(NotRegisteredError, match="two places match about as well"):
        groundtie.register(*paths)
    assert tried == ["second place"]
