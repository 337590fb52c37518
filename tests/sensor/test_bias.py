from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rpc_models import DIMAP, REAL, camera_rpc, real_tags

from groundtie.sensor.bias import KINDS, TERMS, Bias, design, fold
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import read_rpc
from groundtie.sensor.rpc_tags import rpc_from_tags

SIZE = (900, 700)
COEFFICIENTS = np.array([[42.0, -17.0], [3.0, -2.5], [-1.5, 4.0]])


def bias_of(kind: str, size: tuple[int, int] = SIZE) -> Bias:
    terms = TERMS[kind]
    return Bias(kind, size, COEFFICIENTS[:terms], np.eye(2 * terms))


def test_terms_count_from_the_middle_to_the_border() -> None:
    px = np.array([[449.5, 349.5], [449.5, 699.5], [899.5, 349.5]])
    np.testing.assert_allclose(design("affine", SIZE, px), [[1, 0, 0], [1, 1, 0], [1, 0, 1]])
    np.testing.assert_allclose(bias_of("shift_drift")(px[1:2]), [[45.0, -19.5]])
    np.testing.assert_allclose(bias_of("affine")(px[2:]), [[40.5, -13.0]])
    assert KINDS == ("shift", "shift_drift", "affine")


def test_sigmas_are_those_of_the_parameters_covariance() -> None:
    random = np.random.default_rng(0)
    root = random.normal(size=(6, 6)) / 10
    bias = Bias("affine", SIZE, COEFFICIENTS, root @ root.T)
    px = random.uniform(0, 1, (5, 2)) * SIZE
    draws = np.einsum("ij,kj->ki", root, random.normal(size=(40_000, 6))).reshape(-1, 3, 2)
    spread = np.einsum("ni,kij->knj", design("affine", SIZE, px), draws)
    expected = np.sqrt(spread.var(axis=0).sum(axis=1))
    np.testing.assert_allclose(bias.sigma_px(px), expected, rtol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_refined_rpcs_hold_the_bias_at_all_heights(kind: str) -> None:
    rpc, bias = camera_rpc(SIZE), bias_of(kind)
    assert_folded(rpc, bias, np.array([0.0, 300.0, 800.0]))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*REAL, DIMAP])
def test_real_rpcs_take_up_a_bias(real_data: Path, name: str) -> None:
    path = real_data / name
    rpc = read_rpc(path) if name == DIMAP else rpc_from_tags(real_tags(path), name)
    size = (40_000, 42_000) if name == DIMAP else (1024, 1024)
    heights = rpc.offset[2] + np.array([-1, 0.1, 1]) * rpc.scale[2]
    assert_folded(rpc, bias_of("affine", size), heights)


def assert_folded(rpc: RPC, bias: Bias, heights: np.ndarray) -> None:
    fit = fold(rpc, bias)
    px = np.random.default_rng(1).uniform(0, 1, (300, 2)) * bias.size
    for height in heights:
        ground = rpc.localise(px, height)
        assert np.abs(fit.rpc.project(ground, height) - (px + bias(px))).max() < 0.01
    assert fit.largest_residual_px <= (0.0 if bias.kind == "shift" else 0.01)


def test_a_shift_changes_the_offsets_alone() -> None:
    rpc = camera_rpc(SIZE)
    found = fold(rpc, bias_of("shift")).rpc
    assert found == rpc.shifted((42.0, -17.0))


def test_what_json_carries_names_the_terms() -> None:
    values = bias_of("shift_drift").to_json()
    assert values["model"] == "shift_drift"
    assert values["terms"]["row"] == {
        "col_px": 3.0, "row_px": -2.5, "sigma_col_px": 1.0, "sigma_row_px": 1.0,
    }  # fmt: skip
