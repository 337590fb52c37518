from __future__ import annotations

import json

import numpy as np
import pytest
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st

from groundtie.geometry.fitting import fit_model
from groundtie.geometry.models import (
    KINDS,
    Frame,
    Model,
    PolynomialModel,
    monomials,
    shift_model,
    thin_plate_kernel,
)
from groundtie.geometry.transform import model_from_json
from groundtie.rasters.grid import apply_affine

CORNER = np.array([500_000.0, 4_990_000.0])


def places(count: int = 60, seed: int = 0) -> np.ndarray:
    """Positions in a scene of 10 km."""
    return CORNER + np.random.default_rng(seed).uniform(0, 10_000, (count, 2))


def a_model(kind: str, seed: int = 1, size_m: float = 100.0) -> Model:
    """A model of a misregistration of about `size_m`."""
    rng = np.random.default_rng(seed)
    xy = places(60, seed)
    uv = (xy - xy.mean(axis=0)) / 5000
    bend = monomials(uv, 3) @ rng.normal(0, 1, (10, 2)) / 3
    return fit_model(kind, xy, xy + size_m * bend)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_there_and_back(kind: str, seed: int) -> None:
    model, xy = a_model(kind, seed), places(20, seed + 1)
    np.testing.assert_allclose(model.inverse(model(xy)), xy, atol=1e-5)
    np.testing.assert_allclose(model(model.inverse(xy)), xy, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 10_000))
def test_to_json_and_back(kind: str, seed: int) -> None:
    model = a_model(kind, seed)
    again = model_from_json(json.loads(json.dumps(model.to_json())))
    assert again.kind == kind
    xy = places()
    np.testing.assert_array_equal(again(xy), model(xy))


def test_the_identity() -> None:
    xy = places()
    model = shift_model(0.0, 0.0)
    np.testing.assert_array_equal(model(xy), xy)
    np.testing.assert_array_equal(model.inverse(xy), xy)


@pytest.mark.parametrize("kind", KINDS)
def test_positions_that_are_not_finite_do_no_harm(kind: str) -> None:
    model, xy = a_model(kind), places(3)
    expected = model.inverse(xy[:2])
    with np.errstate(invalid="ignore"):
        found = model.inverse(np.vstack([xy[:2], [[np.inf, np.inf]], [[np.nan, 0.0]]]))
    np.testing.assert_allclose(found[:2], expected, atol=1e-6)
    assert not np.isfinite(found[2:]).all(axis=1).any()


def test_positions_that_nothing_leads_to_have_no_inverse() -> None:
    """X + x² / 2 has no values below -1/2; from there on it leads back by √(1 + 2 x) - 1."""
    bend = np.zeros((6, 2))
    bend[3, 0] = 0.5
    model = PolynomialModel("polynomial2", Frame(Affine.identity()), bend)
    xy = np.array([[-2.0, 0.3], [-0.6, 0.0], [-0.4, -1.0], [1.5, 2.0]])
    expected = np.column_stack([np.sqrt(np.maximum(1 + 2 * xy[2:, 0], 0)) - 1, xy[2:, 1]])
    found = model.inverse(xy)
    assert np.isnan(found[:2]).all()
    np.testing.assert_allclose(found[2:], expected, atol=1e-6)


@pytest.mark.parametrize("kind", ["affine", "polynomial2", "tps"])
def test_the_inverse_of_a_map_to_pixels(kind: str) -> None:
    """Images without georeferencing claim pixels, far from map coordinates and upside down."""
    xy = places(40)
    px = (xy - CORNER) * [0.1, -0.1] + [0, 1000]
    px += 2 * np.sin((xy - CORNER) / 4000)
    model = fit_model(kind, xy, px)
    np.testing.assert_allclose(model.inverse(model(xy)), xy, atol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_a_model_on_a_lattice_is_one_on_the_map(kind: str) -> None:
    model = a_model(kind)
    to_map = Affine(10, 0.5, 300, -0.2, -10, 900)
    lattice_xy = places()
    moved = model.on_map(to_map)
    np.testing.assert_allclose(
        moved(apply_affine(to_map, lattice_xy)), apply_affine(to_map, model(lattice_xy)), rtol=1e-9
    )


def test_a_frame_puts_the_scene_within_one() -> None:
    xy = places()
    frame = Frame.around(xy)
    uv = frame.enter(xy)
    assert np.abs(uv).max() == pytest.approx(1)
    np.testing.assert_allclose(frame.leave(uv), xy, rtol=1e-12)
    single = Frame.around(xy[:1])
    np.testing.assert_allclose(single.enter(xy[:1]), [[0, 0]])


def test_monomials_rise_by_degree() -> None:
    assert monomials(np.array([[2.0, 3.0]]), 2).tolist() == [[1, 2, 3, 4, 6, 9]]
    assert [monomials(np.zeros((1, 2)), degree).shape[1] for degree in range(4)] == [1, 3, 6, 10]


def test_the_thin_plate_kernel() -> None:
    kernel = thin_plate_kernel(np.array([[0.0, 0.0], [3.0, 4.0]]), np.array([[0.0, 0.0]]))
    np.testing.assert_allclose(kernel, [[0], [25 * np.log(5)]])


@pytest.mark.parametrize(
    "damage",
    [
        {"kind": "quintic"},
        {"coefficients": [[1, 2]]},
        {"frame": [1, 2]},
        {"kind": "tps"},
    ],
)
def test_damaged_json_is_refused(damage: dict[str, object]) -> None:
    values = a_model("affine").to_json() | damage
    with pytest.raises((KeyError, ValueError, TypeError)):
        model_from_json(values)
