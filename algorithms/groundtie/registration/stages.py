"""The stages of a registration between its masks and its verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..context import Context
from ..features.descriptors import SiftDescriptor
from ..features.detectors import SiftDetector, SiftOctDetector
from ..features.hog import HogDescriptor
from ..geometry.estimation import Estimate
from ..geometry.models import TERRAIN, Model, shift_model
from ..masks.used import NONE
from ..matching.alignment import LINEAR_CANDIDATES, TERRAIN_CANDIDATES
from ..matching.check import Check, check_model
from ..matching.chips import ChipMatcher
from ..matching.held_out import HeldOut
from ..matching.keypoint_fit import GuidedFit, KeypointFit
from ..matching.keypoints import KeypointMatcher
from ..matching.locked import EXACT_PX
from ..matching.parts import ELSEWHERE_PX
from ..matching.pooled import PooledHistogramMatcher
from ..matching.pyramid import find_coarse_model
from ..matching.shared_content import ImageKinds, Sensors
from ..matching.surface_fit import SurfaceFit, SurfaceMatcher
from ..matching.survey import survey_places
from ..matching.surveys import Surveys, survey_all
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch, middle_window
from ..similarity.surface import SimilaritySettings
from .evidence import RegistrationEvidence
from .layover import CHIPS_MEAN_OVER_SCATTER, KEYPOINTS_MEAN_OVER_SCATTER
from .masks import Masked
from .opening import open_terrain
from .specification import CHIPS, KEYPOINTS, Specification
from .surface_masks import ModelFit, fit_of, fit_of_images

Fit = SurfaceFit | KeypointFit | GuidedFit


@dataclass(frozen=True)
class Stages:
    """The stages of one registration, put together as its specification asks.

    Parameters
    ----------
    images
        The pair without masks.
    masked
        The pair with all masks.
    spec
        How it is registered.
    held_out
        The blocks that only check chips may see.
    matcher
        Matches check chips, chips of a `SurfaceFit` and, on reduced images, the coarse shift.
    fit
        Finds tie points near a coarse model, blind to the held-out blocks, and fits a model.
    """

    images: ImagePair
    masked: Masked
    spec: Specification
    held_out: HeldOut
    matcher: SurfaceMatcher
    fit: Fit

    @classmethod
    def of(cls, images: ImagePair, masked: Masked, spec: Specification) -> Stages:
        """Put the stages together; parameters as the class."""
        held_out = HeldOut.of(images)
        settings = SimilaritySettings(spec.similarity)
        chips = ChipMatcher(masked.pair, settings, held_out)
        # Chips share a joint histogram if a mask leaves too little of each.
        is_pooled = (
            spec.matcher == CHIPS
            and masked.used.leaves_little
            and spec.similarity in ("fused", "nmi")
        )
        matcher = (
            PooledHistogramMatcher.of(masked.pair, held_out.layout.chip_px, held_out)
            if is_pooled
            else chips
        )
        fit = _fit(images, masked.pair, matcher, held_out, spec)
        return cls(images, masked, spec, held_out, matcher, fit)

    def exchanged(self) -> Stages:
        """Return the stages of the pair with the roles of its images exchanged."""
        return Stages.of(self.images.exchanged(), self.masked.exchanged(), self.spec)

    def checked(self, context: Context) -> tuple[Estimate, Check]:
        """Return the estimate and its check points.

        Raises
        ------
        NothingFoundError, TooFewPointsError
            The search, or the fit, found no transform.
        """
        context.update(0.0, "searching for the coarse shift")
        coarse = self.coarse(context.part(0.0, 0.45))
        context.update(0.45, "matching tie points")
        estimate = self.fit.estimate(coarse, self.spec.model, context.part(0.45, 0.9))
        context.update(0.9, "checking with points that took no part")
        return estimate, self.check(estimate.transform.model, context.part(0.9, 1.0))

    def coarse(self, context: Context) -> Model:
        """Return the coarse model; images that are placed have no coarse shift."""
        if self.spec.is_placed:
            return shift_model(0.0, 0.0)
        return find_coarse_model(self.matcher, context)

    def check(self, model: Model, context: Context) -> Check:
        """Match the check chips around what a model on the map predicts."""
        return check_model(self.matcher, self.held_out.layout, model, context)

    def survey(self, estimate: Estimate, context: Context) -> Surveys:
        """Match chips all over the masked pair around the estimate."""
        if self.spec.is_placed:
            return Surveys()
        chips = ChipMatcher(self.masked.pair, SimilaritySettings(self.spec.similarity))
        return survey_all(
            chips,
            estimate.transform,
            survey_places(chips.pair.grid),
            (ELSEWHERE_PX, EXACT_PX),
            self._kinds(estimate.transform.model),
            not (self.spec.is_rendered or self.masked.used.leaves_little),
            context,
        )

    def _kinds(self, model: Model) -> ImageKinds:
        """Return what surveys need to know of the images."""
        kinds = self.masked.scene.kinds_by(model)
        sensors = None if self.spec.is_rendered else kinds.sensors
        return replace(kinds, sensors=sensors, is_masked=self.masked.used.kind != NONE)

    def evidence(self, estimate: Estimate, check: Check, surveys: Surveys) -> RegistrationEvidence:
        """Return the evidence for the rules."""
        scene = self.masked.scene
        factor = (
            KEYPOINTS_MEAN_OVER_SCATTER
            if self.spec.matcher == KEYPOINTS
            else CHIPS_MEAN_OVER_SCATTER
        )
        return RegistrationEvidence(
            scene,
            self.masked.used,
            self.spec.largest_error_px,
            estimate,
            check.points,
            self.masked.pair.grid,
            self.spec.tries,
            factor if scene.are_both_rough or scene.sensors is Sensors.RADARS else None,
            surveys,
            self._input_fit(estimate),
        )

    def _input_fit(self, estimate: Estimate) -> ModelFit | None:
        """Return how well a surface model fits the registered input as a whole."""
        surface, pair = self.masked.surface, self.masked.pair

        def registered(piece: Grid) -> Patch:
            return pair.input_patch(piece, estimate.transform)

        if surface is not None:
            grid = surface.scene.grid
            return fit_of(surface, surface.views[-1], lambda at: registered(grid.window(*at)))
        if self.spec.surface_view is not None:
            piece = pair.grid.window(*middle_window(pair.grid))
            return fit_of_images(pair.reference_patch(piece), registered(piece))
        return None


def _fit(
    images: ImagePair,
    pair: ImagePair,
    matcher: SurfaceMatcher,
    held_out: HeldOut,
    spec: Specification,
) -> Fit:
    """Return the fit for the specification's matcher."""
    layout = held_out.layout
    if spec.matcher == CHIPS:
        terrain = None if spec.dem is None else open_terrain(pair, spec.dem, spec.input_dem)
        candidates = spec.candidates if terrain is None else TERRAIN_CANDIDATES
        if spec.is_rendered:
            # Polynomials bend along features that no rendering shows: land cover and layover.
            candidates = tuple(kind for kind in candidates if kind in (*LINEAR_CANDIDATES, TERRAIN))
        return SurfaceFit(matcher, layout, candidates, terrain=terrain)
    shown = pair if pair.is_masked else None
    chips = ChipMatcher(pair, SimilaritySettings(spec.refinement), held_out)
    # Detectors and descriptors were chosen among many by `detector_repeatability` and `make bench`
    # (see `studies`).
    if spec.matcher == KEYPOINTS:
        # For radar images: upright SIFT-OCT ([Suri2010] 6.3).
        keypoints = KeypointMatcher(images, SiftOctDetector(), SiftDescriptor(), held_out, shown)
        return KeypointFit(keypoints, SurfaceFit(matcher, layout), chips)
    # HOG patches ([Patel2017] 4.3) have one size: if they grew with SIFT's keypoints, they would be
    # too small.
    keypoints = KeypointMatcher(images, SiftDetector(), HogDescriptor(), held_out, shown)
    # Polynomials bend along elevated objects: "auto" has the same candidates as with keypoints.
    return GuidedFit(keypoints, SurfaceFit(chips, layout, LINEAR_CANDIDATES))
