"""The verdict on a pose: whether it stands out so far that it cannot be chance."""

from __future__ import annotations

from ..context import Context
from ..matching.pose_survey import POSE_TOLERANCE_PX, survey_pose
from ..pose.pose import Pose
from ..pose.rotation_windows import PoseWindows
from ..pose.search import moved_px
from ..rasters.pair import Image, make_pair
from .layover import CHIPS_MEAN_OVER_SCATTER
from .pose_evidence import PoseEvidence, PoseSurveyEvidence
from .rules.pose import SAME_SHARE
from .scene import SceneInfo
from .verdict import Verdict, decide, judge


def judge_pose(evidence: PoseEvidence) -> Verdict:
    """Return the verdict on the best candidate of a search."""
    return decide(evidence, "no other pose matches nearly as well")


def confirm_pose(
    images: tuple[Image, Image], windows: PoseWindows, pose: Pose, context: Context
) -> tuple[Verdict, Pose]:
    """Return the verdict on a pose that the search believes, and where chips all over move it.

    Parameters
    ----------
    images
        Reference and input.
    windows
        What the pose was found in.
    pose
        The pose.
    context
        Threads to work in.
    """
    scale = max(pose.scale, 1 / pose.scale)
    pair = make_pair(*images, None, windows.radius_m, 180.0, scale)
    scene = SceneInfo.of(pair)
    transform = windows.transform(pose)
    found = survey_pose(pair, transform, SAME_SHARE, scene.sensors, scene.open_ground, context)
    factor = CHIPS_MEAN_OVER_SCATTER if scene.are_both_radar else None
    moved = windows.pose(found.transform)
    grid, shift = windows.reference_grid, Pose(shift_px=moved.shift_px)
    is_shift = moved_px(moved, shift, (grid.height, grid.width)) <= POSE_TOLERANCE_PX
    verdict = judge(PoseSurveyEvidence(found, factor, is_shift))
    # What the chips confirm is where they have moved it.
    return verdict, moved if verdict.accepted else pose
