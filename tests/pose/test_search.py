from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from turned_pairs import error_px, patch, turned_pair

from groundtie.context import Context
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose
from groundtie.pose.search import Scan, find_poses, moved_px, scan, shift_surface
from groundtie.rasters.patch import Patch

ANY = SearchLimits(45.0, 180.0, (0.5, 2.0))

# What the verdict asks for: see rotation_verdict.
RIVAL_RATIO = 1.6


def rotated(found: Pose, truth: Pose) -> float:
    return abs((found.rotation_deg - truth.rotation_deg + 180) % 360 - 180)


class TestKnownPoses:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        "truth",
        [
            Pose(),
            Pose(37.3, 1.0, (-12.4, 20.7)),
            Pose(-101.9, 0.62, (9.3, 8.1)),
            Pose(179.2, 1.31, (3.2, -31.6)),
            Pose(64.0, 1.83, (-25.5, -14.0)),
        ],
    )
    def test_any_pose_is_found(self, truth: Pose, context: Context) -> None:
        shape = round(150 * truth.scale), round(140 * truth.scale)
        reference, input = turned_pair(truth, input=shape)
        found = find_poses(reference, input, ANY, context)
        assert error_px(found[0].pose, truth, reference, input) < 0.5
        assert rotated(found[0].pose, truth) < 0.3
        assert found[0].height > RIVAL_RATIO * found[1].height
        # Candidates differ.
        for one, other in combinations(found, 2):
            assert moved_px(one.pose, other.pose, (150, 160)) > 5

    @pytest.mark.slow
    def test_images_larger_than_the_finest_level(self, context: Context) -> None:
        truth = Pose(-58.0, 1.1, (40.0, -22.0))
        reference, input = turned_pair(truth, (460, 440), (450, 470))
        found = find_poses(reference, input, SearchLimits(80, 180, (0.8, 1.3)), context)
        assert error_px(found[0].pose, truth, reference, input) < 0.7

    @pytest.mark.slow
    def test_images_smaller_than_the_coarsest_level(self, context: Context) -> None:
        truth = Pose(20.0, 1.0, (3.0, -5.0))
        reference, input = turned_pair(truth, (70, 60), (80, 80), noise=0.1)
        found = find_poses(reference, input, SearchLimits(10, 180, (0.8, 1.25)), context)
        assert error_px(found[0].pose, truth, reference, input) < 0.7

    @pytest.mark.slow
    def test_a_small_input_in_a_large_reference(self, context: Context) -> None:
        truth = Pose(-75.0, 1.0, (60.0, -45.0))
        reference, input = turned_pair(truth, (280, 300), (130, 140), noise=0.1)
        limits = SearchLimits(90, 180, (0.8, 1.25))
        found = find_poses(reference, input, limits, context)
        assert error_px(found[0].pose, truth, reference, input) < 0.7

    @pytest.mark.slow
    def test_masked_corners_do_not_matter(self, context: Context) -> None:
        truth = Pose(123.0, 1.15, (4.0, 9.0))
        reference, input = turned_pair(truth)
        rows, cols = np.indices(reference.values.shape)
        valid = rows + cols > 70
        masked = Patch(np.where(valid, reference.values, np.float32(0)), valid)
        found = find_poses(masked, input, SearchLimits(45, 180, (0.9, 1.3)), context)
        assert error_px(found[0].pose, truth, reference, input) < 0.5


class TestLimits:
    def test_without_rotation_and_scale_only_shifts_are_tried(self, context: Context) -> None:
        truth = Pose(shift_px=(14.0, -9.0))
        reference, input = turned_pair(truth)
        found = find_poses(reference, input, SearchLimits(20), context)
        assert len(found) > 1
        assert {(one.pose.rotation_deg, one.pose.scale) for one in found} == {(0.0, 1.0)}
        np.testing.assert_allclose(found[0].pose.shift_px, truth.shift_px, atol=0.3)

    @pytest.mark.slow
    @pytest.mark.parametrize("largest", [5.0, 60.0])
    def test_poses_stay_within_limits(self, largest: float, context: Context) -> None:
        truth = Pose(80.0, 1.5)
        reference, input = turned_pair(truth)
        limits = SearchLimits(12, largest, (0.9, 1.1))
        for found in find_poses(reference, input, limits, context):
            assert abs(found.pose.rotation_deg) <= largest
            assert 0.9 <= found.pose.scale <= 1.1

    @pytest.mark.slow
    def test_shifts_beyond_the_radius_are_not_found(self, context: Context) -> None:
        truth = Pose(45.0, 1.0, (30.0, 0.0))
        reference, input = turned_pair(truth)
        near = find_poses(reference, input, SearchLimits(12, 180, (0.9, 1.1)), context)
        # A pixel of the small images, and what finer levels may add.
        assert np.abs([one.pose.shift_px for one in near]).max() < 12 + 6
        far = find_poses(reference, input, SearchLimits(32, 180, (0.9, 1.1)), context)
        assert error_px(far[0].pose, truth, reference, input) < 0.5

    @pytest.mark.slow
    def test_corners_of_the_square_of_shifts_are_reached(self, context: Context) -> None:
        truth = Pose(45.0, 1.0, (24.0, 24.0))
        reference, input = turned_pair(truth)
        found = find_poses(reference, input, SearchLimits(25, 180, (0.9, 1.1)), context)
        assert error_px(found[0].pose, truth, reference, input) < 0.5


