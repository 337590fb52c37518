"""Simulated pairs are made once, and carry their own truth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import groundtie
from benchmarks import simulations
from benchmarks.attempt import Pair, on_pixels
from benchmarks.simulations import Simulation
from groundtie.errors import TransformFileError

SMALL = Simulation(size=128, density="rural", seed=3, shift=5.0)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cache")
    SMALL.pair(folder)
    return folder


@pytest.fixture
def pair(cache: Path) -> Pair:
    return SMALL.pair(cache)


def stored(pair: Pair) -> np.ndarray:
    """The truth's matrix from reference to input pixels as the simulator wrote it."""
    values = json.loads((pair.reference.parent / "truth.json").read_text())
    return np.array(values["reference_to_input"])


def test_the_truth_is_the_simulators(pair: Pair) -> None:
    matrix = stored(pair)
    assert pair.truth is not None and pair.lattice is not None and pair.sigma_px == 0
    np.testing.assert_allclose(pair.truth.linear, matrix[:, :2], atol=1e-6)
    for truth in (pair.truth, pair.lattice):
        assert truth.error_px(lambda px: px @ matrix[:, :2].T + matrix[:, 2]) < 1e-5


def test_believing_the_georeferencing_is_wrong_by_shift_and_warp(pair: Pair) -> None:
    assert pair.lattice is not None
    error = pair.lattice.error_px(lambda px: px)
    # A shift of 5 px, and a warp of at most 4 px.
    assert 1 < error < 9


def test_its_own_transform_has_no_error(pair: Pair) -> None:
    assert pair.truth is not None
    truth = groundtie.load_transform(pair.reference.parent / "truth.json")
    assert pair.truth.error_px(on_pixels(truth, pair.reference)) < 1e-5


def test_a_pair_is_made_once(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise AssertionError("made again")

    monkeypatch.setattr(simulations.groundtie, "simulate", fail, raising=False)
    assert SMALL.pair(cache).reference.exists()
    for other in (replace(SMALL, seed=4), replace(SMALL, shift=6.0), replace(SMALL, size=129)):
        with pytest.raises(AssertionError, match="made again"):
            other.pair(cache)


def test_a_pair_does_not_outlive_its_simulator(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    monkeypatch.setattr(simulations, "simulator_version", lambda: "another")
    monkeypatch.setattr(
        simulations.groundtie, "simulate", lambda folder, **_: made.append(folder), raising=False
    )
    with pytest.raises(TransformFileError):  # the simulator of this test makes no files
        SMALL.pair(cache)
    assert [folder.name for folder in made] == ["rural-128-5-3-another"]


def test_the_fingerprint_follows_the_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = tmp_path / "files.py"
    module.write_text("a = 1\n")
    monkeypatch.setattr(simulations.files, "__file__", str(module))
    before = simulations.simulator_version()
    assert simulations.simulator_version() == before
    module.write_text("a = 2\n")
    assert simulations.simulator_version() != before
