"""Simulated pairs of radar images carry the misregistration that they say."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import rasterio

import groundtie
from benchmarks import sar_pairs
from benchmarks.attempt import Pair
from benchmarks.sar_pairs import SarPair
from groundtie.rasters.grid import apply_affine

SIZE = 300


def read(path: Path) -> np.ndarray:
    with rasterio.open(path) as source:
        return source.read(1)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def made(cache: Path) -> Pair:
    return SarPair(SIZE, "rural", 3, 4, opposite=True).pair(cache)


def correlation(pair: Pair, ground: np.ndarray, moved_px: float = 0.0) -> float:
    """Return the correlation on the ground, the input sampled where the truth says, or beside."""
    assert pair.truth is not None
    rows, cols = np.mgrid[:SIZE, :SIZE]
    truth = groundtie.load_transform(pair.reference.with_name("truth.json"))
    with rasterio.open(pair.reference) as source:
        centres = np.column_stack([cols.ravel(), rows.ravel()]) + 0.5
        xy = apply_affine(source.transform, centres)
    px = (truth(xy) + [moved_px, 0]).reshape(SIZE, SIZE, 2)
    reference, input = (
        cv2.GaussianBlur(np.log(read(path).astype(np.float32)), (0, 0), 1.5)
        for path in (pair.reference, pair.input)
    )
    seen = cv2.remap(input, px.astype(np.float32), None, cv2.INTER_LINEAR, borderValue=np.nan)
    both = (ground > 0) & np.isfinite(seen)
    return float(np.corrcoef(reference[both], seen[both])[0, 1])


def test_on_the_ground_images_lie_where_the_truth_says(made: Pair, cache: Path) -> None:
    ground = read(SarPair(SIZE, "rural", 3, 4, opposite=True).ground(cache))
    assert 0.1 < ground.mean() < 0.95
    right = correlation(made, ground)
    assert right > 0.3
    assert right > max(correlation(made, ground, moved) for moved in (-4.0, 4.0)) + 0.03


def test_both_images_have_their_own_speckle_and_the_wrong_georeferencing(made: Pair) -> None:
    assert made.truth is not None
    off = made.truth.input_px - made.truth.reference_px
    assert 5 < np.hypot(*off.T).mean() < 20
    reference, input = (np.log(read(path).astype(float)) for path in (made.reference, made.input))
    fine = [image - cv2.GaussianBlur(image, (0, 0), 1.0) for image in (reference, input)]
    assert abs(np.corrcoef(fine[0].ravel(), fine[1].ravel())[0, 1]) < 0.2


def test_a_pair_is_made_once(cache: Path, made: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise AssertionError("made again")

    monkeypatch.setattr(SarPair, "_write", fail)
    assert SarPair(SIZE, "rural", 3, 4, opposite=True).pair(cache).reference == made.reference
    monkeypatch.setattr(sar_pairs, "simulator_version", lambda: "another")
    with pytest.raises(AssertionError, match="made again"):
        SarPair(SIZE, "rural", 3, 4, opposite=True).pair(cache)
