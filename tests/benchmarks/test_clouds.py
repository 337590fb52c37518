"""Clouds hide what their mask says, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from textured_pairs import texture

from benchmarks.clouds import clouds_over, fractal


def test_clouds_cover_the_share_and_are_bright() -> None:
    image = (100 + 10 * texture(200, 260)).astype(np.float32)
    clouds = clouds_over(image, 0.35, 1)
    clouded = clouds.over(image)
    assert clouds.hidden.mean() == pytest.approx(0.35, abs=0.08)
    assert clouded[clouds.hidden].mean() > np.quantile(image, 0.9)
    clear = ~clouds.hidden & (clouded == image)
    assert clear.mean() > 0.4


def test_under_clouds_little_of_the_ground_is_left() -> None:
    image = (100 + 10 * texture(200, 260)).astype(np.float32)
    other = (100 + 10 * texture(200, 260, 9)).astype(np.float32)
    thick = np.quantile(fractal(image.shape, 3.2, np.random.default_rng(1)), 0.85)
    hidden = fractal(image.shape, 3.2, np.random.default_rng(1)) > thick
    one, same = (clouds_over(each, 0.35, 1).over(each)[hidden] for each in (image, other))
    assert np.corrcoef(one, image[hidden])[0, 1] < 0.3
    assert np.corrcoef(one, same)[0, 1] > 0.9


def test_clouds_have_no_colour() -> None:
    bands = np.stack([150 + 10 * texture(200, 260), 50 + 10 * texture(200, 260, 4)])
    clouds = clouds_over(bands.mean(axis=0).astype(np.float32), 0.35, 1)
    clouded = clouds.over(bands.astype(np.float32))
    thick = clouds.opacity > 0.96
    assert np.abs(clouded[0] - clouded[1])[thick].mean() < 5
    # The mean of the bands is the grey image under the same clouds.
    grey = clouds.over(bands.mean(axis=0).astype(np.float32))
    np.testing.assert_allclose(clouded.mean(axis=0), grey, rtol=1e-4)


def test_seeds_make_clouds() -> None:
    image = np.zeros((64, 64), np.float32)
    masks = [clouds_over(image, 0.3, seed).hidden for seed in (1, 1, 2)]
    assert (masks[0] == masks[1]).all()
    assert not (masks[0] == masks[2]).all()


def test_fields_are_normal_and_rough_at_large_scales() -> None:
    field = fractal((128, 96), 3.0, np.random.default_rng(0))
    assert field.mean() == pytest.approx(0, abs=1e-9)
    assert field.std() == pytest.approx(1)
    power = np.abs(np.fft.fft2(field)) ** 2
    assert power[1:4, 1:4].mean() > 100 * power[30:40, 30:40].mean()
