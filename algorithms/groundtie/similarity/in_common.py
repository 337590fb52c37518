"""How much two arrays have the same, pixel by pixel, by counts over all windows, and what it shows.

What is counted in a window is in `sameness`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch, reduced_patch
from ..rasters.reading import Mask
from .sameness import FARTHEST_PX, Edges, Windows, edges_apart_px
from .seams import DRAWN_WIDTH, ONE_SIDED_5_PERCENT, step_width

# None, and offsets (x, y) at which edges coincide by chance: so many, on a spiral.
_CHANCE_OFFSETS = 8
_FIRST_TURN_PX, _GOLDEN_ANGLE = 7.0, np.pi * (3 - np.sqrt(5))
_STEPS = np.arange(_CHANCE_OFFSETS)
_SPIRAL = (_FIRST_TURN_PX + 2 * _STEPS) * np.stack(
    [np.cos(_STEPS * _GOLDEN_ANGLE), np.sin(_STEPS * _GOLDEN_ANGLE)]
)
_OFFSETS = np.vstack([[0, 0], np.rint(_SPIRAL.T)]).astype(int)
LOOK_REACH_PX = int(np.abs(_OFFSETS).max())

# What is drawn has its edges at one fraction of a pixel, in whatever colours: beyond chance, within
# the first of the other's are so many times as many as from there to the second. Edges of one
# ground are blurred by noise, light and physics. Suite sharpness: of different sensors and dates up
# to 2.5 (one of 340 pairs, a simulated town, 4.6), of different bands on one grid up to 2.45 (years
# apart) and, of one exposure, 4.2 in 28 of 36 pairs (so that the second is the limit of one
# camera's views; the others from 6.8 on). Where right transforms have it (suite attacks, controls):
# up to 2.8; where ground is displaced beneath snow of one shape, from 2.93 on.
_SHARP_PX, _BLURRED_PX = 0.25, 0.5
LEAST_SHARPNESS, VIEW_SHARPNESS = 2.9, 5.0

# Edges of one ground lie on one another, and where a transform is wrong beside one another, to
# either side of their gradients, as these point to all sides. Those of one thing that is drawn
# twice, in other widths or as thinner cloud, lie to one side: so many more than to the other, in
# steps as wide, as lie on one another.
_BESIDE_PX = 1.0, 1.5, float(FARTHEST_PX)
MOST_BESIDE = 1.0

_NEAR_PX = np.array([0.0, _SHARP_PX, _BLURRED_PX, *_BESIDE_PX])

# More of the area than this varies alike where holes or waters of one shape are cut into noise, or
# clouds of one deck lie over both. Different sensors' views of one ground, and those of day and
# night: up to 25 %, measured on the shared pairs where right transforms have them (suite real).
LEAST_AREA = 0.3

# Less than this is what most right pairs of a radar's and a camera's image have the same (15 of 17
# in suite sharpness): without it they show hardly less, and need not be matched once more.
_LEAST_PART = 0.05

# One sensor's views of one ground vary alike where nothing is drawn, too, on images that are so
# much smaller, and no less on images reduced once more. Measured as above: 25 % of what is left and
# more; of different ground 0 to 21 %, of ground that was displaced up to 43 %, which is left to the
# rules on a second place. Less than a tenth of the area shows nothing. As much may follow in other
# colours: 24 % of a noisy negative (tests/test_steps.py), up to 1 % of what is drawn over two
# radars' images of different ground. The further step is an octave: by it, 1.04 times as much and
# more varies alike in right radar pairs, less in noise that is smooth along some pixels (suite
# attacks).
#
# Light and seasons differ over wide areas: two dates of one camera are alike in coarse pixels by
# 0.96 times as much as in finer ones, or more (suite sharpness); patterns of noise that are smooth
# along up to 2 pixels by 0.78 times as much, or less (tests/matching/test_locked.py). Smoother ones
# are as ground is, and pass (suite attacks, soft pattern noise).
_REDUCTION, _FURTHER = 4, 2
_GROUND_SHARE, _LEAST_COARSE_SHARE = 0.23, 0.9
_LEAST_LEFT = 0.1

# Where a transform has what is the same lie as nothing drawn does, less shows one ground. Of 12
# right transforms 10 have more, the one wrong one has 13 % (suite margins, --seeds 87000-87029
# --sample 120). Clouds, snow and waters that are put so into both images have as much as ground.
MOVED_GROUND_SHARE = 0.15

# Pixels of reduced images are means of at least this share of theirs.
_LEAST_VALID = 0.25

# Nothing is left to be judged of copies: this share is the same, in the images and reduced ones.
_COPY_SHARE = 0.75


@dataclass(frozen=True)
class Sameness:
    """How much two arrays have the same where one is laid on the other.

    Parameters
    ----------
    sharpness
        How many times as many edges coincide there within a quarter of a pixel as between a
        quarter and a half, each beyond those at other offsets; at least, as far as the latter are
        known, but by chance with 5 %.
    area, reduced_area, coarse_area
        Share of the area that varies alike, in the images, in reduced ones, and in those reduced
        once more.
    ground
        That in reduced ones, of what does not vary alike in the images.
    related
        Share of the area where one is half a linear function of the other, in the images or in
        reduced ones, whichever is smaller.
    step_width
        See `seams.step_width`.
    beside
        How many more edges lie a half to 1, 1 to 1.5, or 1.5 to 2 pixels to one side of the
        other's than to its other one, for each within a half; or a quarter to a half, for each
        within a quarter; whichever is most; at least, as above.
    """

    sharpness: float
    area: float
    reduced_area: float
    coarse_area: float
    ground: float
    related: float = 0.0
    step_width: float = np.inf
    beside: float = 0.0

    @property
    def is_evident(self) -> bool:
        """Whether more is the same than two sensors' views show of one ground."""
        return self.is_marked or self.area >= LEAST_AREA

    @property
    def is_marked(self) -> bool:
        """Whether edges or seams are not those of ground."""
        return self.has_sharp_edges or self.has_edges_beside or self.has_seams

    @property
    def covers_most(self) -> bool:
        """Whether so much varies alike that hardly anything is left."""
        return self.area >= _COPY_SHARE

    @property
    def covers_some(self) -> bool:
        """Whether more varies alike than most images of two sensors do by chance."""
        return self.area >= _LEAST_PART

    @property
    def has_sharp_edges(self) -> bool:
        """Whether edges coincide more sharply than those of one ground.

        Of copies, in whatever colours: than those of one exposure's bands.
        """
        is_copy = self.is_copy or self.is_copy_in_other_colours
        return self.sharpness >= (VIEW_SHARPNESS if is_copy else LEAST_SHARPNESS)

    @property
    def has_edges_beside(self) -> bool:
        """Whether edges lie beside one another rather than on one another, as of no ground."""
        return self.beside > MOST_BESIDE

    @property
    def has_seams(self) -> bool:
        """Whether steps between columns or rows coincide more sharply than those of ground."""
        return self.step_width <= DRAWN_WIDTH

    @property
    def is_finer_than_ground(self) -> bool:
        """Whether less is the same in coarser pixels.

        Ground is no less alike there, where noise has averaged out; noise that both have is.
        """
        return self.coarse_area < self.reduced_area

    @property
    def is_copy_in_other_colours(self) -> bool:
        """Whether one image follows from the other nearly everywhere, as from its negative."""
        return self.related >= _COPY_SHARE

    @property
    def is_copy(self) -> bool:
        """Whether one image is a copy of the other: nearly everything is the same."""
        return min(self.area, self.reduced_area, self.coarse_area) >= _COPY_SHARE

    @property
    def is_view(self) -> bool:
        """Whether both may be one camera's views of one ground.

        Edges coincide no more sharply than those of its bands, and little less is alike in coarser
        pixels, by light and season.
        """
        is_ground = self.coarse_area >= _LEAST_COARSE_SHARE * self.reduced_area
        return self.ground >= _GROUND_SHARE and is_ground and self.sharpness < VIEW_SHARPNESS

    @property
    def is_of_one_sensor(self) -> bool:
        """Whether coarse pixels vary alike over as much as finer ones do of nothing but one ground.

        Those of a despeckled radar's and a camera's image up to 29 % (suite sharpness), of two
        cameras' from 33 % on where a radar's town is looked for (suite one_grid).
        """
        return self.coarse_area >= LEAST_AREA and not self.is_finer_than_ground

    @property
    def leaves_ground(self) -> bool:
        """Whether what is not the same varies alike, too, if only a little."""
        return self.ground >= MOVED_GROUND_SHARE

    @property
    def varies_as_ground(self) -> bool:
        """Whether as much as of one ground varies alike, or follows in other colours."""
        return self.has_one_ground or self.related >= _GROUND_SHARE

    @property
    def has_one_ground(self) -> bool:
        """Whether what is not the same varies alike, too, as one sensor's views of one ground."""
        return self.ground >= _GROUND_SHARE and not self.is_finer_than_ground


