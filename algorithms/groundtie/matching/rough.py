"""The rough shift or pose: candidates from one search over a reduced image."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from affine import Affine

from ..context import Context
from ..errors import RasterContentError
from ..geometry.fitting import fit_model
from ..geometry.models import Frame, Model, PolynomialModel
from ..geometry.transform import Transform
from ..pose.pose import PoseFound
from ..pose.rotation_windows import read_windows
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.correlation import MINIMUM_OVERLAP
from ..similarity.peak import find_peak
from ..similarity.surface import BORDER_PX, SimilaritySettings, describe, similarity_surface
from .chips import MaskOf

# The longer side of the reduced image, in pixels, and how many candidates are kept.
LEVEL_SIDE_PX = 512
CANDIDATES = 4

# Candidates lower than this share of the best are not worth their cost.
_LOW = 0.4

# Candidates nearer than this are the same, in pixels of the level.
_SAME_PX = 4

# Few bins keep the count over a large search window quick, and are enough for whole scenes.
_BINS = 8


@dataclass(frozen=True)
class RoughSearch:
    """How far the input may lie from where it claims to be, and how it is searched for.

    Parameters
    ----------
    radius_m
        Largest shift, in metres.
    rotation_deg
        Largest rotation, either way.
    scale
        Smallest and largest scale of the input against what it claims.
    poses
        What searches for rotation, scale and shift; None: shifts alone, each of them.
    """

    radius_m: float
    rotation_deg: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    poses: Callable[..., list[PoseFound]] | None = None


@dataclass(frozen=True)
class Candidate:
    """A model of degree 1 on the map by which the images may match, and its peak's height."""

    model: Model
    height: float


def shift_model(dx: float, dy: float) -> Model:
    """Return a translation in map units as a model."""
    return PolynomialModel("translation", Frame(Affine.identity()), np.array([[dx, dy]]))


def level_factor(grid: Grid) -> float:
    """Return how much coarser than the matching grid the level of the rough search is."""
    return max(max(grid.width, grid.height) / LEVEL_SIDE_PX, 1.0)


def rough_candidates(
    pair: ImagePair,
    level: Grid,
    rough: RoughSearch,
    settings: SimilaritySettings,
    held_out: MaskOf,
    executor: Executor,
) -> list[Candidate]:
    """Return the best shifts or poses, best first, within the limits of a search.

    Parameters
    ----------
    pair
        The images.
    level
        The matching grid at reduced resolution.
    rough
        What is searched for, and how.
    settings
        How similarity is measured.
    held_out
        Returns for a piece of the grid which pixels of the reference must not be seen.
    executor
        Threads to work in.

    Raises
    ------
    RasterContentError
        One of the images is constant or has no valid pixel where they overlap.
    """
    # The true place may lie a pixel of the level further than the whole pixels say.
    radius_px = int(np.ceil(rough.radius_m / level.pixel_size_m)) + 1
    # Farther off too little of the images overlaps.
    radius_px = min(radius_px, int((1 - MINIMUM_OVERLAP) * max(level.width, level.height)))
    if settings.bins is None:
        settings = replace(settings, bins=_BINS)
    if rough.poses is None:
        return _shifts(pair, level, radius_px, settings, held_out, executor)
    windows = read_windows(pair.reference, pair.input, rough.scale, rough.radius_m, held_out)
    limits = windows.limits(rough.rotation_deg, rough.scale)
    both = windows.reference, windows.input
    found = rough.poses(*both, limits, settings, Context(executor))[:CANDIDATES]
    high = [one for one in found if one.height > found[0].height * _LOW]
    return [Candidate(_on_map(windows.transform(one.pose), level), one.height) for one in high]


def _shifts(
    pair: ImagePair,
    level: Grid,
    radius_px: int,
    settings: SimilaritySettings,
    held_out: MaskOf,
    executor: Executor,
) -> list[Candidate]:
    """Search all shifts, and return the highest peaks of their similarity."""
    reach = radius_px + BORDER_PX
    reference, input = _patches(pair, level, BORDER_PX, reach, held_out, executor)
    # What a mask leaves of the input is all that can lie under the reference.
    shown = 1.0 if pair.input.mask is None else input.valid_share
    surface = similarity_surface(
        describe(reference, level.width * level.height, settings),
        describe(input, level.width * level.height, settings),
        radius_px,
        settings,
        executor,
        MINIMUM_OVERLAP * shown,
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
        surface[
            max(row - _SAME_PX, 0) : row + _SAME_PX + 1, max(col - _SAME_PX, 0) : col + _SAME_PX + 1
        ] = 0.0
    return found


def _patches(
    pair: ImagePair, level: Grid, border: int, reach: int, held_out: MaskOf, executor: Executor
) -> tuple[Patch, Patch]:
    """Return the reference with a border around the level, and the input with a wider one."""
    template, search = (
        level.window(-more, -more, level.width + 2 * more, level.height + 2 * more)
        for more in (border, reach)
    )
    reading = executor.submit(pair.reference_patch, template, held_out(template))
    input = pair.input_patch(search, pair.claimed_px)
    reference = reading.result()
    for image, patch in ((pair.reference, reference), (pair.input, input)):
        _require_content(image.source.path, patch)
    return reference, input


def _on_map(transform: Transform, level: Grid) -> Model:
    """Return a transform of degree 1 as a model from map positions to claimed ones."""
    xy = level.pixel_to_map(level.outline(4))
    return fit_model("affine", xy, transform.claimed_xy(transform(xy)))


def _require_content(path: str, patch: Patch) -> None:
    if not patch.valid.any():
        raise RasterContentError(f"{path} has no valid pixel where the images overlap")
    if patch.is_flat:
        raise RasterContentError(f"{path} is constant where the images overlap")
