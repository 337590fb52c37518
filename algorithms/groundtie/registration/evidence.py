"""The evidence for a verdict: numbers and facts that the rules of `rules.RULES` read."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Protocol

import cv2
import numpy as np

from ..errors import GroundTieError
from ..geometry.accuracy import UNKNOWN, Accuracy, Common, ErrorModel
from ..geometry.estimation import Estimate, jackknife_spread
from ..geometry.judging import LARGEST_LOG10_CHANCE, SMALLEST_INLIER_SHARE, ce90_of_rmse
from ..geometry.misses import Misses
from ..geometry.tie_points import TiePoints
from ..masks.used import MaskUsed
from ..matching.check import CHECK_RADIUS_PX
from ..matching.surveys import Surveys
from ..rasters.grid import FloatArray, Grid
from .layover import mean_of_heights_px
from .scene import SceneInfo
from .surface_masks import ModelFit

# Stages of a registration, in the order in which their rules are asked.
TIE_POINTS, BANDS, IMAGES, SEARCH = "tie points", "bands", "images", "search"
ASSESSMENT, POSE, AGREEMENT = "assessment", "pose", "agreement"
ERROR, SCENE, SURVEY = "error", "scene", "survey"
REFINEMENT, SERIES = "refinement", "series"


class Evidence(Protocol):
    """The basis of a verdict; its stages name the rules that read it."""

    @property
    def stages(self) -> Collection[str]: ...


@dataclass(frozen=True)
class ImagesEvidence:
    """Facts about a pair that are known before matching, and judged again after it.

    Parameters
    ----------
    scene
        Facts about the images.
    mask
        Which mask of the ground is used.
    max_error_px
        Largest error that is accepted, in matching pixels.
    """

    scene: SceneInfo
    mask: MaskUsed
    max_error_px: float

    stages: ClassVar[Collection[str]] = (BANDS, IMAGES)


@dataclass(frozen=True)
class SearchEvidence:
    """The failure of a search or a fit to find any transform.

    Parameters
    ----------
    failure
        The error that it ended with.
    """

    failure: GroundTieError

    stages: ClassVar = (SEARCH,)


@dataclass(frozen=True)
class Agreement:
    """How held-out points agree with a fit.

    Parameters
    ----------
    name
        Name of the points, such as "check points".
    agreeing, total
        How many agree with the model, and how many there are.
    log10_chance
        log10 of the probability that random matches would agree as well.
    rmse_px
        Root mean square error of inliers.
    max_error_px
        The largest root mean square error that is accepted.
    spread_px
        Standard deviation of the model's predictions (root mean square).
    area
        The area of the predictions, such as "the overlap".
    accuracy
        The error of the transform at a random place of the area.
    least_share
        The smallest share that must agree.
    """

    name: str
    agreeing: int
    total: int
    log10_chance: float
    rmse_px: float
    max_error_px: float
    spread_px: float
    area: str
    accuracy: Accuracy = UNKNOWN
    least_share: float = SMALLEST_INLIER_SHARE

    @classmethod
    def of(
        cls,
        name: str,
        error: ErrorModel,
        total: int,
        area: str,
        places_px: FloatArray,
        tries: int = 1,
        least_share: float = SMALLEST_INLIER_SHARE,
        least_spread_px: FloatArray | float = 0.0,
    ) -> Agreement:
        """Return how points agree, by the error model of a transform.

        Parameters
        ----------
        error
            The error model; its check points are those with a peak.
        total
            How many points there are, with and without a peak.
        places_px
            Places all over the area, shape (n, 2).
        tries
            How many registrations were tried, any of which might agree by chance.
        least_spread_px
            Lower limit of the standard deviation of the model's predictions there, shape (n,).
        """
        misses = error.check
        chance = min(misses.log10_chance(total) + math.log10(tries), 0.0)
        spread_px = np.maximum(jackknife_spread(error.fold_models, places_px), least_spread_px)
        return cls(
            name,
            misses.agreeing,
            total,
            chance,
            misses.rmse_px,
            misses.max_error_px,
            float(np.sqrt(np.mean(spread_px**2))),
            area,
            error.accuracy(places_px),
            least_share,
        )

    @property
    def largest_ce90_px(self) -> float:
        """Largest CE90 that is accepted: that of the largest root mean square error."""
        return ce90_of_rmse(self.max_error_px)


class EvidenceOfPoints(Evidence, Protocol):
    """Evidence that includes held-out points.

    Parameters
    ----------
    judged
        What the points confirm or refute, in words.
    held_out
        How the points agree.
    fit_points, fit_points_used
        How many points the fit had, and how many of them it used.
    metres_per_px
        Ground size of the pixels that errors are measured in; None: not known.
    extrapolated_share
        Share of the area outside of the hull of the points that determine the model.
    """

    @property
    def judged(self) -> str: ...
    @property
    def held_out(self) -> Agreement: ...
    @property
    def fit_points(self) -> int: ...
    @property
    def fit_points_used(self) -> int: ...
    @property
    def metres_per_px(self) -> float | None: ...
    @property
    def extrapolated_share(self) -> float: ...


@dataclass(frozen=True)
class RegistrationEvidence(ImagesEvidence):
    """Evidence for a registration that has check points.

    Parameters
    ----------
    estimate
        The transform and the points of the fit.
    check
        Check points, searched for around the positions that the transform predicts.
    grid
        The matching grid, cut to the overlap.
    tries
        How many registrations were tried, any of which might agree by chance.
    layover_factor
        Ratio of the displacement of the model by heights to the scatter of matched points by
        heights; None: not two radar images.
    surveys
        Surveys by chips all over the overlap.
    input_fit
        How well a surface model fits the registered input; None: it predicts nothing of it.
    exchanged
        How check points of the pair with exchanged roles agree; None: they were not needed.
    """

    estimate: Estimate
    check: TiePoints
    grid: Grid
    tries: int = 1
    layover_factor: float | None = None
    surveys: Surveys = field(default_factory=Surveys)
    input_fit: ModelFit | None = None
    exchanged: Agreement | None = None

    stages: ClassVar = (BANDS, IMAGES, AGREEMENT, ERROR, SCENE, SURVEY)
    judged: ClassVar = "the registration"

    @property
    def fit_points(self) -> int:
        """How many points the fit had."""
        return len(self.estimate.points)

    @property
    def fit_points_used(self) -> int:
        """How many of them it used."""
        return int(self.estimate.points.used.sum())

    @property
    def metres_per_px(self) -> float | None:
        """Side of a matching pixel; None without georeferencing."""
        return self.grid.metres_per_pixel

    @cached_property
    def counted(self) -> TiePoints:
        """Check points with a peak inside their search window."""
        return self.check.take(self.check.used)

    @cached_property
    def residuals_px(self) -> FloatArray:
        """Residuals of the counted check points, in matching pixels, shape (n, 2)."""
        return self.counted.residual_on(self.grid, self.estimate.transform)

    @cached_property
    def held_out(self) -> Agreement:
        """How the check points agree; those without a peak count as disagreeing."""
        count, places = len(self.check), self.grid.places()
        return Agreement.of("check points", self.error, count, "the overlap", places, self.tries)

    @property
    def needs_second_confirmation(self) -> bool:
        """Whether so few check points agree that the exchanged pair must confirm the transform.

        By chance, both pass with a probability of about the square of the limit. Agreement that is
        already as improbable needs no second pass.
        """
        return self.held_out.log10_chance > 2 * LARGEST_LOG10_CHANCE

    @cached_property
    def error(self) -> ErrorModel:
        """The model of the transform's error, in matching pixels.

        Its common part is the displacement of all points alike by heights and elevated objects.
        """
        places = self.grid.map_to_pixel(self.counted.reference_xy)
        misses = Misses(places, self.residuals_px, CHECK_RADIUS_PX, self.max_error_px)
        common = Common(self._heights_px, self.mask.elevated_px)
        return ErrorModel(self.estimate.folds_on(self.grid), misses, common)

    @cached_property
    def _heights_px(self) -> FloatArray:
        mean = mean_of_heights_px(self.surveys.whole, self.layover_factor, self.max_error_px)
        return mean if self.mask.is_ground else 2 * mean

    @property
    def extrapolated_share(self) -> float:
        """Share of the overlap outside of the hull of the points that were used."""
        fitted, size = self.estimate.points, self.grid.size
        return outside_hull(self.grid.map_to_pixel(fitted.reference_xy[fitted.used]), size)


@dataclass(frozen=True)
class DateEvidence:
    """How a date is connected with its series.

    Parameters
    ----------
    failure
        Why its file cannot be used; empty: it can.
    refusals
        Why registrations to other dates were refused, one each.
    links
        How many registrations to other dates were accepted, and are used.
    rejected
        How many were accepted, but contradict the rest of the network.
    open_loops, loops
        How many loops over it and two other dates do not close, and how many loops there are.
    is_reached
        Whether links lead to it from the reference, or from most of the other dates.
    is_confirmed
        Whether a second way leads to it.
    is_refused_by_hub
        Whether its registration to the reference, or to the date with the most links, was refused.
    """

    failure: str = ""
    refusals: Sequence[str] = ()
    links: int = 0
    rejected: int = 0
    open_loops: int = 0
    loops: int = 0
    is_reached: bool = True
    is_confirmed: bool = False
    is_refused_by_hub: bool = False

    stages: ClassVar = (SERIES,)

    def reasons(self) -> str:
        """Return why registrations were refused, the most frequent reason first."""
        counted = Counter(self.refusals).most_common(2)
        return "; ".join(f"{reason} ({count} of {len(self.refusals)})" for reason, count in counted)


def outside_hull(px: FloatArray, size: tuple[int, int]) -> float:
    """Return the share of an image of `size`, (width, height), outside of the hull of points."""
    if len(px) < 3 or not np.isfinite(px).all():
        return 1.0
    area = cv2.contourArea(cv2.convexHull(px.astype(np.float32)))
    return float(np.clip(1 - area / (size[0] * size[1]), 0, 1))
