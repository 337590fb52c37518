"""The coarse shift or pose: exhaustive search of a reduced image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.fitting import fit_model
from ..geometry.models import Model, shift_model
from ..geometry.transform import Transform
from ..pose.rotation_windows import read_windows
from ..pose.search import find_poses
from ..rasters.grid import Grid, near_longitude
from ..rasters.pair import ImagePair, require_content
from ..rasters.patch import Patch
from ..similarity.correlation import MINIMUM_OVERLAP, overlap_share
from ..similarity.description import BORDER_PX
from ..similarity.peak import Peak, find_peak
from ..similarity.peaks import suppress
from ..similarity.surface import SimilaritySettings, Surface, describe, similarity_surface
from .frames import compose
from .matcher import MaskOf

# The longer side of the reduced image, in pixels, and the number of candidates kept.
LEVEL_SIDE_PX = 512
MOST_CANDIDATES = 4

# Candidates lower than this share of the best are not worth their cost.
_LOW = 0.4

# Candidates nearer than this are the same, in pixels of the level.
SAME_PLACE_PX = 4
_SAME_PLACE = np.ones((2 * SAME_PLACE_PX + 1,) * 2, bool)

# Few bins keep counting over a large search window fast, and are enough for whole scenes.
_LEVEL_BINS = 8


@dataclass(frozen=True)
class Candidate:
    """A model of degree 1 on the map that may align the images, and the height of its peak."""

    model: Model
    height: float


def level_factor(grid: Grid) -> float:
    """Return how many times coarser than the matching grid the coarse search's level is."""
    return max(max(grid.size) / LEVEL_SIDE_PX, 1.0)


@dataclass(frozen=True)
class LevelSearch:
    """A whole pair on a level of the pyramid, compared at many shifts or poses.

    Parameters
    ----------
    pair
        The images.
    level
        The matching grid at reduced resolution.
    settings
        The similarity measure.
    held_out
        Takes a piece of the grid and returns which pixels of the reference are hidden; None: none.
    context
        Threads.
    """

    pair: ImagePair
    level: Grid
    settings: SimilaritySettings
    held_out: MaskOf | None
    context: Context

    def candidates(self) -> list[Candidate]:
        """Return the best shifts or poses, best first, within the limits of the pair.

        Raises
        ------
        RasterContentError
            One of the images is constant or has no valid pixel in the overlap, perhaps due to its
            mask.
        """
        pair, level, limits = self.pair, self.level, self.pair.limits
        if limits.is_shift:
            places = self._places(shift_model(0.0, 0.0))
            return [Candidate(_shift_on_map(place, level), place.height) for place in places]
        windows = read_windows(
            pair.reference, pair.input, limits.scale, limits.radius, self.held_out
        )
        pose_limits = windows.limits(limits.rotation_deg, limits.scale)
        found = find_poses(windows.reference, windows.input, pose_limits, self.context.quiet())
        high = [one for one in found[:MOST_CANDIDATES] if one.height > found[0].height * _LOW]
        poses = [Candidate(_on_map(windows.transform(one.pose), level), one.height) for one in high]
        if not poses:
            return []
        poses += _elsewhere(poses[0], self._places(poses[0].model), level)
        return sorted(poses, key=lambda one: one.height, reverse=True)

    def _places(self, model: Model) -> list[Peak]:
        """Search all shifts relative to a model; return the highest peaks of their similarity."""
        level = self.level
        # The true shift may lie a pixel of the level beyond the nearest whole pixel.
        radius_px = int(np.ceil(self.pair.limits.radius / min(level.pixel_sides_m))) + 1
        # At larger shifts the images overlap too little.
        radius_px = min(radius_px, int((1 - MINIMUM_OVERLAP) * max(level.size)))
        surface, _ = self.surface(model, radius_px)
        found: list[Peak] = []
        for _ in range(MOST_CANDIDATES):
            peak = find_peak(surface)
            if peak.height <= (found[0].height * _LOW if found else 0.0):
                break
            found.append(peak)
            x, y = peak.shift_px
            suppress(surface, (round(y) + radius_px, round(x) + radius_px), _SAME_PLACE)
        return found

    def surface(
        self, model: Model, radius_px: int
    ) -> tuple[Surface, Callable[[], NDArray[np.float32]]]:
        """Compare the pair at shifts of up to a radius relative to a model.

        Returns
        -------
        The similarity, shape (2 radius_px + 1, 2 radius_px + 1); and a function that returns, in
        the same shape, the share of the reference's valid pixels that meets valid ones.
        """
        settings, context, level = self.settings, self.context, self.level
        if settings.bins is None:
            settings = replace(settings, bins=_LEVEL_BINS)
        reference, input = self._patches(model, radius_px + BORDER_PX)
        # Only the unmasked share of the input can overlap with the reference.
        valid = 1.0 if self.pair.input.mask is None else input.valid_share
        template = describe(reference, level.width * level.height, settings, context.memo)
        search = describe(input, level.width * level.height, settings)
        surface = similarity_surface(template, search, radius_px, settings, context.quiet(), valid)
        return surface, partial(overlap_share, template.patch, search.patch)

    def _patches(self, model: Model, reach: int) -> tuple[Patch, Patch]:
        """Return the reference with a margin around the level, and the input with a wider one."""
        pair, level = self.pair, self.level
        template, search = level.widened(BORDER_PX), level.widened(reach)
        hidden = None if self.held_out is None else self.held_out(template)
        of_reference = template, pair.reference.source.grid.map_to_pixel, hidden
        of_input = search, pair.transform(model)
        reading = self.context.executor.submit(pair.reference.read_onto, *of_reference)
        input = pair.input.read_onto(*of_input)
        reference = reading.result()
        where = "where the images overlap"
        require_content(pair.reference, reference, where, *of_reference)
        require_content(pair.input, input, where, *of_input)
        return reference, input


def _shift_on_map(place: Peak, level: Grid) -> Model:
    dx, dy = level.pixel_to_map([place.shift_px])[0] - level.pixel_to_map([[0, 0]])[0]
    return shift_model(float(dx), float(dy))


def _elsewhere(pose: Candidate, places: list[Peak], level: Grid) -> list[Candidate]:
    """Return candidates with the rotation and scale of a pose at other shifts.

    The pose search keeps one shift for each rotation and scale, but repetitive scenes match at
    several. The pose's height is scaled by the similarity at each shift relative to its own.
    """

    def is_own(place: Peak) -> bool:
        return max(map(abs, place.shift_px)) <= SAME_PLACE_PX

    own = max((place.height for place in places if is_own(place)), default=0.0)
    if own <= 0:
        return []
    return [
        Candidate(
            compose(pose.model, shift_model(*place.shift_px), level),
            pose.height * place.height / own,
        )
        for place in places
        if not is_own(place)
    ]


def _on_map(transform: Transform, level: Grid) -> Model:
    """Return a transform of degree 1 as a model from map positions to nominal map positions."""
    xy = level.pixel_to_map(level.outline(4))
    nominal = near_longitude(transform.nominal_xy(transform(xy)), xy[:, :1], transform.crs)
    return fit_model("affine", xy, nominal)
