from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from masks.scenes import scene_of

from groundtie.masks.town import PERHAPS_TOWN_SHARE, share_of_strong_scatterers
from groundtie.rasters.kernels import interpolate


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_the_share_of_strong_scatterers_is_that_of_what_was_drawn(
    tmp_path: Path, share: float
) -> None:
    random = np.random.default_rng(0)
    power = np.ones((400, 400))
    power[: int(400 * share)] = 20.0
    image = np.sqrt(power * random.gamma(4, 1 / 4, power.shape)).astype(np.float32)
    assert share_of_strong_scatterers(scene_of(tmp_path / "a.tif", image)) == pytest.approx(
        share, abs=0.005
    )


def test_a_kernel_that_undershoots_makes_no_decibels(tmp_path: Path) -> None:
    """A radar image that was resampled has as many strong scatterers, decibels have none."""
    random = np.random.default_rng(0)
    town = np.full((200, 200), 50.0)
    town[:, :60] = 2000.0
    town *= np.sqrt(random.gamma(1, 1, town.shape))
    rows, cols = np.mgrid[:199, :199]
    places = np.stack([cols + 0.5, rows + 0.5]).astype(np.float32)
    resampled = interpolate(town.astype(np.float32), places, "cubic")
    assert resampled.reshape(-1).min() < 0
    resampled[:4, 64:68] = -1.0
    share = share_of_strong_scatterers(scene_of(tmp_path / "a.tif", resampled))
    assert share == pytest.approx(0.3, abs=0.02)
    decibels = 20 * np.log10(town / town.max())
    assert share_of_strong_scatterers(scene_of(tmp_path / "b.tif", decibels)) == 0


def test_fields_are_no_town(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    fields = np.kron(random.uniform(200, 500, (20, 20)), np.ones((20, 20)))
    fields *= np.sqrt(random.gamma(1, 1, fields.shape))
    scene = scene_of(tmp_path / "a.tif", fields.astype(np.float32))
    assert share_of_strong_scatterers(scene) < PERHAPS_TOWN_SHARE