_NO_WINDOWS = np.zeros((4, 3), int)
_NO_EDGES = np.zeros((len(_OFFSETS), 2, len(_NEAR_PX) - 1), int)


@dataclass(frozen=True)
class Look:
    """What one window shows.

    Parameters
    ----------
    edges
        How many lie between each two of `_NEAR_PX` of one another, at each of `_OFFSETS`, on the
        darker and the brighter side, shape (k, 2, 5).
    windows
        How many pixels are the same, related, and valid (see `Windows`): of the images, of reduced
        ones, of those reduced once more, and of reduced ones without what is the same in the
        images, shape (4, 3).
    """

    edges: NDArray[np.int_]
    windows: NDArray[np.int_]

    @classmethod
    def of(cls, reference: Patch, input: Patch) -> Look:
        """Return what two patches show."""
        whole = Windows.of(reference, input)
        both = reference, input
        without_same = [replace(patch, valid=patch.valid & ~whole.same) for patch in both]
        smaller, left = (
            [reduced_patch(patch, _REDUCTION, _LEAST_VALID) for patch in pair]
            for pair in (both, without_same)
        )
        coarse = [reduced_patch(patch, _FURTHER, _LEAST_VALID) for patch in smaller]
        pairs = smaller, coarse, left
        counts = np.array([whole.counts, *(Windows.of(*pair).counts for pair in pairs)])
        return cls(_count_edges(reference, input), counts)


