"""Poses are put between windows as they are said to be."""

from __future__ import annotations

import numpy as np
import pytest
from posed_windows import window

from benchmarks.injected import BLACK, CORNERS, MASKED, WHOLE, Injection, pose_errors, unit_range
from groundtie.pose.pose import Pose

SHAPE = (60, 80)
# An image of which the reference's window is the middle.
IMAGE = window((160, 180)).values / 1000
POSES = (Pose(), Pose(25.0, 1.0, (5.0, -8.0)), Pose(-70.0, 1.5, (3.0, 9.0)))


@pytest.mark.parametrize("pose", POSES, ids=str)
def test_the_input_shows_what_theory_says(pose: Pose) -> None:
    reference, input = Injection(pose).windows(IMAGE, SHAPE)
    np.testing.assert_array_equal(reference.values, IMAGE[50:110, 50:130])
    shape = tuple(round(side * pose.scale) for side in SHAPE)
    assert input.values.shape == shape
    expected = window((shape[0], shape[1]), pose).values / 1000
    off = (input.values - expected)[input.valid]
    # Lanczos on waves of 5 px and more.
    assert np.abs(off).mean() < 0.02 * IMAGE.std()


def test_a_coarser_input_is_smoothed_first() -> None:
    """What is finer than an input's pixels does not come back as something coarser."""
    fine = 0.5 + 0.4 * np.cos(np.pi * 0.9 * np.arange(180)) * np.ones((160, 1))
    _, input = Injection(Pose(scale=0.5)).windows(fine.astype(np.float32), SHAPE)
    assert input.values[input.valid].std() < 0.05


def test_corners() -> None:
    pose = Pose(30.0)
    patches = {c: Injection(pose, c).windows(IMAGE, SHAPE)[1] for c in CORNERS}
    assert patches[WHOLE].valid.all()
    assert patches[BLACK].valid.all()
    outside = ~patches[MASKED].valid
    # The corners that a turned rectangle leaves, which are black.
    assert 0.1 < outside.mean() < 0.5
    assert outside[0, 0] and not outside[30, 40]
    for which in (MASKED, BLACK):
        assert (patches[which].values[outside] == 0).all()
        np.testing.assert_array_equal(
            patches[which].values[~outside], patches[WHOLE].values[~outside]
        )


def test_what_the_image_does_not_show_is_masked() -> None:
    _, input = Injection(Pose(shift_px=(-60.0, 0.0))).windows(IMAGE, SHAPE)
    assert input.valid[:, :69].all()
    assert not input.valid[:, 71:].any()


def test_noise_has_its_variance_and_stays_in_range() -> None:
    grey = np.full((160, 180), 0.5, np.float32)
    for variance in (0.001, 0.005):
        reference, input = Injection(Pose(), WHOLE, variance, 1).windows(grey, SHAPE)
        for patch in (reference, input):
            assert patch.values.var() == pytest.approx(variance, rel=0.1)
        assert abs(np.corrcoef(reference.values.ravel(), input.values.ravel())[0, 1]) < 0.1
    bright, _ = Injection(Pose(), WHOLE, 0.005).windows(np.ones((160, 180), np.float32), SHAPE)
    assert bright.values.max() == 1
    _, corners = Injection(Pose(30.0), BLACK, 0.005).windows(grey, SHAPE)
    assert corners.values[0, 0] == 0


def test_grey_values_are_scaled_to_one() -> None:
    bands = np.stack([np.arange(10_000).reshape(100, 100), np.zeros((100, 100))])
    found = unit_range(bands)
    assert found.dtype == np.float32
    assert (found.min(), found.max()) == (0, 1)
    assert found[50, 0] == pytest.approx(0.5, abs=0.01)


def test_errors_of_a_pose() -> None:
    truth = Pose(179.0, 2.0, (3.0, 4.0))
    assert pose_errors(truth, truth, SHAPE) == (0, 0)
    turned, error = pose_errors(Pose(179.0, 2.0, (9.0, 12.0)), truth, SHAPE)
    assert (turned, error) == (0, pytest.approx(5))
    # A turn by a small angle moves a place by the angle times its distance from the centre.
    turned, error = pose_errors(Pose(-179.0, 2.0, (3.0, 4.0)), truth, SHAPE)
    assert turned == pytest.approx(2)
    assert error == pytest.approx(np.radians(2) * np.hypot(80, 60) / np.sqrt(12), rel=0.06)
