"""Limits of a search: what is more than a shift."""

from __future__ import annotations

import pytest

from groundtie.geometry.limits import SearchLimits


@pytest.mark.parametrize(
    ("limits", "is_shift"),
    [
        (SearchLimits(200.0), True),
        (SearchLimits(200.0, rotation_deg=5.0), False),
        (SearchLimits(200.0, scale=(0.9, 1.0)), False),
    ],
)
def test_a_search_for_shifts_knows_no_rotation_and_no_scale(
    limits: SearchLimits, is_shift: bool
) -> None:
    assert limits.is_shift == is_shift
