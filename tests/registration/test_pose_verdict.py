from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from turned_pairs import patch, texture, turned_pair

from groundtie.context import Context
from groundtie.geometry.limits import SearchLimits
from groundtie.pose.pose import Pose, PoseFound
from groundtie.pose.search import find_poses
from groundtie.rasters.patch import Patch
from groundtie.registration.pose_verdict import PoseEvidence
from groundtie.registration.verdict import decide

TRUTH = Pose(50.0, 1.1, (4.0, -6.0))
# As wide as any search: half of the input's longer side.
ANY = SearchLimits(85, 180, (0.8, 1.25))


def candidates(*heights: float) -> list[PoseFound]:
    return [PoseFound(Pose(30.0 * i), height) for i, height in enumerate(heights)]


@pytest.fixture(scope="module")
def windows() -> tuple[Patch, Patch]:
    return turned_pair(TRUTH)


class TestWhatAnExhaustiveSearchFound:
    def test_a_pose_that_stands_out(self, windows: tuple[Patch, Patch], context: Context) -> None:
        evidence = PoseEvidence.of(windows, ANY, candidates(12.0, 4.0), True, context)
        assert decide(evidence).accepted
        assert evidence.summary() == {"height": 12.0, "rival_ratio": 3.0}

    def test_a_rival(self, windows: tuple[Patch, Patch], context: Context) -> None:
        found = candidates(12.0, 12.0 / 1.6 + 0.1)
        verdict = decide(PoseEvidence.of(windows, ANY, found, True, context))
        assert not verdict.accepted
        assert "another pose" in verdict.reason

    def test_no_higher_than_chance(self, windows: tuple[Patch, Patch], context: Context) -> None:
        found = candidates(4.9, 1.0)
        verdict = decide(PoseEvidence.of(windows, ANY, found, True, context))
        assert not verdict.accepted
        assert "chance" in verdict.reason

    @pytest.mark.parametrize("heights", [(), (30.0,)])
    def test_nothing_to_compare_with(
        self, windows: tuple[Patch, Patch], heights: tuple[float, ...], context: Context
    ) -> None:
        evidence = PoseEvidence.of(windows, ANY, candidates(*heights), True, context)
        assert not decide(evidence).accepted
        assert evidence.rival_ratio is None


@pytest.fixture(scope="module")
def searched(windows: tuple[Patch, Patch], context: Context) -> PoseEvidence:
    """Return the evidence for what another search found, which the exhaustive one does not see."""
    return PoseEvidence.of(windows, ANY, [PoseFound(TRUTH, 99.0)], False, context)


class TestWhatAnotherSearchFound:
    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("pose", "accepted"),
        [
            (TRUTH, True),
            (replace(TRUTH, rotation_deg=50.5, shift_px=(4.6, -6.5)), True),
            (replace(TRUTH, rotation_deg=54.0), False),
            (replace(TRUTH, shift_px=(14.0, -6.0)), False),
            (replace(TRUTH, rotation_deg=-130.0), False),
            (Pose(), False),
        ],
    )
    def test_only_the_right_pose_is_accepted(
        self, searched: PoseEvidence, pose: Pose, accepted: bool
    ) -> None:
        verdict = decide(replace(searched, found=[PoseFound(pose, 99.0)]))
        assert verdict.accepted == accepted
        assert accepted or "prefers" in verdict.reason

    @pytest.mark.slow
    def test_a_pose_that_the_limits_hid(
        self, windows: tuple[Patch, Patch], context: Context
    ) -> None:
        limits = SearchLimits(30, 10, (1.0, 1.0))
        found = find_poses(*windows, limits, context)
        verdict = decide(PoseEvidence.of(windows, limits, found, True, context))
        assert not verdict.accepted
        assert "prefers 50" in verdict.reason or "prefers 49" in verdict.reason


@pytest.mark.slow
def test_a_repetition_whose_right_place_lies_beyond_the_radius(context: Context) -> None:
    """A scene that repeats after 32 px, shifted by 25 px, also matches at a shift of 7 px."""
    rng = np.random.default_rng(7)
    scene = np.tile(texture(32, 32, 3), (8, 8))
    reference, input = (
        patch(100 + 30 * (shown + 0.3 * rng.normal(size=shown.shape)))
        for shown in (scene[30:190, 30:190], scene[30:190, 5:165])
    )
    limits = SearchLimits(10, 10, (1.0, 1.0))
    found = find_poses(reference, input, limits, context)
    assert abs(found[0].pose.shift_px[0] + 7) < 1
    evidence = PoseEvidence.of((reference, input), limits, found, True, context)
    assert not decide(evidence).accepted


@pytest.mark.slow
@pytest.mark.parametrize("seed", [20, 21, 22])
def test_two_places_are_refused(seed: int, context: Context) -> None:
    windows = turned_pair(TRUTH, seed=seed, input_seed=seed + 100)
    found = find_poses(*windows, ANY, context)
    assert not decide(PoseEvidence.of(windows, ANY, found, True, context)).accepted


def test_windows_without_content_are_refused(context: Context) -> None:
    flat = patch(np.ones((50, 50)))
    evidence = PoseEvidence.of((flat, flat), ANY, [PoseFound(Pose(), 9.0)], False, context)
    verdict = decide(evidence)
    assert not verdict.accepted
    assert "too little" in verdict.reason
