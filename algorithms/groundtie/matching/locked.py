"""Pixel-locked content: structure that is the same in both arrays, wherever the ground lies.

Labels, frames, watermarks, clouds of one deck, tiles of one mosaic and the pattern of one sensor
are drawn at a column and row, not at a place. Two images that share them match at that offset of
columns and rows, whatever ground they show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.models import Model, shift_model
from ..geometry.transform import Transform
from ..rasters.grid import Grid, reproject
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..rasters.reading import Mask
from ..similarity.sameness import (
    REACH_PX,
    WINDOW_PX,
    Edges,
    Gradients,
    count_same,
    covered,
    edges_apart_px,
    reduced,
    related_windows,
    same_windows,
    without,
)
from .matcher import FloatArray, Places

# A transform that moves all of the overlap by whole pixels, but for this, may be content's.
_LARGEST_BEND_PX = 1.5

# Copies of pixels are found within this of whole pixels; a quarter of what others lie within.
_WHOLE_PX = 0.125

# What is drawn lies on whole pixels all over; different sensors' views, by chance or on one grid,
# no nearer than they can be matched. Measured (suite attacks): drawn up to 0.03; views that have no
# more in common, from 0.05 on but for one, in whose rest the ground is found.
_EXACT_PX = 0.04

# Gradients above this percentile of their image are strong.
_STRONG_PERCENT = 70.0

# Offsets at which gradients are the same by chance: so many, on a spiral around the found one.
_CHANCE_OFFSETS = 8
_FIRST_TURN_PX, _GOLDEN_ANGLE = 7.0, np.pi * (3 - np.sqrt(5))

# So many times as many as by chance, and of gradients this share of the strong ones, are more than
# two sensors show of one ground; what else they show is asked then. Gradients were measured on the
# shared pairs at their true places: 0.7 to 2.9 % of different sensors and physics, up to 3.4 times
# as many as by chance; 3.5 to 28 % of one sensor's. With content drawn into both: 3 to 43 %.
_LEAST_RATIO, _LEAST_SHARE = 2.0, 0.03

# What is drawn has its edges at one fraction of a pixel, in whatever colours: beyond chance, within
# the first of the other's are so many times as many as from there to the second. Edges of one
# ground are blurred by noise, light and physics. Suite sharpness: of different sensors and dates up
# to 2.1, of different bands on one grid up to 2.45 (years apart) and 4.2 (one exposure).
_SHARP_PX, _BLURRED_PX = 0.25, 0.5
LEAST_SHARPNESS, DRAWN_SHARPNESS = 2.5, 5.0

# The same of the area that varies alike: where holes or waters of one shape are cut into noise,
# few gradients are the same. Different sensors' views: up to 17 %.
_LEAST_AREA = 0.2

# One sensor's views of one ground vary alike where nothing is drawn, too, on images that are so
# much smaller. Measured as above: 25 % of what is left and more; of different ground 0 to 21 %, of
# ground that was displaced up to 43 %, which is left to the rules on a second place. Less than a
# tenth of the area shows nothing.
_REDUCTION = 4
_GROUND_SHARE = 0.23
_LEAST_LEFT = 0.1

# Shares differ, but by chance with 5 %, if they are so many standard errors apart.
_STANDARD_ERRORS = 1.645

# Nothing is left to be judged of copies: this share is the same, in the images and reduced ones.
_COPY_SHARE = 0.75

_LATTICE = 9

# Around an edge, chips see it this far off.
_EDGE_SURROUNDINGS_PX = 9


@dataclass(frozen=True)
class Sameness:
    """How much two arrays have the same at an offset of whole columns and rows.

    Parameters
    ----------
    gradients, chance
        Share of the strong gradients that are the same there, and at other offsets.
    sharpness
        How many times as many edges coincide there within a quarter of a pixel as between a
        quarter and a half, each beyond those at other offsets; at least, as far as the latter are
        known, but by chance with 5 %.
    area, reduced_area
        Share of the area that varies alike, in the images and in reduced ones.
    ground
        The latter, of what does not vary alike in the images.
    windows
        How many windows of the reduced images do not overlap.
    related, reduced_related
        Share of the area where one is half a linear function of the other, in the images and in
        reduced ones.
    """

    gradients: float
    chance: float
    sharpness: float
    area: float
    reduced_area: float
    ground: float
    windows: float
    related: float = 0.0
    reduced_related: float = 0.0

    @property
    def is_evident(self) -> bool:
        """Whether more is the same than two views show of one ground."""
        is_more = self.gradients >= max(_LEAST_RATIO * self.chance, _LEAST_SHARE)
        return is_more or self.has_sharp_edges or self.area >= _LEAST_AREA

    @property
    def has_sharp_edges(self) -> bool:
        """Whether edges coincide more sharply than those of one ground."""
        return self.sharpness >= LEAST_SHARPNESS

    @property
    def is_finer_than_ground(self) -> bool:
        """Whether less is the same on reduced images, but by chance with 5 %.

        Ground is no less alike there, where noise has averaged out; noise that both have is.
        """
        error = np.sqrt(self.area * (1 - self.area) / max(self.windows, 1.0))
        return bool(self.reduced_area < self.area - _STANDARD_ERRORS * error)

    @property
    def is_copy_in_other_colours(self) -> bool:
        """Whether one image follows from the other nearly everywhere, as from its negative."""
        return min(self.related, self.reduced_related) >= _COPY_SHARE

    @property
    def is_explained(self) -> bool:
        """Whether one image is a copy of the other, or both are one sensor's views of one ground.

        What is left of them need not confirm the transform, as copies leave nothing, and what one
        sensor shows alike is most of what it shows.
        """
        if self.is_finer_than_ground:
            return False
        is_copy = min(self.area, self.reduced_area) >= _COPY_SHARE
        return is_copy or self.ground >= _GROUND_SHARE


@dataclass(frozen=True)
class LockedContent:
    """Which pixels of the reference the input repeats at an offset of whole columns and rows.

    Called with a part of the matching grid, it returns their surroundings, as `HeldOut` does.

    Parameters
    ----------
    pair
        The images, with pixels of one size.
    offset_px
        Input (col, row) − reference (col, row).
    sameness
        How much they have the same.
    is_whole
        Whether the transform moves the array by whole pixels: what was resampled is no copy of
        pixels.
    of_one_kind
        Whether the images may be one sensor's: not a radar's and a camera's.
    is_exact
        Whether the transform moves the array by whole pixels all over, and does nothing else.
    """

    pair: ImagePair
    offset_px: tuple[int, int]
    sameness: Sameness
    is_whole: bool
    of_one_kind: bool = True
    is_exact: bool = False

    @property
    def is_evident(self) -> bool:
        """Whether more is the same than two views show of one ground, or lies too exactly so."""
        return self.sameness.is_evident or self.is_exact

    @property
    def is_explained(self) -> bool:
        """Whether the images are copies, or one sensor's views of one ground."""
        return self.of_one_kind and self.sameness.is_explained

    @property
    def is_drawn(self) -> bool:
        """Whether it is sharper than ground in other colours."""
        same = self.sameness
        is_sharper = same.sharpness >= DRAWN_SHARPNESS
        return is_sharper and not (self.is_explained or same.is_copy_in_other_colours)

    def __call__(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a part of the matching grid lie where both are the same, (h, w).

        What is drawn ends somewhere in the windows that vary alike: all of them is taken, unless
        the surroundings are one sensor's views of the ground, and what is around edges if they
        or the transform are evidence.
        """
        reach = 2 * REACH_PX
        size = piece.width + 2 * reach, piece.height + 2 * reach
        around = piece.window(-reach, -reach, *size)
        patches = _patches(self.pair, around, self.offset_px)
        same = same_windows(*patches)
        if not self.is_explained:
            same = covered(same, WINDOW_PX)
            if self.sameness.has_sharp_edges or self.is_exact:
                same |= covered(_drawn(*patches), _EDGE_SURROUNDINGS_PX)
        return same[reach:-reach, reach:-reach]

    @property
    def model(self) -> Model:
        """The misregistration on the map that moves the input's array by the offset."""
        pair = self.pair
        middle = np.array([pair.grid.centre_px])
        xy = pair.grid.pixel_to_map(middle)
        own = pair.input.source.grid
        at = own.pixel_to_map(pair.reference.source.grid.map_to_pixel(xy) + self.offset_px)
        shift = (reproject(at, own.crs, pair.grid.crs) - xy)[0]
        return shift_model(float(shift[0]), float(shift[1]))


def find_locked_content(
    pair: ImagePair,
    transform: Transform,
    places: Places,
    context: Context,
    of_one_kind: bool = True,
) -> LockedContent | None:
    """Return what the images repeat where a transform puts the input's array.

    Parameters
    ----------
    pair
        The images.
    transform
        What was found.
    places
        Where it is looked for.
    context
        Threads.
    of_one_kind
        See `LockedContent`.

    Returns
    -------
    None where the transform does more than move the array, which nothing drawn into both does.
    """
    moved = _moved_px(pair, transform)
    if moved is None:
        return None
    offset = np.rint(np.median(moved, axis=0))
    # Not a number, where the transform has none, is no small bend either.
    if not np.abs(moved - offset).max() <= _LARGEST_BEND_PX:
        return None
    found = int(offset[0]), int(offset[1])

    def look(centre: NDArray[np.int_]) -> _Look:
        side = places.chip_px + 2 * _REACH_PX
        corner = centre - side // 2
        piece = places.grid.window(int(corner[0]), int(corner[1]), side, side)
        return _Look.of(*_patches(pair, piece, found))

    sameness = _sameness(list(context.map(look, list(places.centres))))
    is_whole = bool(np.abs(np.median(moved, axis=0) - offset).max() <= _WHOLE_PX)
    is_exact = bool(np.abs(moved - offset).max() <= _EXACT_PX)
    return LockedContent(pair, found, sameness, is_whole, of_one_kind, is_exact)


def _sameness(looks: list[_Look]) -> Sameness:
    own, others = ([look.gradients[k] for look in looks] for k in (0, 1))
    strong = _strong(own), _strong(others)
    same = [_share([one.same(shift, strong) for one in looks]) for shift in _offsets()]
    area, reduced_area, related, reduced_related = (
        _share([one.counts[k] for one in looks]) for k in (0, 1, 3, 4)
    )
    every = sum(one.counts[1][1] for one in looks)
    ground = _share([one.counts[2] for one in looks], int(_LEAST_LEFT * every))
    chance = float(np.median(same[1:]))
    sharpness = _sharpness(np.sum([one.edges for one in looks], axis=0)) if looks else 0.0
    windows = every / WINDOW_PX**2
    shares = area, reduced_area, ground, windows, related, reduced_related
    return Sameness(same[0], chance, sharpness, *shares)


def _sharpness(counts: FloatArray) -> float:
    """Return `Sameness.sharpness` of counts of edges, (sharp, less so) at each of `_offsets`."""
    chance = counts[1:].mean(axis=0)
    sharp, blurred = counts[0] - chance
    # Of counts, which vary as much as they are many.
    error = np.sqrt(counts[0, 1] + chance[1] / _CHANCE_OFFSETS + 1)
    return float(sharp / (max(blurred, 0.0) + _STANDARD_ERRORS * error))


_Count = tuple[int, int]


@dataclass(frozen=True)
class _Look:
    """What one window shows: gradients, edges, and (same, all) pixels as `LockedContent` has them.

    Of the input also what is around it. Edges are counted at each of `_offsets`, shape (k, 2).
    """

    gradients: tuple[Gradients, Gradients]
    edges: NDArray[np.int_]
    counts: tuple[_Count, ...]

    @classmethod
    def of(cls, reference: Patch, input: Patch) -> _Look:
        same = same_windows(reference, input)
        rest = without(reference, same), without(input, same)
        counts = (
            (int(same.sum()), int((reference.valid & input.valid).sum())),
            _count_reduced(reference, input),
            _count_reduced(*rest),
            _count_related(reference, input),
            _count_related(reduced(reference, _REDUCTION), reduced(input, _REDUCTION)),
        )
        inner = reference.inner(_REACH_PX)
        gradients = Gradients.of(inner), Gradients.of(input)
        return cls(gradients, _count_edges(reference, input), counts)

    def same(self, shift: NDArray[np.int_], strong: tuple[float, float]) -> _Count:
        """Return how many strong gradients are the same at a shift of the input, and all."""
        reference, input = self.gradients
        col, row = (int(_REACH_PX + by) for by in shift)
        return count_same(reference, input.part(col, row, reference.x.shape), strong)


def _count_edges(reference: Patch, input: Patch) -> NDArray[np.int_]:
    """Return how many strong edges coincide sharply, and less so, at each of `_offsets`, (k, 2)."""
    one, other = (Edges.of(patch).strongest for patch in (reference, input))
    apart = edges_apart_px(one.inner(_REACH_PX), other, _offsets())
    sharp = (apart < _SHARP_PX).sum(axis=1)
    return np.column_stack([sharp, (apart < _BLURRED_PX).sum(axis=1) - sharp])


def _drawn(reference: Patch, input: Patch) -> Mask:
    """Return where edges coincide of which one at least is strong, shape (h, w)."""
    one, other = Edges.of(reference), Edges.of(input)
    drawn = np.zeros_like(one.found)
    for edges, others in ((one, other.strongest), (one.strongest, other)):
        drawn[edges.found] |= edges_apart_px(edges, others)[0] <= _BLURRED_PX
    return drawn


def _count_reduced(reference: Patch, input: Patch) -> _Count:
    smaller = reduced(reference, _REDUCTION), reduced(input, _REDUCTION)
    return int(same_windows(*smaller).sum()), int((smaller[0].valid & smaller[1].valid).sum())


def _count_related(reference: Patch, input: Patch) -> _Count:
    related = related_windows(reference, input)
    return int(related.sum()), int((reference.valid & input.valid).sum())


def _share(counts: list[_Count], least: int = 1) -> float:
    """Return the share of what is the same, of at least so many."""
    same, every = np.sum(counts, axis=0) if counts else (0, 0)
    return float(same / max(every, least, 1))


def _strong(gradients: list[Gradients]) -> float:
    """Return the length from which gradients of an image are strong."""
    lengths = [one.length[one.valid] for one in gradients if one.valid.any()]
    return float(np.percentile(np.concatenate(lengths), _STRONG_PERCENT)) if lengths else 0.0


def _offsets() -> NDArray[np.int_]:
    """Return none, and offsets (x, y) on a spiral around it, shape (n, 2)."""
    steps = np.arange(_CHANCE_OFFSETS)
    angle, length = steps * _GOLDEN_ANGLE, _FIRST_TURN_PX + 2 * steps
    spiral = np.rint(np.column_stack([length * np.cos(angle), length * np.sin(angle)]))
    return np.vstack([[0, 0], spiral]).astype(int)


_REACH_PX = int(np.abs(_offsets()).max())


def _patches(pair: ImagePair, piece: Grid, offset_px: tuple[int, int]) -> tuple[Patch, Patch]:
    """Return both images' own pixels on a part of the grid, the input's moved by an offset."""
    to_reference = pair.reference.source.grid.map_to_pixel

    def to_input(xy: FloatArray) -> FloatArray:
        return to_reference(xy) + offset_px

    return pair.reference_patch(piece), pair.input_patch(piece, to_input)


def _moved_px(pair: ImagePair, transform: Transform) -> FloatArray | None:
    """Return by how many columns and rows a transform moves the input, on a lattice, (n, 2).

    None where pixels differ in size.
    """
    grid, reference = pair.grid, pair.reference.source.grid
    if not np.isclose(grid.pixel_size_m, reference.pixel_size_m, rtol=1e-6):
        return None
    cols, rows = np.meshgrid(
        np.linspace(0, grid.width - 1, _LATTICE), np.linspace(0, grid.height - 1, _LATTICE)
    )
    xy = grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    return np.asarray(transform(xy) - reference.map_to_pixel(xy))
