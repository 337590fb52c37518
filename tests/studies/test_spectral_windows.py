"""Windows are faded out, turned back and cut to what they share."""

from __future__ import annotations

import numpy as np
import pytest
from posed_windows import masked, shifted_by, turned_by, window

from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose, PoseFound
from groundtie.rasters.patch import Patch, reduced, reduced_patch
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.spectral_windows import (
    aligned,
    apodise,
    corrected,
    covering_shape,
    distinct,
    resampled,
    shared,
    structure,
    texture,
    within,
)

GREY, FIELD = SimilaritySettings("ncc"), SimilaritySettings("fused")
LIMITS = SearchLimits(50.0, 180.0, (0.5, 2.0))
REFERENCE = window((90, 110))
TURNED = Pose(33.0, 1.2, (9.0, -4.0))


def mapped(pose: Pose, px: np.ndarray) -> np.ndarray:
    return px @ pose.linear.T + pose.shift_px


def test_an_apodised_image_has_no_mean_and_no_border() -> None:
    faded = apodise(REFERENCE.values, REFERENCE.valid)
    assert abs(float(faded.mean())) < 1e-3 * float(faded.std())
    edge = np.concatenate([faded[0], faded[-1], faded[:, 0], faded[:, -1]])
    assert np.abs(edge).max() < 0.05 * np.abs(faded).max()
    middle = np.s_[30:60, 30:80]
    kept = REFERENCE.values[middle] - faded[middle]
    assert np.ptp(kept) < 1e-3


def test_masked_pixels_are_faded_out() -> None:
    hole = masked(REFERENCE, slice(30, 50), slice(40, 70))
    faded = apodise(hole.values, hole.valid)
    assert (faded[~hole.valid] == 0).all()
    assert np.abs(faded[28:52, 38:72]).max() < 0.2 * np.abs(faded).max()


def test_the_disc_looks_the_same_however_it_is_turned() -> None:
    ones = np.ones((81, 81), np.float32)
    # Of a ramp that turns into itself in the other direction.
    ramp = np.arange(81, dtype=np.float32) * ones
    faded = apodise(ramp, ones > 0, disc=True)
    np.testing.assert_allclose(apodise(ramp.T.copy(), ones > 0, disc=True), faded.T, atol=1e-3)
    away = np.hypot(*(np.indices((81, 81)) - 40))
    assert (faded[away > 40.5] == 0).all()
    assert (faded[(away < 30) & (ramp != 40)] != 0).all()


def test_nothing_stays_of_an_image_without_valid_pixels() -> None:
    nothing = np.zeros(REFERENCE.valid.shape, bool)
    assert (apodise(REFERENCE.values, nothing) == 0).all()


def test_what_is_compared_follows_the_similarity() -> None:
    hole = masked(REFERENCE, slice(30, 50), slice(40, 70))
    np.testing.assert_array_equal(texture(hole, GREY)[hole.valid], hole.values[hole.valid])
    logs = texture(hole, FIELD)[hole.valid]
    # The logarithm has a small offset.
    assert np.corrcoef(logs, np.log(hole.values[hole.valid]))[0, 1] > 0.99
    for settings in (GREY, FIELD):
        assert np.ptp(texture(hole, settings)[~hole.valid]) == 0
    assert structure(hole, GREY).dtype == np.float32
    assert structure(hole, FIELD).dtype == np.complex64


