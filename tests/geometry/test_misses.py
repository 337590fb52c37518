"""How large the errors of held-out points are does not depend on how large they may be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from groundtie.geometry.misses import Misses

# Errors of exact matches among larger ones: all agree, within 2 px.
SIGMAS_PX = np.repeat([0.05, 0.5], [12, 24])


def missed(max_error_px: float) -> Misses:
    random = np.random.default_rng(0)
    px = random.uniform(0, 500, (len(SIGMAS_PX), 2))
    errors = SIGMAS_PX[:, None] * random.standard_normal(px.shape)
    return Misses(px, errors, radius_px=10, max_error_px=max_error_px)


@pytest.mark.parametrize("max_error_px", [0.1, 0.2, 0.5, 1.0, 3.0])
def test_a_smaller_largest_error_makes_no_error_smaller(max_error_px: float) -> None:
    found = missed(max_error_px)
    expected = math.sqrt((found.residuals_px**2).sum(axis=1).mean())
    assert found.agreeing == len(SIGMAS_PX)
    assert found.rmse_px == pytest.approx(expected, rel=0.02)
    assert found.rmse_px == missed(3.0).rmse_px
    np.testing.assert_array_equal(found.mixture.probability, missed(3.0).mixture.probability)


def test_errors_above_a_larger_one_are_still_seen() -> None:
    random = np.random.default_rng(0)
    errors = 7.0 * random.standard_normal((200, 2))
    found = Misses(errors, errors, radius_px=40, max_error_px=8.0)
    assert found.rmse_px == pytest.approx(7.0 * math.sqrt(2), rel=0.1)
