from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundtie.similarity.binning import BINNINGS, MASKED, bin_edges, to_bins


def image(seed: int = 0, shape: tuple[int, int] = (64, 80)) -> np.ndarray:
    return np.random.default_rng(seed).lognormal(3.0, 1.2, shape).astype(np.float32)


def everywhere(values: np.ndarray) -> np.ndarray:
    return np.ones(values.shape, bool)


@pytest.mark.parametrize("bins", [2, 10, 16, 64])
def test_equal_frequency_bins_hold_equally_many(bins: int) -> None:
    values = image()
    counts = np.bincount(to_bins(values, everywhere(values), bins).ravel(), minlength=bins)
    assert len(counts) == bins
    assert np.ptp(counts) <= 2


def test_bins_of_a_large_image_hold_nearly_equally_many() -> None:
    """Quantiles of a sample are accurate to a few per cent of a bin's share."""
    values = image(shape=(700, 500))
    counts = np.bincount(to_bins(values, everywhere(values), 16).ravel(), minlength=16)
    np.testing.assert_allclose(counts / values.size, 1 / 16, rtol=0.05)


@pytest.mark.parametrize("bins", [2, 7, 32, 128])
def test_linear_bins_are_those_of_the_thesis(bins: int) -> None:
    """S eq 3.38: the range of the values is divided evenly; the largest is in the last bin."""
    values = image()
    low, high = values.min(), values.max()
    scaled = np.floor((values.astype(float) - low) / (high - low) * bins)
    expected = np.minimum(scaled, bins - 1)
    found = to_bins(values, everywhere(values), bins, "linear")
    # Values on an edge may fall on either side in single precision.
    assert (found == expected).mean() > 0.999
    assert np.abs(found - expected).max() <= 1
    counts = np.bincount(found.ravel(), minlength=bins)
    histogram, _ = np.histogram(values, bins)
    assert np.abs(counts - histogram).sum() <= 4


@settings(max_examples=60)
@given(
    bins=st.integers(2, 255),
    binning=st.sampled_from(BINNINGS),
    seed=st.integers(0, 5),
    share=st.floats(0, 1),
)
def test_bins_are_in_range_and_rise_with_the_value(
    bins: int, binning: str, seed: int, share: float
) -> None:
    values = image(seed, (20, 25))
    valid = np.random.default_rng(seed).random(values.shape) < share
    found = to_bins(values, valid, bins, binning)
    assert found.dtype == np.uint8
    assert (found[~valid] == MASKED).all()
    assert (found[valid] < bins).all()
    order = np.argsort(values[valid])
    assert (np.diff(found[valid][order].astype(int)) >= 0).all()
    assert bin_edges(values[valid], bins, binning).shape == (bins - 1,)


@pytest.mark.parametrize("binning", BINNINGS)
def test_invalid_pixels_have_no_say(binning: str) -> None:
    values = image()
    valid = np.random.default_rng(1).random(values.shape) < 0.7
    spoiled = np.where(valid, values, np.float32(1e9))
    np.testing.assert_array_equal(
        to_bins(values, valid, 16, binning), to_bins(spoiled, valid, 16, binning)
    )


@pytest.mark.parametrize("binning", BINNINGS)
def test_a_rising_scale_changes_nothing(binning: str) -> None:
    values = image()
    found = to_bins(values, everywhere(values), 16, binning)
    scaled = to_bins(values * 4 + 8, everywhere(values), 16, binning)
    assert (found == scaled).mean() > 0.999
    if binning == "equal-frequency":
        logarithm = to_bins(np.log(values), everywhere(values), 16, binning)
        assert (found == logarithm).mean() > 0.999


@pytest.mark.parametrize("binning", BINNINGS)
def test_constant_values_share_one_bin(binning: str) -> None:
    values = np.full((5, 6), 7, np.float32)
    assert len(np.unique(to_bins(values, everywhere(values), 8, binning))) == 1
    assert (to_bins(values, ~everywhere(values), 8, binning) == MASKED).all()
