"""Rotation, scale and shift by Fourier–Mellin."""

from __future__ import annotations

import numpy as np
import pytest
from posed_windows import error_px, masked, shifted_by, turned_by, window

from groundtie.context import Context
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose, PoseFound
from groundtie.rasters.patch import Patch
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.fourier_mellin import (
    RETURNED,
    correlate_spectra,
    fourier_mellin,
    rotations,
    spectra,
    spectrum,
)
from groundtie.studies.spectra import ANGLE_STEP_DEG, ANGLES, half_turns

GREY, FIELD = SimilaritySettings("ncc"), SimilaritySettings("fused")
REFERENCE = window((160, 160))
ANY = SearchLimits(40.0, 180.0, (0.5, 2.0))


def is_right(found: PoseFound, truth: Pose) -> bool:
    return turned_by(found, truth) < 0.1 and error_px(found, truth, (160, 160)) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("settings", [GREY, FIELD], ids=lambda s: s.similarity)
@pytest.mark.parametrize(
    ("truth", "side"),
    [
        (Pose(), 160),
        (Pose(3.0), 160),
        (Pose(-28.3, 1.0, (9.4, -6.2)), 160),
        (Pose(67.7, 0.83, (4.0, 8.5)), 150),
        (Pose(151.2, 1.31, (-12.0, 3.3)), 210),
        (Pose(-119.9, 1.9, (20.0, 14.0)), 300),
        (Pose(90.0, 0.55, (1.5, -2.5)), 90),
        (Pose(-180.0, 1.0, (5.0, 5.0)), 160),
    ],
    ids=str,
)
def test_poses_are_found(
    truth: Pose, side: int, settings: SimilaritySettings, context: Context
) -> None:
    found = fourier_mellin(REFERENCE, window((side, side), truth), ANY, settings, context)
    assert is_right(found[0], truth)


def test_better_than_the_lattice_of_angles(context: Context) -> None:
    """[Patel2017] gets 2.8125° for 3°, the step of its lattice."""
    truth = Pose(3.1)
    assert truth.rotation_deg / ANGLE_STEP_DEG % 1 != 0
    found = fourier_mellin(REFERENCE, window((160, 160), truth), SearchLimits(5, 30), GREY, context)
    assert turned_by(found[0], truth) < 0.03


def test_windows_need_not_be_square(context: Context) -> None:
    truth = Pose(12.0, 1.1, (6.0, -9.0))
    found = fourier_mellin(window((150, 200)), window((190, 170), truth), ANY, GREY, context)
    assert is_right(found[0], truth)


def test_large_windows_are_tried_small(context: Context) -> None:
    truth = Pose(-41.0, 1.2, (-23.0, 31.0))
    found = fourier_mellin(window((330, 330)), window((330, 330), truth), ANY, GREY, context)
    assert is_right(found[0], truth)


def test_inverted_contrast(context: Context) -> None:
    truth = Pose(24.0, 1.2, (8.0, -5.0))
    input = window((200, 200), truth)
    inverted = Patch(1e4 / input.values, input.valid)
    assert is_right(fourier_mellin(REFERENCE, inverted, ANY, FIELD, context)[0], truth)


def test_noise(context: Context) -> None:
    truth = Pose(17.0, 0.9, (-7.0, 4.0))
    found = fourier_mellin(REFERENCE, window((160, 160), truth, noise=25.0), ANY, GREY, context)[0]
    assert turned_by(found, truth) < 0.3
    assert shifted_by(found, truth) < 0.5


@pytest.mark.parametrize("settings", [GREY, FIELD], ids=lambda s: s.similarity)
def test_masked_corners(settings: SimilaritySettings, context: Context) -> None:
    """The corners that a turned image does not fill, as [Patel2017] has them."""
    truth = Pose(25.0, 1.0, (6.0, -3.0))
    input = window((160, 160), truth)
    rows, cols = np.indices((160, 160)) - 79.5
    moved = np.stack([cols - 6.0, rows + 3.0])
    inside = np.abs(np.einsum("ij,jkl->ikl", np.linalg.inv(truth.linear), moved)).max(axis=0)
    corners = Patch(np.where(inside < 80, input.values, 0), inside < 80)
    found = fourier_mellin(REFERENCE, corners, SearchLimits(20, 30, (0.9, 1.1)), settings, context)
    assert is_right(found[0], truth)


def test_masked_pixels_do_not_count(context: Context) -> None:
    truth = Pose(25.0, 1.0, (6.0, -3.0))
    input = masked(window((160, 160), truth), slice(100, 130), slice(20, 50))
    found = fourier_mellin(REFERENCE, input, SearchLimits(20, 30, (0.9, 1.1)), GREY, context)
    assert is_right(found[0], truth)


@pytest.mark.slow
@pytest.mark.parametrize(
    "limits",
    [
        SearchLimits(20.0, 10.0, (0.9, 1.1)),
        SearchLimits(20.0, 30.0),
        SearchLimits(5.0, 120.0, (0.5, 2.0)),
        SearchLimits(20.0, 0.0, (0.5, 2.0)),
        SearchLimits(20.0, 180.0, (1.3, 1.6)),
    ],
    ids=str,
)
def test_limits_are_kept(limits: SearchLimits, context: Context) -> None:
    truth = Pose(24.0, 1.2, (8.0, -12.0))
    for one in fourier_mellin(REFERENCE, window((200, 200), truth), limits, GREY, context):
        assert abs(one.pose.rotation_deg) <= limits.rotation_deg
        assert limits.scale[0] <= one.pose.scale <= limits.scale[1]
        assert np.abs(one.pose.shift_px).max() <= limits.radius


