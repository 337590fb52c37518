"""Shifts by phase correlation: sub-pixel, under masks, within limits."""

from __future__ import annotations

import numpy as np
import pytest
from posed_windows import masked, shifted_by, window

from groundtie.context import Context
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose
from groundtie.rasters.patch import Patch
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.phase_correlation import (
    CANDIDATES,
    phase_correlation,
    phase_surface,
    shifts_at,
)
from groundtie.studies.spectra import gaussian_peak, whitened
from groundtie.studies.spectral_windows import structure

GREY, FIELD = SimilaritySettings("ncc"), SimilaritySettings("orientation")
REFERENCE = window((120, 140))
LIMITS = SearchLimits(30.0)


def flat(shape: tuple[int, int] = (50, 60), value: float = 7.0) -> Patch:
    return Patch(np.full(shape, value, np.float32), np.ones(shape, bool))


@pytest.mark.parametrize("settings", [GREY, FIELD], ids=lambda s: s.similarity)
@pytest.mark.parametrize("shift", [(0.0, 0.0), (3.4, -7.7), (-21.25, 12.5), (0.5, 27.9)])
def test_shifts_are_found_to_a_fraction_of_a_pixel(
    shift: tuple[float, float], settings: SimilaritySettings, context: Context
) -> None:
    truth = Pose(shift_px=shift)
    found = phase_correlation(REFERENCE, window((120, 140), truth), LIMITS, settings, context)
    assert shifted_by(found[0], truth) < 0.1
    assert (found[0].pose.rotation_deg, found[0].pose.scale) == (0, 1)
    assert found[0].height > 15


def test_windows_may_differ_in_size(context: Context) -> None:
    truth = Pose(shift_px=(10.3, -14.6))
    found = phase_correlation(REFERENCE, window((175, 180), truth), LIMITS, GREY, context)
    assert shifted_by(found[0], truth) < 0.1


def test_fields_do_not_mind_inverted_contrast(context: Context) -> None:
    truth = Pose(shift_px=(6.3, 9.6))
    input = window((120, 140), truth)
    inverted = Patch(1e4 / input.values, input.valid)
    found = phase_correlation(REFERENCE, inverted, LIMITS, FIELD, context)
    assert shifted_by(found[0], truth) < 0.1


def test_noise_costs_height_first(context: Context) -> None:
    truth = Pose(shift_px=(-8.3, 11.6))
    clean, noisy = (
        phase_correlation(REFERENCE, window((120, 140), truth, noise=n), LIMITS, GREY, context)[0]
        for n in (0.0, 50.0)
    )
    assert shifted_by(noisy, truth) < 0.3
    assert noisy.height < clean.height


@pytest.mark.parametrize("settings", [GREY, FIELD], ids=lambda s: s.similarity)
def test_masked_pixels_do_not_count(settings: SimilaritySettings, context: Context) -> None:
    truth = Pose(shift_px=(5.3, -4.6))
    input = masked(window((120, 140), truth), slice(0, 50), slice(40, 75))
    reference = masked(REFERENCE, slice(80, 120), slice(90, 140))
    found = phase_correlation(reference, input, LIMITS, settings, context)
    assert shifted_by(found[0], truth) < 0.1


def test_a_masked_value_is_not_looked_at(context: Context) -> None:
    input = window((120, 140), Pose(shift_px=(5.3, -4.6)))
    one = masked(input, slice(0, 50), slice(40, 75))
    other = Patch(np.where(one.valid, one.values, -3), one.valid)
    assert phase_correlation(REFERENCE, one, LIMITS, GREY, context) == phase_correlation(
        REFERENCE, other, LIMITS, GREY, context
    )


def test_shifts_stay_within_the_radius(context: Context) -> None:
    input = window((120, 140), Pose(shift_px=(14.0, 2.0)))
    for one in phase_correlation(REFERENCE, input, SearchLimits(10.0), GREY, context):
        assert np.abs(one.pose.shift_px).max() <= 10
    assert (
        phase_correlation(REFERENCE, input, SearchLimits(15.0), GREY, context)[0].pose.shift_px[0]
        > 13.5
    )


def test_the_scale_is_the_one_that_is_allowed(context: Context) -> None:
    truth = Pose(scale=1.5, shift_px=(-9.0, 12.0))
    limits = SearchLimits(30.0, scale=(1.5, 2.0))
    found = phase_correlation(REFERENCE, window((180, 210), truth), limits, GREY, context)
    assert found[0].pose.scale == 1.5
    assert shifted_by(found[0], truth) < 0.2


