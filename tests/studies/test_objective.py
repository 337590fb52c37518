"""The similarity of two windows as a function of their pose."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from speckled_pairs import whole

from groundtie.errors import ParameterError
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose
from groundtie.rasters.patch import Patch
from groundtie.similarity.binning import MASKED
from groundtie.similarity.joint_histogram import ORDER
from groundtie.similarity.measures import normalized_mutual_information
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.climbing import (
    Effort,
    PoseSpace,
    climb_often,
    search_by_climbing,
    spread_px,
)
from groundtie.studies.measures import mutual_information
from groundtie.studies.objective import BinnedPair, bin_pair

COUNTS = (4, 5)
NMI = SimilaritySettings("nmi")


def pair_of(template: tuple[int, int], image: tuple[int, int], masked: float = 0.0) -> BinnedPair:
    rng = np.random.default_rng(1)
    bins = []
    for shape, count in zip((template, image), COUNTS, strict=True):
        drawn = rng.integers(0, count, shape).astype(np.uint8)
        drawn[rng.random(shape) < masked] = MASKED
        bins.append(drawn)
    return BinnedPair(bins[0], bins[1], COUNTS, normalized_mutual_information, 4)


def by_hand(pair: BinnedPair, right: int, down: int) -> float:
    """NMI of the pixel pairs (x, y), (x + right, y + down) of the arrays."""
    histogram = np.zeros(pair.counts)
    for (y, x), own in np.ndenumerate(pair.template):
        row, col = y + down, x + right
        if 0 <= row < pair.image.shape[0] and 0 <= col < pair.image.shape[1]:
            other = pair.image[row, col]
            if own != MASKED and other != MASKED:
                histogram[own, other] += 1
    p = histogram / histogram.sum()

    def entropy(table: np.ndarray) -> float:
        return -sum(v * np.log(v) for v in table.ravel() if v > 0)

    return (entropy(p.sum(0)) + entropy(p.sum(1))) / entropy(p)


@pytest.mark.parametrize("masked", [0.0, 0.1])
@pytest.mark.parametrize("image", [(10, 12), (20, 22), (15, 19), (9, 12)])
def test_aligned_shifts_pair_pixel_with_pixel(image: tuple[int, int], masked: float) -> None:
    pair = pair_of((10, 12), image, masked)
    height, width = np.subtract(image, pair.template.shape)
    for right, down in ((0, 0), (3, -2), (-1, 4)):
        shift = (right - width / 2, down - height / 2)
        found = pair.aligned(shift)
        assert found == pytest.approx(by_hand(pair, right, down), abs=1e-12)


@pytest.mark.parametrize("image", [(20, 22), (15, 19)])
def test_poses_at_aligned_grids_are_aligned_shifts(image: tuple[int, int]) -> None:
    pair = pair_of((10, 12), image, 0.1)
    nearest = BinnedPair(pair.template, pair.image, COUNTS, pair.measure, 1)
    for step in ((0, 0), (2, -1)):
        shift = (pair.origin[0] + step[0], pair.origin[1] + step[1])
        assert nearest.under(Pose(shift_px=shift)) == pytest.approx(nearest.aligned(shift))


def test_a_turned_image_is_the_same_at_the_turned_pose() -> None:
    """Half a turn maps pixel centres onto pixel centres, whatever the order of the kernel."""
    pair = pair_of((10, 12), (20, 22))
    turned = BinnedPair(pair.template, pair.image[::-1, ::-1], COUNTS, pair.measure, 4)
    assert turned.under(Pose(180.0, 1.0, (-1.5, 0.5))) == pytest.approx(
        pair.under(Pose(0.0, 1.0, (1.5, -0.5)))
    )


def test_where_too_little_overlaps_there_is_nothing() -> None:
    pair = pair_of((10, 12), (10, 12))
    assert pair.nothing == pytest.approx(1.0)
    assert pair.aligned((4.0, 0.0)) > 1.0
    for far in ((9.0, 0.0), (0.0, -9.0), (0.0, 40.0), (-400.0, 0.0)):
        assert pair.aligned(far) == pair.nothing
        assert pair.under(Pose(shift_px=far)) == pair.nothing
    assert BinnedPair(pair.template, pair.image, COUNTS, mutual_information, 4).nothing == (
        pytest.approx(0.0, abs=1e-12)
    )


def test_windows_are_binned_by_the_settings() -> None:
    ramp = whole(np.arange(400.0).reshape(20, 20))
    pair = bin_pair(ramp, ramp, SimilaritySettings("mi", bins=16))
    assert pair is not None
    assert pair.measure is mutual_information
    assert (pair.counts, pair.order) == ((16, 16), ORDER)
    np.testing.assert_array_equal(np.bincount(pair.template.ravel()), np.full(16, 25))
    # Identical images: MI is the entropy, of 16 equally frequent bins.
    assert pair.aligned((0.0, 0.0)) == pytest.approx(np.log(16))
    fused = bin_pair(ramp, ramp, SimilaritySettings())
    assert fused is not None
    assert fused.measure is normalized_mutual_information


def test_flat_windows_have_nothing_to_compare() -> None:
    ramp, flat = whole(np.arange(400.0).reshape(20, 20)), whole(np.ones((20, 20)))
    masked = Patch(ramp.values, np.zeros((20, 20), bool))
    for one, other in ((flat, ramp), (ramp, flat), (masked, ramp)):
        assert bin_pair(one, other, NMI) is None


@pytest.mark.parametrize("similarity", ["ncc", "orientation"])
def test_similarities_without_joint_histogram_are_refused(similarity: str) -> None:
    ramp = whole(np.arange(400.0).reshape(20, 20))
    with pytest.raises(ParameterError, match="joint histograms"):
        bin_pair(ramp, ramp, SimilaritySettings(similarity))


@pytest.mark.parametrize(
    "limits", [SearchLimits(8, 20, (0.5, 2.0)), SearchLimits(8), SearchLimits(8, 20)]
)
def test_places_are_poses(limits: SearchLimits) -> None:
    space = PoseSpace(limits, 50.0)
    pose = Pose(
        7.0 if limits.rotation_deg else 0.0, 1.3 if limits.scale[1] > 1 else 1.0, (2.5, -3.0)
    )
    back = space.pose(space.place(pose))
    assert (back.rotation_deg, back.scale) == pytest.approx((pose.rotation_deg, pose.scale))
    assert back.shift_px == pose.shift_px


def test_a_known_scale_is_kept() -> None:
    space = PoseSpace(SearchLimits(8, scale=(1.4, 1.4)), 50.0)
    assert len(space.bounds) == 2
    assert space.pose(space.place(Pose())).scale == 1.4


def test_places_stay_within_limits() -> None:
    space = PoseSpace(SearchLimits(8, 20, (0.5, 2.0)), 50.0)
    low, high = (space.pose(space.settle(np.full(4, end))) for end in (-1e6, 1e6))
    assert (low.shift_px, high.shift_px) == ((-8, -8), (8, 8))
    assert (low.rotation_deg, high.rotation_deg) == pytest.approx((-20, 20))
    assert (low.scale, high.scale) == pytest.approx((0.5, 2.0))


def test_a_pixel_of_every_dimension_moves_pixels_by_a_pixel() -> None:
    shape = (40, 60)
    space = PoseSpace(SearchLimits(8, 20, (0.5, 2.0)), spread_px(shape))
    rows, cols = np.mgrid[:40, :60] - np.array([19.5, 29.5])[:, None, None]
    px = np.stack([cols.ravel(), rows.ravel()])
    for place in np.eye(4) * 0.1:
        pose = space.pose(space.settle(place))
        moved = pose.linear @ px + np.array(pose.shift_px)[:, None] - px
        assert np.sqrt((moved**2).sum(axis=0).mean()) == pytest.approx(0.1, rel=5e-3)


@pytest.mark.parametrize(("origin", "lowest", "highest"), [(0.0, -8.0, 8.0), (-0.5, -7.5, 7.5)])
def test_aligned_places_are_whole_pixels_from_the_origin(
    origin: float, lowest: float, highest: float
) -> None:
    space = PoseSpace(SearchLimits(8.2), 50.0, (origin, 0.0))
    assert space.settle([99.0, -99.0]) == (highest, -8.0)
    assert space.settle([-99.0, 99.0]) == (lowest, 8.0)
    assert space.settle([3.3 + origin, 2.6]) == (3.0 + origin, 3.0)


def test_climbs_end_when_enough_agree() -> None:
    space = PoseSpace(SearchLimits(10), 1.0)
    hills = {(0.0, 0.0): 1.0, (5.0, 5.0): 2.0}
    similarity = cache(lambda place: hills.get(place, 0.0))
    given = iter([(0.0, 0.0), (5.0, 5.0), (0.0, 0.0), (5.0, 5.0), (0.0, 0.0)])
    starts: list[tuple[float, ...]] = []

    def climb(_: object, __: PoseSpace, start: tuple[float, ...], ___: object):  # type: ignore
        starts.append(start)
        return next(given)

    effort = Effort(restarts=9, agreeing=2)
    ends, background = climb_often(similarity, space, climb, effort, 0)
    assert ends == [(0.0, 0.0), (5.0, 5.0), (0.0, 0.0), (5.0, 5.0)]
    assert starts[0] == (0.0, 0.0)
    assert len(set(starts)) == 4
    assert len(background) == 9
    assert similarity.cache_info().misses == 9 + 2


def smooth(seed: int, side: int, width: float = 2.0) -> np.ndarray:
    return gaussian_filter(np.random.default_rng(seed).normal(size=(side, side)), width)


def test_candidates_are_distinct_best_first_and_stand_out() -> None:
    ground = smooth(0, 60)
    pair = bin_pair(whole(ground[10:50, 10:50]), whole(-ground), NMI)
    assert pair is not None
    space = PoseSpace(SearchLimits(10), spread_px((40, 40)), pair.origin)
    ends = iter([(0.0, 0.0), (1.0, 0.0), (9.0, 9.0), (9.0, 8.0), (-9.0, 0.0)])
    found = search_by_climbing(
        pair, space, lambda *_: next(ends), Effort(restarts=4, agreeing=9), 0
    )
    shifts = [candidate.pose.shift_px for candidate in found]
    assert shifts[0] == (0.0, 0.0)
    assert len(shifts) == 3
    assert (1.0, 0.0) not in shifts
    heights = [candidate.height for candidate in found]
    assert heights == sorted(heights, reverse=True)
    assert heights[0] > 5
    assert {candidate.evaluations for candidate in found} == {4 + 5}


def test_windows_that_never_overlap_have_no_candidate() -> None:
    values = smooth(0, 40)
    left, right = np.zeros((2, 40, 40), bool)
    left[:, :10], right[:, 30:] = True, True
    pair = bin_pair(
        Patch(values.astype(np.float32), left), Patch(values.astype(np.float32), right), NMI
    )
    assert pair is not None
    space = PoseSpace(SearchLimits(5), 10.0, pair.origin)
    assert search_by_climbing(pair, space, lambda _, __, start, ___: start, Effort(), 0) == []