def test_a_known_scale_is_exact(context: Context) -> None:
    truth = Pose(24.0, 1.25, (8.0, -12.0))
    limits = SearchLimits(20.0, 30.0, (1.25, 1.25))
    (found, *_) = fourier_mellin(REFERENCE, window((200, 200), truth), limits, GREY, context)
    assert found.pose.scale == 1.25
    assert is_right(found, truth)


def test_the_half_turn_is_told_by_the_shift(context: Context) -> None:
    for degrees in (20.0, -160.0):
        truth = Pose(degrees)
        found = fourier_mellin(REFERENCE, window((160, 160), truth), ANY, GREY, context)
        assert turned_by(found[0], truth) < 0.1
        assert all(turned_by(other, truth) > 1 for other in found[1:])


@pytest.mark.slow
def test_another_place_does_not_stand_out(context: Context) -> None:
    true = fourier_mellin(REFERENCE, window((160, 160)), ANY, GREY, context)[0].height
    found = fourier_mellin(REFERENCE, window((160, 160), seed=5), ANY, GREY, context)
    assert 0 < len(found) <= RETURNED
    assert all(one.height < true / 5 for one in found)


def test_threads_change_nothing(context: Context, one_thread: Context) -> None:
    input = window((160, 160), Pose(10.0))
    alone = fourier_mellin(REFERENCE, input, ANY, GREY, one_thread)
    assert fourier_mellin(REFERENCE, input, ANY, GREY, context) == alone


@pytest.mark.parametrize("settings", [GREY, FIELD], ids=lambda s: s.similarity)
def test_what_has_no_content_has_no_pose(settings: SimilaritySettings, context: Context) -> None:
    flat = Patch(np.full((90, 80), 3, np.float32), np.ones((90, 80), bool))
    nothing = Patch(REFERENCE.values, np.zeros(REFERENCE.valid.shape, bool))
    for empty in (flat, nothing):
        assert fourier_mellin(REFERENCE, empty, ANY, settings, context) == []
        assert fourier_mellin(empty, REFERENCE, ANY, settings, context) == []


def test_a_wave_is_a_point_of_the_spectrum() -> None:
    """A wave along a direction 30° clockwise from straight up, of an eighth of a cycle a pixel."""
    rows, cols = np.indices((128, 128), float)
    angle = np.radians(30)
    along = np.sin(angle) * cols - np.cos(angle) * rows
    fading = np.hanning(128)[:, None] * np.hanning(128)
    values = spectrum((np.cos(2 * np.pi * along / 8) * fading).astype(np.float32), 128)
    frequency = np.geomspace(0.015, 0.4, values.shape[1])
    near = int(np.abs(frequency - 1 / 8).argmin())
    assert values[:, near].argmax() * ANGLE_STEP_DEG == pytest.approx(30, abs=1)


def test_spectra_are_alike_at_all_frequencies() -> None:
    for values in spectra(REFERENCE, window((160, 160), seed=2), GREY, disc=True):
        np.testing.assert_allclose(values.mean(axis=0), 0, atol=1e-4)
        np.testing.assert_allclose(values.std(axis=0), 1, atol=1e-3)


def test_a_spectrum_does_not_change_with_the_shift() -> None:
    plain = np.zeros((128, 128), np.float32)
    plain[40:60, 50:63] = np.random.default_rng(0).normal(size=(20, 13))
    moved = np.roll(plain, (17, -9), axis=(0, 1))
    np.testing.assert_allclose(spectrum(plain, 128), spectrum(moved, 128), atol=1e-2)


def test_the_correlation_peaks_at_rotation_and_scale() -> None:
    truth = Pose(-33.0, 1.4)
    surface = correlate_spectra(*spectra(REFERENCE, window((224, 224), truth), GREY, disc=True))
    first, second, *_ = rotations(surface, ANY, 2)
    assert first.rotation_deg == pytest.approx(-33, abs=0.5)
    assert second.rotation_deg == pytest.approx(147, abs=0.5)
    assert first.scale == second.scale == pytest.approx(1.4, rel=0.02)


def test_no_variation_gives_no_turns() -> None:
    assert list(rotations(np.zeros((ANGLES, 64), np.float32), ANY, 3)) == []


def test_half_turns_within_limits() -> None:
    assert [p.rotation_deg for p in half_turns(20.0, 1.0, SearchLimits(1, 180))] == [20, -160]
    assert [p.rotation_deg for p in half_turns(-20.0, 1.0, SearchLimits(1, 180))] == [-20, 160]
    assert [p.rotation_deg for p in half_turns(20.0, 1.0, SearchLimits(1, 90))] == [20]
    assert [p.rotation_deg for p in half_turns(80.0, 1.0, SearchLimits(1, 110))] == [80, -100]
    assert list(half_turns(50.0, 1.0, SearchLimits(1, 30))) == []
