"""What the tool `register` leaves beside the registered image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from raster_files import write_raster
from rpc_models import camera_rpc, to_rasterio
from textured_pairs import TexturedPair

import groundtie
from groundtie.errors import ParameterError


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
