from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rpc_models import DIMAP, REAL, camera_rpc, rasterio_project, real_tags, to_rasterio

from groundtie.sensor.polynomials import BLOCK, EXPONENTS, fill_terms
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import read_rpc
from groundtie.sensor.rpc_tags import rpc_from_tags

CAMERA = camera_rpc()


def ground_of(rpc: RPC, count: int, reach: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    lph = np.random.default_rng(1).uniform(-reach, reach, (count, 3))
    ground = lph * rpc.scale + rpc.offset
    return ground[:, :2], ground[:, 2]


def test_terms_are_the_powers_of_rpc00b() -> None:
    lph = np.random.default_rng(0).normal(size=(3, 50))
    terms = np.empty((20, 50))
    fill_terms(lph, terms)
    for term, (i, j, k) in zip(terms, EXPONENTS, strict=True):
        np.testing.assert_allclose(term, lph[0] ** i * lph[1] ** j * lph[2] ** k)
    assert len(set(EXPONENTS)) == 20
    assert max(map(sum, EXPONENTS)) == 3


@pytest.mark.parametrize("name", [*REAL, DIMAP])
def test_positions_are_those_of_gdal(real_data: Path, name: str) -> None:
    path = real_data / name
    rpc = read_rpc(path) if name == DIMAP else rpc_from_tags(real_tags(path), name)
    lon_lat, height = ground_of(rpc, 1000)
    expected = rasterio_project(to_rasterio(rpc), lon_lat, height)
    assert np.abs(rpc.project(lon_lat, height) - expected).max() < 1e-6


@pytest.mark.parametrize("name", [*REAL, DIMAP])
def test_the_inverse_returns_to_the_image_position(real_data: Path, name: str) -> None:
    path = real_data / name
    rpc = read_rpc(path) if name == DIMAP else rpc_from_tags(real_tags(path), name)
    lon_lat, height = ground_of(rpc, 3000)
    px = rpc.project(lon_lat, height)
    found = rpc.localise(px, height)
    assert np.abs(found - lon_lat).max() < 1e-9  # 0.1 mm
    assert np.abs(rpc.project(found, height) - px).max() < 1e-6


@pytest.mark.parametrize("count", [0, 1, BLOCK, 3 * BLOCK + 7])
def test_blocks_change_nothing(count: int) -> None:
    lon_lat, height = ground_of(CAMERA, count)
    px = CAMERA.project(lon_lat, height)
    assert px.shape == (count, 2)
    one_by_one = [CAMERA.project(lon_lat[i : i + 1], height[i]) for i in range(0, count, 997)]
    np.testing.assert_allclose(px[::997], np.array(one_by_one).reshape(-1, 2), rtol=0, atol=1e-8)
    back = CAMERA.localise(px, height)
    np.testing.assert_allclose(back, lon_lat, rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_the_inverse_holds_for_any_view(seed: int) -> None:
    low, high = [-60, 0.3, -0.6, -180], [60, 5.0, 0.6, 180]
    latitude, pixel_m, lean, turn = np.random.default_rng(seed).uniform(low, high)
    rpc = camera_rpc(centre=(20.0, latitude), pixel_m=pixel_m, off_nadir=(lean, 0.3), turn_deg=turn)
    px = np.random.default_rng(2).uniform(0, 500, (200, 2))
    height = np.linspace(0, 800, 200)
    assert np.abs(rpc.project(rpc.localise(px, height), height) - px).max() < 1e-6


def test_what_cannot_be_seen_is_nan() -> None:
    found = CAMERA.localise([[1e12, 0.0], [100.0, 100.0], [np.nan, 5.0]], 200.0)
    assert np.isnan(found[[0, 2]]).all()
    assert np.isfinite(found[1]).all()


def test_positions_far_from_the_image_are_not_valid() -> None:
    lon_lat, height = ground_of(CAMERA, 100)
    assert CAMERA.is_valid(lon_lat, height).all()
    assert not CAMERA.is_valid(lon_lat + [2 * 1.6 * CAMERA.scale[0], 0], height).any()
    assert not CAMERA.is_valid(lon_lat, height + 2 * 1.6 * CAMERA.scale[2]).any()


def test_a_shift_moves_positions_exactly() -> None:
    lon_lat, height = ground_of(CAMERA, 100)
    moved = CAMERA.shifted((3.25, -7.5)).project(lon_lat, height)
    np.testing.assert_allclose(moved - CAMERA.project(lon_lat, height), [[3.25, -7.5]] * 100)


@pytest.mark.parametrize(
    "changed",
    [
        {"polynomials": ((1.0,) * 20, (1.0,) * 20, (1.0,) * 19, (1.0,) * 20)},
        {"scale": (1.0, 0.0, 1.0)},
        {"offset": (float("nan"), 0.0, 0.0)},
    ],
)
def test_impossible_coefficients_are_refused(changed: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="RPC"):
        replace(CAMERA, **changed)  # type: ignore[arg-type]