def test_candidates_are_apart_and_best_first(context: Context) -> None:
    input = window((120, 140), Pose(shift_px=(4.0, 2.0)))
    found = phase_correlation(REFERENCE, input, LIMITS, GREY, context)
    assert len(found) <= CANDIDATES
    heights = [one.height for one in found]
    assert heights == sorted(heights, reverse=True)
    places = np.array([one.pose.shift_px for one in found])
    gaps = np.abs(places[:, None] - places[None]).max(axis=2)[np.triu_indices(len(found), 1)]
    assert (gaps >= 6).all()


def test_another_place_does_not_stand_out(context: Context) -> None:
    other = window((120, 140), seed=5)
    true = phase_correlation(REFERENCE, window((120, 140)), LIMITS, GREY, context)[0].height
    assert phase_correlation(REFERENCE, other, LIMITS, GREY, context)[0].height < true / 3


def test_threads_change_nothing(context: Context, one_thread: Context) -> None:
    input = window((120, 140), Pose(shift_px=(4.3, 2.1)))
    alone = phase_correlation(REFERENCE, input, LIMITS, GREY, one_thread)
    assert phase_correlation(REFERENCE, input, LIMITS, GREY, context) == alone


@pytest.mark.parametrize("settings", [GREY, FIELD], ids=lambda s: s.similarity)
def test_what_has_no_content_has_no_pose(settings: SimilaritySettings, context: Context) -> None:
    nothing = Patch(REFERENCE.values, np.zeros(REFERENCE.valid.shape, bool))
    for empty in (flat(), nothing):
        assert phase_correlation(REFERENCE, empty, LIMITS, settings, context) == []
        assert phase_correlation(empty, REFERENCE, LIMITS, settings, context) == []


def test_shifts_at_a_pose_are_in_input_pixels() -> None:
    truth = Pose(35.0, 1.4, (18.0, -7.0))
    fixed = structure(REFERENCE, GREY)
    turned = Pose(truth.rotation_deg, truth.scale)
    (found,) = shifts_at(fixed, window((240, 240), truth), turned, 30.0, GREY, 1)
    assert shifted_by(found, truth) < 0.5
    assert (found.pose.rotation_deg, found.pose.scale) == (35, 1.4)


def test_a_surface_knows_its_shifts() -> None:
    """A point against a point: the phases are those of the shift alone."""
    reference, input = np.zeros((9, 12), np.float32), np.zeros((14, 11), np.float32)
    reference[4, 3] = input[8, 7] = 1
    surface = phase_surface(reference, input)
    ((shift, _),) = surface.peaks(np.eye(2), 99.0, 1)
    assert shift == pytest.approx((7 - 5 - (3 - 5.5), 8 - 6.5 - (4 - 4)), abs=1e-3)


def test_which_shifts_are_within_a_radius_of_a_turned_input() -> None:
    surface = phase_surface(*np.zeros((2, 41, 41), np.float32))
    linear = Pose(45.0, 2.0).linear
    allowed = surface.within(linear, 10.0)
    right, down = np.meshgrid(surface.right_px, surface.down_px)
    moved = np.stack([right.ravel(), down.ravel()], 1) @ linear.T
    expected = np.abs(moved).max(axis=1) <= 10.5
    assert 0 < expected.sum() < expected.size
    np.testing.assert_array_equal(allowed.ravel(), expected)


def test_the_peak_of_a_gaussian_is_found_between_samples() -> None:
    x = np.arange(20.0)
    for centre in (7.0, 7.3, 6.6, 0.2, 19.4):
        wrapped = (x - centre + 10) % 20 - 10
        values = np.exp(-(wrapped**2) / (2 * 0.8**2))
        index = int(values.argmax())
        assert (index + gaussian_peak(values, index)) % 20 == pytest.approx(centre % 20, abs=0.02)


def test_a_plateau_has_no_peak_between_samples() -> None:
    assert gaussian_peak(np.ones(5), 2) == 0
    assert gaussian_peak(np.zeros(5), 2) == 0


def test_whitening_keeps_phases_and_zeros() -> None:
    spectrum = np.array([[0, 3j], [-40, 1 + 1j]], np.complex64)
    for exponent in (0.5, 1.0):
        found = whitened(spectrum, exponent)
        assert found[0, 0] == 0
        np.testing.assert_allclose(np.angle(found), np.angle(spectrum), atol=1e-6)
    sizes = np.abs(whitened(spectrum)).ravel()[1:]
    np.testing.assert_allclose(
        sizes,
        np.abs(spectrum).ravel()[1:]
        / (np.abs(spectrum).ravel()[1:] + 0.05 * np.abs(spectrum).mean()),
        rtol=1e-5,
    )
    assert (whitened(np.zeros((2, 2), np.complex64)) == 0).all()
