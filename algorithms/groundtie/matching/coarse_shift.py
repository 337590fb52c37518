"""The coarse shift or pose, and places far from a model: exhaustive search of a reduced image."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..context import Context
from ..geometry.fitting import fit_model
from ..geometry.judging import RIVAL_HEIGHT
from ..geometry.models import Model, shift_model
from ..geometry.transform import Transform
from ..pose.rotation_windows import DEFAULT_RADIUS_SHARE, read_windows
from ..pose.search import find_poses
from ..rasters.grid import Grid, near_longitude
from ..rasters.held_images import held_on_level
from ..rasters.pair import Image, ImagePair, require_content
from ..rasters.patch import Patch
from ..similarity.correlation import MINIMUM_OVERLAP
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
_SAME_PLACE = np.ones((2 * 4 + 1,) * 2, bool)

# What a scene that repeats has in common with itself, whatever grows there: borders and roads.
_EDGES = SimilaritySettings("orientation")

# Few bins keep counting over a large search window fast, and are enough for whole scenes.
_BINS = 8


@dataclass(frozen=True)
class Candidate:
    """A model of degree 1 on the map that may align the images, and the height of its peak."""

    model: Model
    height: float


@dataclass(frozen=True)
class FarPlace:
    """The best match of a whole pair far from a model, beside the model's own.

    Parameters
    ----------
    own_height, height
        Similarity at the model and at the far place, in robust standard deviations.
    distance_px
        Distance of the far place, in pixels of the matching grid.
    """

    own_height: float
    height: float = 0.0
    distance_px: float = 0.0

    @property
    def is_rival(self) -> bool:
        """Whether the pair matches about as well there."""
        return self.height >= RIVAL_HEIGHT * self.own_height


def level_factor(grid: Grid) -> float:
    """Return how many times coarser than the matching grid the coarse search's level is."""
    return max(max(grid.size) / LEVEL_SIDE_PX, 1.0)


def coarse_candidates(
    pair: ImagePair,
    level: Grid,
    settings: SimilaritySettings,
    held_out: MaskOf | None,
    context: Context,
) -> list[Candidate]:
    """Return the best shifts or poses, best first, within the limits of a pair.

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

    Raises
    ------
    RasterContentError
        One of the images is constant or has no valid pixel in the overlap, perhaps due to its mask.
    """
    if settings.bins is None:
        settings = replace(settings, bins=_BINS)
    limits = pair.limits
    if limits.is_shift:
        nominal = shift_model(0.0, 0.0)
        places = _places(pair, level, settings, held_out, context, nominal)
        return [Candidate(_shift_on_map(place, level), place.height) for place in places]
    windows = read_windows(pair.reference, pair.input, limits.scale, limits.radius, held_out)
    pose_limits = windows.limits(limits.rotation_deg, limits.scale)
    found = find_poses(windows.reference, windows.input, pose_limits, context.quiet())
    high = [one for one in found[:MOST_CANDIDATES] if one.height > found[0].height * _LOW]
    poses = [Candidate(_on_map(windows.transform(one.pose), level), one.height) for one in high]
    if not poses:
        return []
    places = _places(pair, level, settings, held_out, context, poses[0].model)
    poses += _elsewhere(poses[0], places, level)
    return sorted(poses, key=lambda one: one.height, reverse=True)


def _shift_on_map(place: Peak, level: Grid) -> Model:
    dx, dy = level.pixel_to_map([place.shift_px])[0] - level.pixel_to_map([[0, 0]])[0]
    return shift_model(float(dx), float(dy))


def _elsewhere(pose: Candidate, places: list[Peak], level: Grid) -> list[Candidate]:
    """Return candidates with the rotation and scale of a pose at other shifts.

    The pose search keeps one shift for each rotation and scale, but repetitive scenes match at
    several. The pose's height is scaled by the similarity at each shift relative to its own.
    """
    near_px = _SAME_PLACE.shape[0] // 2

    def is_own(place: Peak) -> bool:
        return max(map(abs, place.shift_px)) <= near_px

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


