from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rpc_models import DIMAP, REAL, camera, real_tags

from groundtie.errors import TooFewPointsError
from groundtie.sensor.rpc import image_places
from groundtie.sensor.rpc_files import read_rpc
from groundtie.sensor.rpc_fit import fit_rpc
from groundtie.sensor.rpc_tags import rpc_from_tags

AFFINE = np.array([[1.0008, 0.0005], [-0.0007, 0.9994]])


def test_a_camera_is_fitted_to_a_thousandth_of_a_pixel() -> None:
    random = np.random.default_rng(0)

    def ground(count: int) -> tuple[np.ndarray, np.ndarray]:
        lon_lat = random.uniform(-0.004, 0.004, (count, 2)) + [9.0, 45.15]
        return lon_lat, random.uniform(0, 800, count)

    lon_lat, height = ground(1500)
    fit = fit_rpc(lon_lat, height, camera(lon_lat, height))
    elsewhere, other_height = ground(500)
    miss = fit.rpc.project(elsewhere, other_height) - camera(elsewhere, other_height)
    assert np.abs(miss).max() < 1e-3
    assert fit.largest_residual_px < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", [*REAL, DIMAP])
def test_an_affine_change_of_real_rpcs_is_taken_up(real_data: Path, name: str) -> None:
    path, size = real_data / name, (1024, 1024)
    rpc = read_rpc(path) if name == DIMAP else rpc_from_tags(real_tags(path), name)
    heights = np.linspace(rpc.offset[2] - rpc.scale[2], rpc.offset[2] + rpc.scale[2], 5)
    px, height = image_places(size, heights)
    lon_lat = rpc.localise(px, height)
    fit = fit_rpc(lon_lat, height, rpc.project(lon_lat, height) @ AFFINE.T + [12.0, -7.0])
    px = np.random.default_rng(0).uniform(0, 1024, (500, 2))
    between = np.random.default_rng(1).uniform(heights[0], heights[-1], 500)
    found = fit.rpc.project(rpc.localise(px, between), between)
    assert np.abs(found - (px @ AFFINE.T + [12.0, -7.0])).max() < 1e-4
    assert fit.largest_residual_px < 1e-4


def test_the_lattice_reaches_to_the_images_corners() -> None:
    px, heights = image_places((600, 500), [0.0, 400.0], nodes=3)
    assert sorted(set(px[:, 0])) == [-0.5, 299.5, 599.5]
    assert sorted(set(px[:, 1])) == [-0.5, 249.5, 499.5]
    assert set(heights) == {0.0, 400.0}


def test_too_few_positions_are_refused() -> None:
    with pytest.raises(TooFewPointsError, match="at least 39"):
        fit_rpc(np.zeros((38, 2)), np.zeros(38), np.zeros((38, 2)))