def test_reducing_is_the_mean_of_blocks() -> None:
    image = np.arange(35, dtype=np.float32).reshape(5, 7)
    blocks = image[:4, :6].reshape(2, 2, 3, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(reduced(image, 2), blocks)
    valid = np.ones((5, 7), bool)
    valid[1, 2] = False
    small = reduced_patch(Patch(image, valid), 2)
    assert small.valid.tolist() == [[True, False, True], [True, True, True]]
    np.testing.assert_allclose(small.values[small.valid], blocks[small.valid])
    patch = Patch(image, valid)
    assert reduced_patch(patch, 1) is patch


@pytest.mark.parametrize("truth", [Pose(), TURNED, Pose(-140.0, 0.8, (3.0, 7.0))], ids=str)
def test_an_input_turned_back_is_the_reference(truth: Pose) -> None:
    back = resampled(window((150, 150), truth), truth, (90, 110), "cubic")
    off = (back.values - REFERENCE.values)[back.valid]
    assert back.valid.mean() > 0.8
    # Cubic interpolation of waves of 5 px and more.
    assert np.abs(off).mean() < 0.1 * REFERENCE.values.std()


def test_what_lies_beyond_the_input_is_not_valid() -> None:
    truth = Pose(shift_px=(20.0, 0.0))
    back = resampled(window((90, 110), truth), truth, (90, 110), "bilinear")
    assert back.valid[:, :90].all()
    assert not back.valid[:, 91:].any()


def test_masked_input_pixels_touch_no_others() -> None:
    truth = Pose(10.0)
    input = masked(window((90, 110), truth), slice(30, 50), slice(40, 70))
    back = resampled(input, truth, (90, 110), "bilinear")
    assert np.abs(back.values[back.valid]).max() < 2 * REFERENCE.values.max()


def test_a_covering_shape_holds_the_whole_input() -> None:
    for pose in (Pose(30.0, 1.3), Pose(90.0, 0.7), Pose(-135.0)):
        shape = covering_shape((80, 61), pose, (90, 111))
        assert ((np.array(shape) - (90, 111)) % 2 == 0).all()
        corners = np.array([[x, y] for x in (-30, 30) for y in (-39.5, 39.5)])
        inside = corners @ np.linalg.inv(pose.linear).T
        assert (np.abs(inside) <= np.array(shape[::-1]) / 2).all()
        assert np.abs(inside).max(axis=0) == pytest.approx(np.array(shape[::-1]) / 2, abs=2)


def test_shared_parts_are_alike() -> None:
    truth = Pose(8.0, 1.0, (30.0, 12.0))
    both = shared(REFERENCE, window((90, 110), truth), truth)
    assert both is not None
    np.testing.assert_array_equal(both.reference.valid, both.input.valid)
    valid = both.reference.valid
    off = (both.reference.values - both.input.values)[valid]
    assert np.abs(off).mean() < 0.1 * REFERENCE.values.std()
    # The input shows what lies left and up of the reference's centre.
    assert (both.offset_px < -3).all()
    rows, cols = valid.shape
    corner = both.offset_px + [54.5 - (cols - 1) / 2, 44.5 - (rows - 1) / 2]
    np.testing.assert_allclose(corner, np.round(corner), atol=1e-9)


def test_too_little_is_not_shared() -> None:
    assert shared(REFERENCE, window((90, 110)), Pose(shift_px=(105.0, 80.0))) is None


def test_a_correction_comes_first_about_its_own_centre() -> None:
    offset = np.array([12.0, -5.0])
    correction = Pose(2.0, 1.03, (0.7, -0.4))
    px = np.array([[0.0, 0.0], [30.0, -20.0], [-14.0, 40.0]])
    moved = mapped(correction, px - offset) + offset
    found = corrected(TURNED, correction, offset)
    np.testing.assert_allclose(mapped(found, px), mapped(TURNED, moved))
    assert corrected(Pose(179.0), Pose(2.0), np.zeros(2)).rotation_deg == pytest.approx(-179)


def test_poses_are_kept_within_limits() -> None:
    limits = SearchLimits(5.0, 10.0, (0.9, 1.1))
    assert within(Pose(-12.0, 1.3, (7.0, -6.0)), limits) == Pose(-10.0, 1.1, (5.0, -5.0))
    assert within(Pose(3.0, 1.0, (1.0, 2.0)), limits) == Pose(3.0, 1.0, (1.0, 2.0))


def test_a_candidate_is_corrected_by_what_is_left() -> None:
    """What is left is known here: from the pose that is wrong to the one that is right."""
    wrong = PoseFound(Pose(32.0, 1.25, (7.0, -3.0)), 5.0)
    input = window((150, 150), TURNED)
    back = np.linalg.inv(wrong.pose.linear)
    left = Pose(
        1.0,
        1.2 / 1.25,
        tuple(back @ (np.array(TURNED.shift_px) - wrong.pose.shift_px)),  # type: ignore[arg-type]
    )
    found = aligned(REFERENCE, input, wrong, LIMITS, GREY, lambda *_: PoseFound(left, 9.0))
    # Nothing is cut off, so that the part's centre is the reference's.
    assert turned_by(found, TURNED) < 1e-9
    assert shifted_by(found, TURNED) < 1e-9
    assert found.height == 9


def test_a_candidate_without_correction_stays() -> None:
    one = PoseFound(TURNED, 5.0)
    input = window((150, 150), TURNED)
    assert aligned(REFERENCE, input, one, LIMITS, GREY, lambda *_: None) is one
    far = PoseFound(Pose(shift_px=(300.0, 0.0)), 5.0)
    assert aligned(REFERENCE, input, far, LIMITS, GREY, lambda *_: one) is far


def test_candidates_that_are_the_same_are_one() -> None:
    best = PoseFound(Pose(179.5, 1.0, (3.0, 4.0)), 9.0)
    same = PoseFound(Pose(-179.5, 1.01, (4.0, 4.0)), 8.0)
    apart = PoseFound(Pose(179.5, 1.0, (30.0, 4.0)), 5.0)
    turned = PoseFound(Pose(170.0, 1.0, (3.0, 4.0)), 7.0)
    assert distinct([apart, same, best, turned]) == [best, turned, apart]
    assert distinct([apart, same, best, turned], 0.7) == [best, turned]
    assert distinct([]) == []
