"""Rotation and shift by projections."""

from __future__ import annotations

import numpy as np
import pytest
from posed_windows import masked, shifted_by, turned_by, window

from groundtie.context import Context
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose, PoseFound
from groundtie.rasters.patch import Patch
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.radon import (
    RETURNED,
    projection_spectra,
    radon,
    radon_transform,
    rotations,
    shift_along,
    shift_by_projections,
)
from groundtie.studies.spectra import ANGLE_STEP_DEG, ANGLES, evened, log_power

GREY, FIELD = SimilaritySettings("ncc"), SimilaritySettings("fused")
REFERENCE = window((160, 160))
LIMITS = SearchLimits(40.0, 30.0)


def is_right(found: PoseFound, truth: Pose) -> bool:
    return turned_by(found, truth) < 0.25 and shifted_by(found, truth) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("settings", [GREY, FIELD], ids=lambda s: s.similarity)
@pytest.mark.parametrize(
    "truth",
    [
        Pose(),
        Pose(0.0, 1.0, (20.0, 35.0)),
        Pose(20.0, 1.0, (5.0, 17.0)),
        Pose(-10.0, 1.0, (35.0, 17.0)),
        Pose(25.3, 1.0, (-14.2, 30.6)),
    ],
    ids=str,
)
def test_poses_of_thesis_p(truth: Pose, settings: SimilaritySettings, context: Context) -> None:
    found = radon(REFERENCE, window((160, 160), truth), LIMITS, settings, context)
    assert is_right(found[0], truth)
    assert found[0].pose.scale == 1


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [65.0, -118.0, 172.0])
def test_any_rotation(degrees: float, context: Context) -> None:
    truth = Pose(degrees, 1.0, (7.0, -4.0))
    found = radon(REFERENCE, window((160, 160), truth), SearchLimits(20, 180), GREY, context)
    assert is_right(found[0], truth)


@pytest.mark.slow
def test_windows_need_not_be_of_one_shape(context: Context) -> None:
    truth = Pose(12.0, 1.0, (6.0, -9.0))
    found = radon(window((150, 200)), window((190, 170), truth), LIMITS, GREY, context)
    assert is_right(found[0], truth)


@pytest.mark.slow
def test_large_windows_are_reduced_for_the_rotation(context: Context) -> None:
    truth = Pose(-21.0, 1.0, (-23.0, 31.0))
    found = radon(window((420, 400)), window((420, 400), truth), LIMITS, GREY, context)
    assert is_right(found[0], truth)


@pytest.mark.slow
def test_inverted_contrast(context: Context) -> None:
    truth = Pose(24.0, 1.0, (8.0, -5.0))
    input = window((160, 160), truth)
    inverted = Patch(1e4 / input.values, input.valid)
    assert is_right(radon(REFERENCE, inverted, LIMITS, FIELD, context)[0], truth)


@pytest.mark.slow
def test_a_known_scale(context: Context) -> None:
    truth = Pose(24.0, 1.25, (8.0, -12.0))
    limits = SearchLimits(20.0, 30.0, (1.25, 1.25))
    (found, *_) = radon(REFERENCE, window((200, 200), truth), limits, GREY, context)
    assert found.pose.scale == 1.25
    assert is_right(found, truth)


@pytest.mark.slow
def test_noise(context: Context) -> None:
    truth = Pose(17.0, 1.0, (-7.0, 4.0))
    assert is_right(
        radon(REFERENCE, window((160, 160), truth, noise=25.0), LIMITS, GREY, context)[0], truth
    )


@pytest.mark.slow
def test_masked_pixels_do_not_count(context: Context) -> None:
    truth = Pose(15.0, 1.0, (6.0, -3.0))
    input = masked(window((160, 160), truth), slice(100, 130), slice(0, 30))
    assert is_right(radon(REFERENCE, input, LIMITS, GREY, context)[0], truth)


@pytest.mark.slow
@pytest.mark.parametrize(
    "limits",
    [SearchLimits(20.0, 10.0), SearchLimits(5.0, 30.0), SearchLimits(20.0, 180.0, (1.3, 1.6))],
    ids=str,
)
def test_limits_are_kept(limits: SearchLimits, context: Context) -> None:
    truth = Pose(24.0, 1.0, (8.0, -12.0))
    for one in radon(REFERENCE, window((200, 200), truth), limits, GREY, context):
        assert abs(one.pose.rotation_deg) <= limits.rotation_deg
        assert limits.scale[0] <= one.pose.scale <= limits.scale[1]
        assert np.abs(one.pose.shift_px).max() <= limits.radius + 1e-9


def test_without_rotation_only_the_shift_is_found(context: Context) -> None:
    truth = Pose(0.0, 1.0, (-13.4, 8.8))
    (found, *_) = radon(REFERENCE, window((160, 160), truth), SearchLimits(20.0), GREY, context)
    assert found.pose.rotation_deg == 0
    assert is_right(found, truth)


@pytest.mark.slow
def test_another_place_does_not_stand_out(context: Context) -> None:
    true = radon(REFERENCE, window((160, 160)), LIMITS, GREY, context)[0].height
    found = radon(REFERENCE, window((160, 160), seed=5), LIMITS, GREY, context)
    assert 0 < len(found) <= RETURNED
    assert found[0].height < true / 2


