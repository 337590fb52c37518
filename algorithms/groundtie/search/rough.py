"""The rough shift: candidates from one exhaustive search over a reduced image."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

from ..errors import RasterContentError
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.evidence import find_peak
from ..similarity.surface import BORDER_PX, SimilaritySettings, describe, similarity_surface
from .matching import MaskOf

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
class Candidate:
    """A shift of the map at which the images may match: map units, and the peak's height."""

    dx: float
    dy: float
    height: float


def level_factor(grid: Grid) -> float:
    """Return how much coarser than the matching grid the level of the rough search is."""
    return max(max(grid.width, grid.height) / LEVEL_SIDE_PX, 1.0)


def rough_candidates(
    pair: ImagePair,
    level: Grid,
    radius_px: int,
    settings: SimilaritySettings,
    held_out: MaskOf,
    executor: Executor,
) -> list[Candidate]:
    """Return the best shifts, best first, within a radius.

    Parameters
    ----------
    pair
        The images.
    level
        The matching grid at reduced resolution.
    radius_px
        Largest shift, in pixels of the level.
    settings
        How similarity is measured.
    held_out
        Returns for a piece of the grid which pixels of the reference must not be seen.
    executor
        Threads to count histograms in.

    Raises
    ------
    RasterContentError
        One of the images is constant or has no valid pixel where they overlap.
    """
    template = level.window(
        -BORDER_PX, -BORDER_PX, level.width + 2 * BORDER_PX, level.height + 2 * BORDER_PX
    )
    reach = radius_px + BORDER_PX
    search = level.window(-reach, -reach, level.width + 2 * reach, level.height + 2 * reach)
    reference = pair.reference_patch(template, held_out(template))
    input = pair.input_patch(search, pair.claimed_px)
    for image, patch in ((pair.reference, reference), (pair.input, input)):
        _require_content(image.source.path, patch)
    if settings.bins is None:
        settings = replace(settings, bins=_BINS)
    surface = similarity_surface(
        describe(reference, level.width * level.height, settings),
        describe(input, level.width * level.height, settings),
        radius_px,
        settings,
        executor,
    )
    found: list[Candidate] = []
    for _ in range(CANDIDATES):
        peak = find_peak(surface)
        if peak.height <= (found[0].height * _LOW if found else 0.0):
            break
        x, y = peak.shift_px
        dx, dy = level.pixel_to_map([[x, y]])[0] - level.pixel_to_map([[0, 0]])[0]
        found.append(Candidate(float(dx), float(dy), peak.height))
        row, col = round(y) + radius_px, round(x) + radius_px
        surface[
            max(row - _SAME_PX, 0) : row + _SAME_PX + 1, max(col - _SAME_PX, 0) : col + _SAME_PX + 1
        ] = 0.0
    return found


def _require_content(path: str, patch: Patch) -> None:
    if not patch.valid.any():
        raise RasterContentError(f"{path} has no valid pixel where the images overlap")
    if patch.is_flat:
        raise RasterContentError(f"{path} is constant where the images overlap")
