from __future__ import annotations

import numpy as np
import pytest
from textured_pairs import texture

from groundtie.rasters.patch import Patch
from groundtie.similarity.unexplained import unexplained

SIDE = 120


def stack(values: np.ndarray, hidden: object = None) -> Patch:
    """Return a stack with one window."""
    valid = np.ones(values.shape, bool)
    if hidden is not None:
        valid[hidden] = False
    return Patch(values[None].astype(np.float32), valid[None])


def ground(place: int) -> np.ndarray:
    return texture(SIDE, SIDE, place)


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (0.4, 900.0), (-3.0, 10_000.0)])
def test_nothing_is_left_of_a_copy_in_any_contrast(gain: float, offset: float) -> None:
    reference = 1000 + 200 * ground(1)
    left = unexplained(stack(reference), stack(gain * reference + offset))
    assert np.abs(left.values).max() < 0.01 * abs(gain) * reference.std()


def test_a_bright_scatterer_elsewhere_changes_nothing() -> None:
    """A copy leaves nothing except around it, where rounding is as large as the ground."""
    reference = 500 + 100 * ground(1)
    reference[20, 20] = 5e6
    left = unexplained(stack(reference), stack(2 * reference + 10))
    assert not left.valid[0][40:].any()


def test_other_ground_is_left_that_a_copy_was_blended_into() -> None:
    reference, other = ground(1), ground(2)
    left = unexplained(stack(reference), stack(0.5 * reference + 0.5 * other)).values[0]
    assert correlation(left, other) > 0.7
    assert abs(correlation(left, reference)) < 0.1


def test_each_window_is_explained_by_itself() -> None:
    windows = [stack(ground(place)) for place in (1, 2, 3)]
    both = [
        Patch(*(np.concatenate(of) for of in zip(*parts, strict=True)))
        for parts in [
            [(one.values, one.valid) for one in order] for order in (windows, windows[::-1])
        ]
    ]
    left = unexplained(*both).values
    alone = [
        unexplained(one, other).values for one, other in zip(windows, windows[::-1], strict=True)
    ]
    assert left == pytest.approx(np.concatenate(alone), abs=1e-4)


def test_invalid_pixels_explain_nothing_and_are_not_left() -> None:
    reference, hidden = ground(1), np.s_[40:60, 30:70]
    drawn = reference.copy()
    drawn[hidden] = 1e6
    left = unexplained(stack(ground(2)), stack(drawn, hidden))
    assert not left.valid[0][hidden].any()
    assert left.valid.sum() == SIDE**2 - 20 * 40
    # A copy leaves nothing.
    copy = unexplained(stack(reference), stack(drawn, hidden))
    assert not copy.valid.any()


def test_flat_windows_explain_nothing() -> None:
    left = unexplained(stack(np.full((SIDE, SIDE), 7.0)), stack(ground(1)))
    assert np.isfinite(left.values).all()
    assert correlation(left.values, ground(1)) > 0.7