@pytest.fixture(scope="module")
def scanned(context: Context) -> Scan:
    """Return the scan of any pose for one of 30° and a scale of 1.2."""
    return scan(*turned_pair(Pose(30.0, 1.2)), ANY, context)


class TestScan:
    @pytest.mark.slow
    def test_all_is_tried_once(self, scanned: Scan) -> None:
        assert scanned.heights.shape == (len(scanned.scales), len(scanned.rotations_deg))
        assert scanned.scales[[0, -1]] == pytest.approx([0.5, 2.0])
        steps = np.diff(scanned.rotations_deg)
        assert steps == pytest.approx(steps[0])
        assert scanned.rotations_deg[0] == -180
        assert scanned.rotations_deg[-1] + steps[0] == pytest.approx(180)
        row, col = np.unravel_index(scanned.heights.argmax(), scanned.heights.shape)
        assert abs(scanned.rotations_deg[col] - 30) <= steps[0]
        assert scanned.scales[row] == pytest.approx(1.2, rel=0.12)

    @pytest.mark.slow
    def test_candidates_are_the_local_maxima_best_first(self, scanned: Scan) -> None:
        heights = [found.height for found in scanned.found]
        assert heights == sorted(heights, reverse=True)
        assert heights[0] == pytest.approx(scanned.heights.max())

    def test_the_ends_of_the_circle_are_neighbours(self, context: Context) -> None:
        reference, input = turned_pair(Pose(180.0))
        scanned = scan(reference, input, SearchLimits(20, 180), context)
        near = {f.pose.rotation_deg for f in scanned.found if abs(f.pose.rotation_deg) > 170}
        assert near == {scanned.found[0].pose.rotation_deg}

    def test_rotations_within_limits(self, context: Context) -> None:
        reference, input = turned_pair(Pose())
        rotations = scan(reference, input, SearchLimits(10, 20), context).rotations_deg
        assert rotations[[0, -1]].tolist() == [-20, 20]
        assert 0 in rotations or len(rotations) % 2 == 0


class TestNothingInCommon:
    @pytest.mark.slow
    def test_no_pose_stands_out(self, context: Context) -> None:
        reference, input = turned_pair(Pose(40.0, 1.2), seed=5, input_seed=55)
        found = find_poses(reference, input, ANY, context)
        assert found[0].height < RIVAL_RATIO * found[1].height

    @pytest.mark.slow
    def test_noise(self, context: Context) -> None:
        rng = np.random.default_rng(0)
        windows = [patch(rng.gamma(1.0, 100.0, (120, 120))) for _ in range(2)]
        found = find_poses(*windows, SearchLimits(30, 180, (0.8, 1.25)), context)
        assert found[0].height < RIVAL_RATIO * found[1].height

    def test_flat_and_empty_windows_have_no_pose(self, context: Context) -> None:
        reference, _ = turned_pair(Pose())
        flat = patch(np.full((90, 90), 7.0))
        empty = Patch(np.zeros((90, 90), np.float32), np.zeros((90, 90), bool))
        for other in (flat, empty):
            assert find_poses(reference, other, ANY, context) == []
            assert find_poses(other, reference, ANY, context) == []


@pytest.mark.slow
def test_threads_change_nothing(context: Context, one_thread: Context) -> None:
    reference, input = turned_pair(Pose(-20.0, 0.9, (5.0, 5.0)))
    limits = SearchLimits(20, 60, (0.8, 1.25))
    alone = find_poses(reference, input, limits, one_thread)
    together = find_poses(reference, input, limits, context)
    assert [one.pose for one in alone] == [one.pose for one in together]


class TestShiftSurface:
    def test_the_peak_is_at_the_pose(self, context: Context) -> None:
        truth = Pose(25.0, 1.3, (7.0, -3.0))
        reference, input = turned_pair(truth)
        surface, pixel = shift_surface(reference, input, truth, context)
        middle = surface.shape[0] // 2
        assert pixel == 1.0
        assert np.unravel_index(surface.argmax(), surface.shape) == (middle, middle)
        assert 1.4826 * np.median(np.abs(surface - np.median(surface))) == pytest.approx(
            1, rel=0.01
        )

    def test_shifts_are_those_of_the_content(self, context: Context) -> None:
        truth = Pose(shift_px=(9.0, -5.0))
        surface, _ = shift_surface(*turned_pair(truth), Pose(), context)
        middle = surface.shape[0] // 2
        row, col = np.unravel_index(surface.argmax(), surface.shape)
        assert (col - middle, row - middle) == (9, -5)


class TestMoved:
    def test_by_a_shift(self) -> None:
        assert moved_px(Pose(), Pose(shift_px=(3.0, 4.0)), (50, 80)) == pytest.approx(5)

    def test_by_a_half_turn(self) -> None:
        # Corners go to the opposite ones.
        assert moved_px(Pose(), Pose(180.0), (60, 80)) == pytest.approx(100)

    def test_in_reference_pixels(self) -> None:
        one, other = Pose(scale=2.0), Pose(scale=2.0, shift_px=(6.0, 0.0))
        assert moved_px(one, other, (50, 50)) == pytest.approx(3)