def sameness_of(looks: Sequence[Look], steps: Sequence[NDArray[np.float64]]) -> Sameness:
    """Return how much arrays have the same in windows all over them.

    Parameters
    ----------
    looks
        What windows show.
    steps
        Their `step_products`, of the input where it is not resampled if it can be.
    """
    edges = np.sum([one.edges for one in looks], axis=0) if looks else _NO_EDGES
    sharp, blurred, *_ = edges.sum(axis=1).T
    _, to_half, *beside = edges[0].T
    windows = np.sum([one.windows for one in looks], axis=0) if looks else _NO_WINDOWS
    every = windows[:, 2]
    area, reduced_area, coarse_area, _ = windows[:, 0] / np.maximum(every, 1)
    # Of the images and of reduced ones.
    related = (windows[:, 1] / np.maximum(every, 1))[:2].min()
    return Sameness(
        float((sharp[0] - sharp[1:].mean()) / _most_of(blurred)),
        float(area),
        float(reduced_area),
        float(coarse_area),
        ground=float(windows[3, 0] / max(every[3], _LEAST_LEFT * every[1], 1.0)),
        related=float(related),
        step_width=step_width(np.sum(steps, axis=0)) if steps else np.inf,
        beside=max(
            _more_of(to_half) / _most_of(sharp),
            *(_more_of(some) / _most_of(sharp + blurred) for some in beside),
        ),
    )


def _most_of(some: NDArray[np.int_]) -> float:
    """Return how many edges coincide beyond chance, at most, by counts at each of `_OFFSETS`."""
    chance = some[1:].mean()
    # Of counts, which vary as much as they are many.
    error = np.sqrt(some[0] + chance / _CHANCE_OFFSETS + 1)
    return float(max(some[0] - chance, 0.0) + ONE_SIDED_5_PERCENT * error)


def _more_of(sides: NDArray[np.int_]) -> float:
    """Return how many more edges lie to one side than to the other, at least, by their counts."""
    return float(abs(sides[1] - sides[0]) - ONE_SIDED_5_PERCENT * np.sqrt(sides.sum()))


def _count_edges(reference: Patch, input: Patch) -> NDArray[np.int_]:
    """Return `Look.edges` of two patches: how many strong edges lie how near to one another."""
    one, other = (Edges.of(patch).strongest for patch in (reference, input))
    apart = edges_apart_px(one.inner(LOOK_REACH_PX), other, _OFFSETS)[:, None]
    sides = np.concatenate([-apart, apart], axis=1)[..., None]
    return ((sides >= _NEAR_PX[:-1]) & (sides < _NEAR_PX[1:])).sum(axis=2)


def drawn_edges(reference: Patch, input: Patch) -> Mask:
    """Return where edges coincide of which one at least is strong, shape (h, w)."""
    one, other = Edges.of(reference), Edges.of(input)
    drawn = np.zeros_like(one.found)
    for edges, others in ((one, other.strongest), (one.strongest, other)):
        drawn[edges.found] |= np.abs(edges_apart_px(edges, others)[0]) <= _BLURRED_PX
    return drawn
