"""The verdict on a pose: whether it stands out so far that it cannot be chance.

It rests on the candidates of a search, then on chips all over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..context import Context
from ..geometry.accuracy import Common, ErrorModel
from ..geometry.judging import SMALLEST_INLIER_SHARE, SMALLEST_SHARE_UNROTATED
from ..geometry.limits import SearchLimits
from ..geometry.misses import Misses
from ..masks.used import MaskUsed
from ..matching.pose_survey import POSE_TOLERANCE_PX, PoseSurvey, survey_pose
from ..matching.shared_content import Sensors
from ..matching.survey import SURVEY_RADIUS_PX
from ..matching.surveys import Surveys
from ..pose.pose import Pose, PoseFound
from ..pose.rotation_windows import DEFAULT_RADIUS_SHARE, PoseWindows
from ..pose.search import find_poses, moved_px
from ..rasters.pair import Image, make_pair
from ..rasters.patch import Patch
from .evidence import AGREEMENT, BANDS, ERROR, POSE, SURVEY, Agreement, ImagesEvidence, outside_hull
from .layover import CHIPS_MEAN_OVER_SCATTER, mean_of_heights_px
from .rules.pose import SAME_SHARE
from .scene import SceneInfo
from .verdict import Verdict, judge


@dataclass(frozen=True)
class PoseEvidence:
    """Evidence for a pose from the candidates of a search.

    Parameters
    ----------
    found
        The poses that a search found, best first.
    exhaustive
        The poses of an exhaustive search over all rotations, best first.
    shape
        Rows and columns of the reference.
    """

    found: Sequence[PoseFound]
    exhaustive: Sequence[PoseFound]
    shape: tuple[int, int]

    stages: ClassVar = (POSE,)

    @classmethod
    def of(
        cls,
        windows: tuple[Patch, Patch],
        limits: SearchLimits,
        found: Sequence[PoseFound],
        exhaustive: bool,
        context: Context,
    ) -> PoseEvidence:
        """Compare the candidates of a search with those of an exhaustive one over all rotations.

        Rotations and shifts beyond the limits measure the height of chance, and may hold a better
        pose: where the scene repeats, one within small limits is as good as the right one.

        Parameters
        ----------
        windows
            Reference and input.
        limits
            The limits of the search.
        found
            What the search found, best first.
        exhaustive
            Whether the search was `find_poses`; it is not repeated if it was over all rotations.
        context
            Threads to work in.
        """
        everything = found
        least_radius = DEFAULT_RADIUS_SHARE * max(windows[1].values.shape)
        is_wide = limits.rotation_deg >= 180 and limits.radius >= least_radius
        if found and not (exhaustive and is_wide):
            low, high = limits.scale
            radius = max(limits.radius, least_radius)
            wide = SearchLimits(radius, 180.0, (min(low, 0.8), max(high, 1.25)))
            everything = find_poses(*windows, wide, context)
        rows, cols = windows[0].values.shape
        return cls(found, everything, (rows, cols))

    @property
    def height(self) -> float:
        """Height of the best exhaustive pose, in robust standard deviations."""
        return self.exhaustive[0].height if self.exhaustive else 0.0

    @property
    def rival_ratio(self) -> float | None:
        """Ratio of `height` to the height of the best pose elsewhere; None if there is none."""
        if len(self.exhaustive) < 2:
            return None
        return self.exhaustive[0].height / self.exhaustive[1].height

    @property
    def apart_px(self) -> float:
        """By how much the found pose moves the reference's corners against the exhaustive one."""
        return moved_px(self.exhaustive[0].pose, self.found[0].pose, self.shape)

    def summary(self) -> dict[str, Any]:
        """Return how high the pose stands, as values that JSON can carry."""
        return {"height": self.height, "rival_ratio": self.rival_ratio}


@dataclass(frozen=True)
class PoseSurveyEvidence(ImagesEvidence):
    """Evidence for a pose from chips all over a pair.

    Parameters
    ----------
    found
        The survey of these chips.
    layover_factor
        See `RegistrationEvidence`.
    is_shift
        Whether the pose neither rotates nor scales, as far as chips show.
    """

    found: PoseSurvey
    layover_factor: float | None = None
    is_shift: bool = False

    stages: ClassVar = (BANDS, AGREEMENT, ERROR, SURVEY)
    judged: ClassVar = "it, and no other pose matches nearly as well"
    # The pose comes from a search: it was not fitted to the chips.
    fit_points: ClassVar = 0
    fit_points_used: ClassVar = 0

    @property
    def metres_per_px(self) -> float | None:
        """Side of a pixel that the chips were matched at; None without georeferencing."""
        return self.found.grid.metres_per_pixel

    @property
    def surveys(self) -> Surveys:
        """What the chips show of the pose."""
        return self.found.surveys

    @cached_property
    def held_out(self) -> Agreement:
        """How each chip agrees with the pose that the other chips give."""
        return Agreement.of(
            "chips all over",
            self._error,
            len(self.found.agrees),
            "the overlap",
            self.found.grid.places(),
            least_share=SMALLEST_SHARE_UNROTATED if self.is_shift else SMALLEST_INLIER_SHARE,
        )

    @cached_property
    def _error(self) -> ErrorModel:
        is_known = np.isfinite(self.found.residuals_px).all(axis=1)
        misses = Misses(
            self.found.px[is_known].astype(float),
            self.found.residuals_px[is_known],
            SURVEY_RADIUS_PX,
            POSE_TOLERANCE_PX,
            POSE_TOLERANCE_PX,
        )
        heights = mean_of_heights_px(self.surveys.whole, self.layover_factor, POSE_TOLERANCE_PX)
        return ErrorModel(self.found.fold_models, misses, Common(2 * heights))

    @property
    def extrapolated_share(self) -> float:
        """Share of the overlap outside of the hull of the chips that agree."""
        grid, agreeing = self.found.grid, self.found.px[self.found.agrees]
        return outside_hull(agreeing.astype(float), grid.size)


def confirm_pose(
    images: tuple[Image, Image], windows: PoseWindows, pose: Pose, context: Context
) -> tuple[Verdict, Pose]:
    """Return the verdict on a pose that a search found, and, if accepted, the pose by all chips.

    Parameters
    ----------
    images
        Reference and input.
    windows
        The windows that the pose was found in.
    pose
        The pose.
    context
        Threads to work in.
    """
    scale = max(pose.scale, 1 / pose.scale)
    pair = make_pair(*images, None, windows.radius_m, 180.0, scale)
    scene = SceneInfo.of(pair)
    transform = windows.transform(pose)
    found = survey_pose(pair, transform, SAME_SHARE, scene.kinds_by(transform.model), context)
    factor = CHIPS_MEAN_OVER_SCATTER if scene.sensors is Sensors.RADARS else None
    moved = windows.pose(found.transform)
    grid, shift = windows.reference_grid, Pose(shift_px=moved.shift_px)
    is_shift = moved_px(moved, shift, (grid.height, grid.width)) <= POSE_TOLERANCE_PX
    mask = MaskUsed.none("a pose is searched for without a mask")
    evidence = PoseSurveyEvidence(scene, mask, POSE_TOLERANCE_PX, found, factor, is_shift)
    verdict = judge(evidence)
    # The chips confirm the pose to which they moved it.
    return verdict, moved if verdict.accepted else pose