@pytest.mark.slow
def test_threads_change_nothing(context: Context, one_thread: Context) -> None:
    input = window((160, 160), Pose(10.0))
    alone = radon(REFERENCE, input, LIMITS, GREY, one_thread)
    assert radon(REFERENCE, input, LIMITS, GREY, context) == alone


@pytest.mark.parametrize("settings", [GREY, FIELD], ids=lambda s: s.similarity)
def test_what_has_no_content_has_no_pose(settings: SimilaritySettings, context: Context) -> None:
    flat = Patch(np.full((90, 80), 3, np.float32), np.ones((90, 80), bool))
    nothing = Patch(REFERENCE.values, np.zeros(REFERENCE.valid.shape, bool))
    for empty in (flat, nothing):
        assert radon(REFERENCE, empty, LIMITS, settings, context) == []
        assert radon(empty, REFERENCE, LIMITS, settings, context) == []


def blob(right: float, down: float, side: int = 101, sigma: float = 3.0) -> np.ndarray:
    """A Gaussian that lies right of and below the centre."""
    at = np.arange(side) - (side - 1) / 2
    squares = (at - right) ** 2 + ((at - down) ** 2)[:, None]
    return np.exp(-squares / (2 * sigma**2)).astype(np.float32)


def test_the_transform_of_a_gaussian_is_known() -> None:
    """Every projection is a Gaussian of the same width, along the sine of the place (P eq 3.8)."""
    image = blob(20.0, -12.0)
    found = radon_transform(image)
    angle = np.radians(ANGLE_STEP_DEG) * np.arange(ANGLES)
    centre = 20.0 * np.sin(angle) + 12.0 * np.cos(angle)
    at = np.arange(101) - 50
    theory = np.exp(-((at - centre[:, None]) ** 2) / 18) * 3 * np.sqrt(2 * np.pi)
    np.testing.assert_allclose(found, theory, atol=0.03 * theory.max())
    # Projections at 0° and 90° need no interpolation.
    np.testing.assert_allclose(found[0], image.sum(axis=1)[::-1], atol=1e-3)
    np.testing.assert_allclose(found[ANGLES // 2], image.sum(axis=0), atol=1e-3)


def test_a_shift_moves_projections_along_a_sine() -> None:
    """P eq 3.10: by t · direction, seen on the centre of mass."""
    at = np.arange(101) - 50
    centres = []
    for right, down in ((0.0, 0.0), (9.0, 4.0)):
        found = radon_transform(blob(right, down))
        centres.append((found * at).sum(axis=1) / found.sum(axis=1))
    angle = np.radians(ANGLE_STEP_DEG) * np.arange(ANGLES)
    expected = 9.0 * np.sin(angle) - 4.0 * np.cos(angle)
    np.testing.assert_allclose(centres[1] - centres[0], expected, atol=0.05)


def test_the_spectra_of_projections_turn_with_the_image() -> None:
    truth = Pose(31.0, 1.0, (5.0, -8.0))
    found = projection_spectra(REFERENCE, window((160, 160), truth), GREY, disc=True)
    (best,) = rotations(found, SearchLimits(0, 60), 1)
    assert best.rotation_deg == pytest.approx(31, abs=0.3)
    assert [p.rotation_deg for p in rotations(found, SearchLimits(0, 180), 1)] == pytest.approx(
        [31, -149], abs=0.3
    )


def test_no_variation_gives_no_rotation() -> None:
    assert list(rotations([np.zeros((ANGLES, 9), np.float32)] * 2, LIMITS, 3)) == []


@pytest.mark.parametrize("shift", [0.0, 4.0, -6.3, 17.5])
def test_a_shift_along_projections(shift: float) -> None:
    at = np.arange(120) - 59.5
    rng = np.random.default_rng(4)
    waves = rng.uniform(0.02, 0.2, 30), rng.uniform(0, 7, 30)

    def profile(moved: float) -> np.ndarray:
        ground = sum(np.cos(2 * np.pi * f * (at - moved) + p) for f, p in zip(*waves, strict=True))
        return (ground * np.hanning(120)).astype(np.float32)

    found, height = shift_along(profile(0.0), profile(shift), 20.0)
    assert found == pytest.approx(shift, abs=0.3)
    assert height > 5
    assert abs(shift_along(profile(0.0), profile(shift), 3.0)[0]) <= 4


def test_projections_at_0_and_90_degrees_give_the_shift() -> None:
    one, other = blob(-3.0, 2.0), blob(4.5, -6.25)
    found = shift_by_projections(one, other, 20.0)
    assert found.pose.shift_px == pytest.approx((7.5, -8.25), abs=0.1)


def test_power_is_evened_over_the_angles() -> None:
    rng = np.random.default_rng(3)
    power = log_power((rng.normal(size=(40, 5)) * 10.0 ** np.arange(5)).astype(np.complex64))
    power[:, 2] = 7
    found = evened(power)
    np.testing.assert_allclose(found.mean(axis=0), 0, atol=1e-5)
    np.testing.assert_allclose(found.std(axis=0), [1, 1, 0, 1, 1], atol=1e-5)
