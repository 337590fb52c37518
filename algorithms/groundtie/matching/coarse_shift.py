"""The coarse shift or pose: candidates from one exhaustive search over a reduced image."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..context import Context
from ..errors import RasterContentError
from ..geometry.fitting import fit_model
from ..geometry.limits import SearchLimits
from ..geometry.models import Model, shift_model
from ..geometry.transform import Transform
from ..pose.rotation_windows import read_windows
from ..pose.search import find_poses
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.correlation import MINIMUM_OVERLAP
from ..similarity.description import BORDER_PX
from ..similarity.peak import find_peak
from ..similarity.peaks import suppress
from ..similarity.surface import SimilaritySettings, describe, similarity_surface
from .matcher import MaskOf

# The longer side of the reduced image, in pixels, and how many candidates are kept.
LEVEL_SIDE_PX = 512
CANDIDATES = 4

# Candidates lower than this share of the best are not worth their cost.
_LOW = 0.4

# Candidates nearer than this are the same, in pixels of the level.
_SAME_PLACE = np.ones((2 * 4 + 1,) * 2, bool)

# Few bins keep the count over a large search window quick, and are enough for whole scenes.
_BINS = 8


@dataclass(frozen=True)
class Candidate:
    """A model of degree 1 on the map by which the images may match, and its peak's height."""

    model: Model
    height: float


def level_factor(grid: Grid) -> float:
    """Return how much coarser than the matching grid the level of the coarse search is."""
    return max(max(grid.width, grid.height) / LEVEL_SIDE_PX, 1.0)


def coarse_candidates(
    pair: ImagePair,
    level: Grid,
    limits: SearchLimits,
    settings: SimilaritySettings,
    held_out: MaskOf,
    context: Context,
) -> list[Candidate]:
    """Return the best shifts or poses, best first, within the limits of a search.

    Parameters
    ----------
    pair
        The images.
    level
        The matching grid at reduced resolution.
    limits
        How far the input may lie from its nominal place, in metres.
    settings
        How similarity is measured.
    held_out
        Returns for a piece of the grid which pixels of the reference must not be seen.
    context
        Threads.

    Raises
    ------
    RasterContentError
        One of the images is constant or has no valid pixel where they overlap.
    """
    if settings.bins is None:
        settings = replace(settings, bins=_BINS)
    if limits.is_shift:
        return _shifts(pair, level, limits.radius, settings, held_out, context)
    windows = read_windows(pair.reference, pair.input, limits.scale, limits.radius, held_out)
    pose_limits = windows.limits(limits.rotation_deg, limits.scale)
    found = find_poses(windows.reference, windows.input, pose_limits, settings, context.quiet())[
        :CANDIDATES
    ]
    high = [one for one in found if one.height > found[0].height * _LOW]
    return [Candidate(_on_map(windows.transform(one.pose), level), one.height) for one in high]


def _shifts(
    pair: ImagePair,
    level: Grid,
    radius_m: float,
    settings: SimilaritySettings,
    held_out: MaskOf,
    context: Context,
) -> list[Candidate]:
    """Search all shifts, and return the highest peaks of their similarity."""
    # The true place may lie a pixel of the level further than whole pixels show.
    radius_px = int(np.ceil(radius_m / level.pixel_size_m)) + 1
    # Farther off too little of the images overlaps.
    radius_px = min(radius_px, int((1 - MINIMUM_OVERLAP) * max(level.width, level.height)))
    reach = radius_px + BORDER_PX
    reference, input = _patches(pair, level, BORDER_PX, reach, held_out, context)
    # What a mask leaves of the input is all that can lie under the reference.
    valid = 1.0 if pair.input.mask is None else input.valid_share
    surface = similarity_surface(
        describe(reference, level.width * level.height, settings),
        describe(input, level.width * level.height, settings),
        radius_px,
        settings,
        context.quiet(),
        MINIMUM_OVERLAP * valid,
    )
    found: list[Candidate] = []
    for _ in range(CANDIDATES):
        peak = find_peak(surface)
        if peak.height <= (found[0].height * _LOW if found else 0.0):
            break
        x, y = peak.shift_px
        dx, dy = level.pixel_to_map([[x, y]])[0] - level.pixel_to_map([[0, 0]])[0]
        found.append(Candidate(shift_model(float(dx), float(dy)), peak.height))
        row, col = round(y) + radius_px, round(x) + radius_px
        suppress(surface, (row, col), _SAME_PLACE)
    return found


def _patches(
    pair: ImagePair, level: Grid, border: int, reach: int, held_out: MaskOf, context: Context
) -> tuple[Patch, Patch]:
    """Return the reference with a border around the level, and the input with a wider one."""
    template, search = (
        level.window(-more, -more, level.width + 2 * more, level.height + 2 * more)
        for more in (border, reach)
    )
    reading = context.executor.submit(pair.reference_patch, template, held_out(template))
    input = pair.input_patch(search, pair.nominal_px)
    reference = reading.result()
    for image, patch in ((pair.reference, reference), (pair.input, input)):
        _require_content(image.source.path, patch)
    return reference, input


def _on_map(transform: Transform, level: Grid) -> Model:
    """Return a transform of degree 1 as a model from map positions to nominal ones."""
    xy = level.pixel_to_map(level.outline(4))
    return fit_model("affine", xy, transform.nominal_xy(transform(xy)))


def _require_content(path: str, patch: Patch) -> None:
    if not patch.valid.any():
        raise RasterContentError(f"{path} has no valid pixel where the images overlap")
    if patch.is_flat:
        raise RasterContentError(f"{path} is constant where the images overlap")