def _places(
    pair: ImagePair,
    level: Grid,
    settings: SimilaritySettings,
    held_out: MaskOf | None,
    context: Context,
    model: Model,
) -> list[Peak]:
    """Search all shifts relative to a model, and return the highest peaks of their similarity."""
    # The true shift may lie a pixel of the level beyond the nearest whole pixel.
    radius_px = int(np.ceil(pair.limits.radius / min(level.pixel_sides_m))) + 1
    # At larger shifts the images overlap too little.
    radius_px = min(radius_px, int((1 - MINIMUM_OVERLAP) * max(level.size)))
    surface = _surface(pair, level, settings, held_out, context, model, radius_px)
    found: list[Peak] = []
    for _ in range(MOST_CANDIDATES):
        peak = find_peak(surface)
        if peak.height <= (found[0].height * _LOW if found else 0.0):
            break
        found.append(peak)
        x, y = peak.shift_px
        suppress(surface, (round(y) + radius_px, round(x) + radius_px), _SAME_PLACE)
    return found


def far_place(pair: ImagePair, model: Model, beyond_px: float, context: Context) -> FarPlace:
    """Return where a whole pair matches best far from a model, by the orientation of its edges.

    Shifts of up to a quarter of the longer side are compared.

    Parameters
    ----------
    pair
        The images.
    model
        The misregistration on the map.
    beyond_px
        Nearer places do not count, in pixels of the matching grid.
    context
        Threads.
    """
    factor = level_factor(pair.grid)
    level = pair.grid.scaled(factor)
    held = held_on_level(pair, level, context)
    radius_px = int(DEFAULT_RADIUS_SHARE * max(level.size))
    surface = _surface(held, level, _EDGES, None, context, model, radius_px)
    shifts = np.arange(-radius_px, radius_px + 1)
    distance_px = np.hypot(*np.meshgrid(shifts, shifts))
    same_px = _SAME_PLACE.shape[0] // 2
    own = float(surface[distance_px <= same_px].max())
    is_far = distance_px > max(beyond_px / factor, 2 * same_px)
    at = np.argmax(np.where(is_far, surface, -np.inf))
    if not is_far.flat[at]:
        return FarPlace(own)
    return FarPlace(own, float(surface.flat[at]), float(distance_px.flat[at]) * factor)


def _surface(
    pair: ImagePair,
    level: Grid,
    settings: SimilaritySettings,
    held_out: MaskOf | None,
    context: Context,
    model: Model,
    radius_px: int,
) -> Surface:
    """Return the similarity of a whole pair at shifts of up to a radius relative to a model."""
    reach = radius_px + BORDER_PX
    reference, input = _patches(pair, level, model, reach, held_out, context)
    # Only the unmasked share of the input can overlap with the reference.
    valid = 1.0 if pair.input.mask is None else input.valid_share
    return similarity_surface(
        describe(reference, level.width * level.height, settings, context.memo),
        describe(input, level.width * level.height, settings),
        radius_px,
        settings,
        context.quiet(),
        MINIMUM_OVERLAP * valid,
    )


def _patches(
    pair: ImagePair,
    level: Grid,
    model: Model,
    reach: int,
    held_out: MaskOf | None,
    context: Context,
) -> tuple[Patch, Patch]:
    """Return the reference with a margin around the level, and the input with a wider one."""
    template, search = (
        level.window(-more, -more, level.width + 2 * more, level.height + 2 * more)
        for more in (BORDER_PX, reach)
    )
    hidden = None if held_out is None else held_out(template)

    def of_reference(image: Image) -> Patch:
        return replace(pair, reference=image).reference_patch(template, hidden)

    def of_input(image: Image) -> Patch:
        return replace(pair, input=image).input_patch(search, pair.transform(model))

    reading = context.executor.submit(of_reference, pair.reference)
    input = of_input(pair.input)
    reference = reading.result()
    where = "where the images overlap"
    require_content(pair.reference, reference, of_reference, where)
    require_content(pair.input, input, of_input, where)
    return reference, input


def _on_map(transform: Transform, level: Grid) -> Model:
    """Return a transform of degree 1 as a model from map positions to nominal map positions."""
    xy = level.pixel_to_map(level.outline(4))
    nominal = near_longitude(transform.nominal_xy(transform(xy)), xy[:, :1], transform.crs)
    return fit_model("affine", xy, nominal)
