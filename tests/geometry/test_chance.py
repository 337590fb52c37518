from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from groundtie.geometry.chance import (
    agreement_probability,
    log10_chance,
    log10_false_alarms,
    log10_least_false_alarms,
)


def test_the_tolerance_circle_over_the_search_square() -> None:
    assert agreement_probability(2.0, 16) == pytest.approx(4 * math.pi / 33**2)
    assert agreement_probability(100.0, 2) == 1.0
    inside = np.hypot(*np.mgrid[-400:401, -400:401]) <= 100
    assert agreement_probability(100.0, 400) == pytest.approx(inside.mean(), rel=1e-3)


@pytest.mark.slow
@settings(max_examples=200)
@given(total=st.integers(1, 300), share=st.floats(0, 1), probability=st.floats(1e-3, 0.999))
def test_chance_is_the_binomial_tail(total: int, share: float, probability: float) -> None:
    agreeing = round(share * total)
    tail = binom.sf(agreeing - 1, total, probability)
    found = log10_chance(agreeing, total, probability)
    if tail > 1e-290:
        assert found == pytest.approx(math.log10(tail), rel=1e-6, abs=1e-9)
    assert found <= 1e-9


def test_chance_of_few_matches_counted_by_hand() -> None:
    """At least 2 of 3 at p = 1/10: 3 · 0.01 · 0.9 + 0.001 = 0.028."""
    assert 10 ** log10_chance(2, 3, 0.1) == pytest.approx(0.028)
    assert log10_chance(0, 5, 0.1) == 0.0
    assert log10_chance(0, 0, 0.1) == 0.0
    assert log10_chance(5, 5, 1.0) == pytest.approx(0.0, abs=1e-12)


def test_chance_far_below_the_smallest_number() -> None:
    """All of n agree with probability p^n; the verdict must not become infinite."""
    assert log10_chance(2000, 2000, 0.01) == pytest.approx(-4000)
    exact = sum(
        math.comb(600, k) * Fraction(1, 90) ** k * Fraction(89, 90) ** (600 - k)
        for k in range(500, 601)
    )
    expected = math.log10(exact.numerator) - math.log10(exact.denominator)
    assert log10_chance(500, 600, 1 / 90) == pytest.approx(expected, rel=1e-9)


def test_points_without_any_residual_are_as_unlikely_as_their_digits() -> None:
    """Of 12 points, 3 fix the model and 9 agree within 1e-6 px: p = 1e-12 π / area, each."""
    found = log10_least_false_alarms(np.zeros(12), 100.0**2, 3)
    alone = log10_false_alarms(12, 12, np.pi * 1e-12 / 100.0**2, 3)
    assert np.isfinite(found)
    assert found == pytest.approx(alone + math.log10(9))


@pytest.mark.slow
@settings(max_examples=100)
@given(
    total=st.integers(5, 200),
    agreeing=st.integers(4, 200),
    sample=st.integers(1, 3),
    probability=st.floats(1e-3, 0.5),
)
def test_false_alarms_are_subsets_times_the_tail_of_the_rest(
    total: int, agreeing: int, sample: int, probability: float
) -> None:
    agreeing = min(agreeing, total)
    tail = binom.sf(agreeing - sample - 1, total - sample, probability)
    expected = math.log10(math.comb(total, sample)) + math.log10(max(tail, 1e-300))
    if tail > 1e-290:
        found = log10_false_alarms(agreeing, total, probability, sample)
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("sample", [1, 2, 3])
def test_a_model_that_only_its_own_sample_agrees_with_is_none(sample: int) -> None:
    assert log10_false_alarms(sample, 50, 0.01, sample) == math.inf
    assert log10_false_alarms(sample + 1, 50, 0.01, sample) < math.inf


def test_random_matches_raise_no_false_alarm() -> None:
    """A-contrario reasoning: of random scenes, at most one in 1/ε has a model below ε."""
    rng = np.random.default_rng(0)
    radius, probability, alarms = 12, agreement_probability(2.0, 12), 0
    for _ in range(300):
        matches = rng.uniform(-radius - 0.5, radius + 0.5, (40, 2))
        gaps = np.hypot(*(matches[:, None] - matches[None]).transpose(2, 0, 1))
        most = int((gaps < 2.0).sum(axis=1).max())
        alarms += log10_false_alarms(most, 40, probability, 1) < -1
    assert alarms <= 30
