"""Words, and numbers, in sentences for users."""

from __future__ import annotations

import math

import numpy as np
import pytest

from groundtie.wording import counted, signed


def test_one_thing_and_several() -> None:
    assert [counted(n, "row") for n in (0, 1, 2)] == ["0 rows", "1 row", "2 rows"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.234, "+1.23"),
        (-1.236, "-1.24"),
        (-0.001, "+0.00"),
        (np.float64(-0.0), "+0.00"),
        (-0.006, "-0.01"),
        (math.nan, "+nan"),
    ],
)
def test_what_rounds_to_0_is_not_negative(value: float, text: str) -> None:
    assert signed(value) == text
