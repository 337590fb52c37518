"""Statistics of known errors are the numbers that theory gives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from known_errors import normal_errors

from groundtie.assessment.statistics import Statistics


class TestStatistics:
    @pytest.mark.parametrize("sigma", [0.3, 2.5])
    def test_normal_errors_have_the_numbers_of_theory(self, sigma: float) -> None:
        """Rayleigh distribution; FGDC-STD-007.3: CE90 is 2.1460 standard deviations."""
        found = Statistics.of(normal_errors(1005, sigma))
        assert found.ce90 == pytest.approx(2.1460 * sigma, rel=1e-4)
        assert found.median == pytest.approx(sigma * math.sqrt(2 * math.log(2)), rel=1e-9)
        assert found.rmse == pytest.approx(sigma * math.sqrt(2), rel=1e-3)
        assert found.mean == pytest.approx(sigma * math.sqrt(math.pi / 2), rel=1e-3)
        np.testing.assert_allclose(found.std, sigma, rtol=0.01)
        np.testing.assert_allclose(found.bias, 0, atol=0.01 * sigma)

    def test_drawn_errors_scatter_around_theory(self) -> None:
        count, sigma = 20_000, np.array([0.5, 2.0])
        errors = np.random.default_rng(0).normal([0.7, -1.1], sigma, (count, 2))
        found = Statistics.of(errors)
        # Four standard errors of a mean, and of a standard deviation
        assert np.all(np.abs(found.bias - np.array([0.7, -1.1])) < 4 * sigma / math.sqrt(count))
        assert np.all(np.abs(found.std - sigma) < 4 * sigma / math.sqrt(2 * count))

    def test_a_few_errors_by_hand(self) -> None:
        found = Statistics.of(np.array([[3.0, 4.0], [0.0, 1.0], [0.0, -2.0], [-1.0, 0.0]]))
        assert found.rmse == pytest.approx(math.sqrt((25 + 1 + 4 + 1) / 4))
        assert found.mean == pytest.approx((5 + 1 + 2 + 1) / 4)
        assert found.median == pytest.approx(1.5)
        assert found.largest == 5
        assert found.ce90 == 5
        assert found.bias == pytest.approx((0.5, 0.75))
        assert found.std == pytest.approx((1.5, math.sqrt((17 + 4) / 4 - 0.75**2)))

    def test_a_pure_shift_is_all_bias(self) -> None:
        found = Statistics.of(np.tile([3.0, -4.0], (7, 1)))
        lengths = (found.rmse, found.mean, found.median, found.ce90, found.largest)
        assert lengths == pytest.approx((5,) * 5)
        assert (found.bias, found.std) == ((3, -4), (0, 0))

    @given(
        hnp.arrays(float, st.tuples(st.integers(1, 30), st.just(2)), elements=st.floats(-1e3, 1e3))
    )
    @pytest.mark.slow
    def test_relations_that_always_hold(self, errors: np.ndarray) -> None:
        found = Statistics.of(errors)
        total = sum(value**2 for value in (*found.bias, *found.std))
        assert found.rmse**2 == pytest.approx(total, abs=1e-6)
        tiny = 1e-9
        assert found.mean <= found.rmse + tiny
        assert found.median <= found.ce90 + tiny <= found.largest + 2 * tiny

    def test_nothing_measured_is_not_a_number(self) -> None:
        values = Statistics.of(np.zeros((0, 2))).summary("px", ("col", "row"))
        assert list(values) == [
            "rmse_px",
            "mean_px",
            "median_px",
            "ce90_px",
            "max_px",
            "bias_col_px",
            "bias_row_px",
            "std_col_px",
            "std_row_px",
        ]
        assert all(math.isnan(value) for value in values.values())


def test_statistics_in_another_unit_are_those_of_its_errors() -> None:
    errors = np.random.default_rng(0).normal(size=(50, 2))
    scaled, expected = Statistics.of(errors).scaled(0.5), Statistics.of(0.5 * errors)
    assert scaled.summary("m", ("x", "y")) == pytest.approx(expected.summary("m", ("x", "y")))
