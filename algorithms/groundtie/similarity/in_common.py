"""The pixel content that two arrays share, counted over all windows, and the rules that judge it.

`sameness` does the counting in one window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch, reduced_patch
from ..rasters.reading import Mask
from .coherence import coherence, spectral_products
from .sameness import FARTHEST_PX, Edges, Windows, edges_apart_px
from .seams import DRAWN_WIDTH, ONE_SIDED_5_PERCENT, step_width

# Offset zero, and offsets (x, y) on a spiral at which edges coincide only by chance.
_CHANCE_OFFSETS = 8
_FIRST_TURN_PX, _GOLDEN_ANGLE = 7.0, np.pi * (3 - np.sqrt(5))
_STEPS = np.arange(_CHANCE_OFFSETS)
_SPIRAL = (_FIRST_TURN_PX + 2 * _STEPS) * np.stack(
    [np.cos(_STEPS * _GOLDEN_ANGLE), np.sin(_STEPS * _GOLDEN_ANGLE)]
)
_OFFSETS = np.vstack([[0, 0], np.rint(_SPIRAL.T)]).astype(int)
LOOK_REACH_PX = int(np.abs(_OFFSETS).max())

# Edges of drawn content coincide at the same fraction of a pixel, in whatever colours; edges of the
# ground are blurred by noise, light and physics. Sharpness is the number of edges within _SHARP_PX
# of an edge of the other array over the number from there to _BLURRED_PX, both beyond chance.
# Suite sharpness: up to 2.5 between different sensors and dates (4.6 in one of 340 pairs, a
# simulated town); up to 2.45 between different bands on one grid, years apart; up to 4.2 between
# bands of one exposure in 28 of 36 pairs, from 6.8 on in the others. VIEW_SHARPNESS is therefore
# the limit for views of one camera. Suite attacks: up to 2.8 in controls with right transforms;
# from 2.93 on where ground is displaced beneath snow of one shape.
_SHARP_PX, _BLURRED_PX = 0.25, 0.5
LEAST_SHARPNESS, VIEW_SHARPNESS = 2.9, 5.0

# Edges of one ground coincide. If the transform is wrong, they lie on either side of one another,
# because gradients point in all directions. If one object is drawn twice, with another width or
# as thinner cloud, its edges lie on one side. The limit applies to the excess of one side over the
# other in an interval, relative to the coinciding edges in an interval of the same width.
_BESIDE_PX = 1.0, 1.5, float(FARTHEST_PX)
MOST_BESIDE = 1.0

_NEAR_PX = np.array([0.0, _SHARP_PX, _BLURRED_PX, *_BESIDE_PX])

# A larger share of the area than this varies alike if holes or waters of one shape are cut into
# noise, or one cloud deck covers both images. Views of one ground by different sensors, or by day
# and night, reach up to 25 % (suite real, the shared pairs with their right transforms).
LEAST_AREA = 0.3

# Most right pairs of a radar and a camera image share less than this (15 of 17 in suite sharpness).
# Masking so little changes hardly anything, so such pairs need not be matched again.
_LEAST_PART = 0.05

# Views of one ground by one sensor also vary alike outside drawn content, in images reduced by
# _REDUCTION and no less in images reduced once more by _FURTHER. Measured as above, on the
# remaining area: 25 % and more; 0 to 21 % on different ground; up to 43 % on displaced ground,
# which is left to the rules on a second place. Less than a tenth of the area is no evidence.
# The same share may be related in other colours: 24 % of a noisy negative (tests/test_steps.py),
# up to 1 % of content drawn over two radar images of different ground. The further reduction is one
# octave. After it, the share is at least 1.04 times as large in right radar pairs, and smaller in
# noise that is smooth along some pixels (suite attacks).
#
# Light and seasons differ over wide areas. Two dates of one camera share at least 0.96 times as
# much in coarse pixels as in finer ones (suite sharpness); noise patterns that are smooth along up
# to 2 pixels share at most 0.78 times as much (tests/matching/test_locked.py). Smoother patterns
# cannot be told from ground, and pass (suite attacks, soft pattern noise).
_REDUCTION, _FURTHER = 4, 2
_GROUND_SHARE, _LEAST_COARSE_SHARE = 0.23, 0.9
_LEAST_LEFT = 0.1

# A smaller share is evidence of one ground if the transform moves the common content as no drawn
# content is moved. 10 of 12 right transforms exceed this limit; the one wrong transform has 13 %
# (suite margins, --seeds 87000-87029 --sample 120). Clouds, snow and waters that are inserted into
# both images with such a transform reach as much as ground. So do soft lines on screenshots that
# are placed by hand, over two places: without them, chips are as dissimilar as those of two dates
# of which half the land changed (suite attacks, controls "two dates of one camera").
MOVED_GROUND_SHARE = 0.15

# Clouds are brighter than the ground. Suite margins (`--classes "soft clouds" "cloud deck" controls
# --seeds 330000-330009 --sample 60`): correct transforms of which hardly anything else matches have
# up to 0.28, wrong ones 1.66. Real views of one camera have up to 0.48.
LEAST_BRIGHTER = 0.8

# Least valid share of the pixels that a pixel of a reduced image averages.
_LEAST_VALID = 0.25

# Fine structure of two radar images that share a pattern of noise is at least this coherent, and
# more so than coarse structure. In 4 of 100 pairs of one ground it is the more coherent one, by up
# to 0.07 (suite sharpness). Noise that is smooth along up to 1.3 px is above the limit over other
# ground (tests/similarity/test_coherence.py); what is smoother passes.
FINE_COHERENCE = 0.15

# Copies share this much, in the images and in reduced ones, so that too little is left to judge.
_COPY_SHARE = 0.75


@dataclass(frozen=True)
class Sameness:
    """How much pixel content two superimposed arrays share.

    Parameters
    ----------
    sharpness
        Number of edges that coincide within a quarter of a pixel over the number between a quarter
        and a half, each less its mean at other offsets. A lower limit: the divisor is its upper
        limit, exceeded by chance with 5 %.
    area, reduced_area, coarse_area
        Share of the area that varies alike, in the images, in reduced ones, and in those reduced
        once more.
    ground
        Share that varies alike in reduced images, of the area that does not in the images.
    related
        Share of the area where a linear function of one array explains half of the other, in the
        images or in reduced ones, whichever is smaller.
    step_width
        See `seams.step_width`.
    beside
        Excess of edges on one side of the other array's edges over those on its other side: a half
        to 1, 1 to 1.5, or 1.5 to 2 pixels away, relative to the edges within a half; or a quarter
        to a half away, relative to those within a quarter; the largest of these. A lower limit, as
        above.
    brighter
        By how many standard deviations pixels that vary alike are brighter than the others, mean of
        both images.
    coarse_coherence, fine_coherence
        See `coherence`.
    """

    sharpness: float
    area: float
    reduced_area: float
    coarse_area: float
    ground: float
    related: float = 0.0
    step_width: float = np.inf
    beside: float = 0.0
    brighter: float = 0.0
    coarse_coherence: float = 0.0
    fine_coherence: float = 0.0

    @property
    def is_evident(self) -> bool:
        """Whether the arrays share more than two sensors' views of one ground do."""
        return self.is_marked or self.area >= LEAST_AREA

    @property
    def is_marked(self) -> bool:
        """Whether the common edges or seams are not those of ground."""
        return self.has_sharp_edges or self.has_edges_beside or self.has_seams

    @property
    def covers_most(self) -> bool:
        """Whether so much varies alike that hardly any other area is left."""
        return self.area >= _COPY_SHARE

    @property
    def covers_some(self) -> bool:
        """Whether more varies alike than most images of two sensors do by chance."""
        return self.area >= _LEAST_PART

    @property
    def has_sharp_edges(self) -> bool:
        """Whether edges coincide more sharply than those of one ground.

        For copies, in whatever colours, the limit is that of bands of one exposure.
        """
        is_copy = self.is_copy or self.is_copy_in_other_colours
        return self.sharpness >= (VIEW_SHARPNESS if is_copy else LEAST_SHARPNESS)

    @property
    def has_edges_beside(self) -> bool:
        """Whether more edges lie beside one another than coincide, as on no ground."""
        return self.beside > MOST_BESIDE

    @property
    def has_seams(self) -> bool:
        """Whether steps between columns or rows coincide more sharply than those of ground."""
        return self.step_width <= DRAWN_WIDTH

    @property
    def may_be_clouds(self) -> bool:
        """Whether what varies alike is brighter than the remaining area, as clouds are."""
        return self.brighter >= LEAST_BRIGHTER

    @property
    def is_finer_than_ground(self) -> bool:
        """Whether the arrays share less in coarser pixels.

        Averaging removes noise: it leaves ground no less alike, but common noise less.
        """
        return self.coarse_area < self.reduced_area

    @property
    def is_noise(self) -> bool:
        """Whether two radar images share a pattern of noise, which is finer than ground."""
        return self.fine_coherence >= max(FINE_COHERENCE, self.coarse_coherence)

    @property
    def is_copy_in_other_colours(self) -> bool:
        """Whether one image is a function of the other nearly everywhere, such as its negative."""
        return self.related >= _COPY_SHARE

    @property
    def is_copy(self) -> bool:
        """Whether one image is a copy of the other nearly everywhere."""
        return min(self.area, self.reduced_area, self.coarse_area) >= _COPY_SHARE

    @property
    def is_view(self) -> bool:
        """Whether both may be one camera's views of one ground.

        Their edges coincide no more sharply than those of its bands, and they are alike not in
        bright areas alone. Light and season may leave them a little less alike in coarser pixels.
        """
        is_ground = self.coarse_area >= _LEAST_COARSE_SHARE * self.reduced_area
        is_drawn = self.may_be_clouds or self.sharpness >= VIEW_SHARPNESS
        return self.ground >= _GROUND_SHARE and is_ground and not is_drawn

    @property
    def is_of_one_sensor(self) -> bool:
        """Whether coarse pixels vary alike over more area than those of different sensors.

        Up to 29 % for a despeckled radar image and a camera image (suite sharpness); from 33 % on
        for two camera images in which a radar's town is searched for (suite one_grid).
        """
        return self.coarse_area >= LEAST_AREA and not self.is_finer_than_ground

    @property
    def leaves_ground(self) -> bool:
        """Whether a little of the remaining area varies alike, too, in reduced images.

        Clouds become thin towards their edges, so that a little of them remains.
        """
        return self.ground >= MOVED_GROUND_SHARE and not self.may_be_clouds

    @property
    def varies_as_ground(self) -> bool:
        """Whether as much varies alike, or is related in other colours, as on one ground."""
        return self.has_one_ground or self.related >= _GROUND_SHARE

    @property
    def has_one_ground(self) -> bool:
        """Whether the remaining area varies alike, too, as in one sensor's views of one ground."""
        return self.ground >= _GROUND_SHARE and not self.is_finer_than_ground


@dataclass(frozen=True)
class Look:
    """Counts of one window.

    Parameters
    ----------
    edges
        Number of edges in each distance interval of `_NEAR_PX` from one another, at each of
        `_OFFSETS`, on the darker and the brighter side, shape (k, 2, 5).
    windows
        Number of pixels that are the same, related, and valid (see `Windows`): in the images, in
        reduced ones, in those reduced once more, and in reduced ones without the pixels that are
        the same in the images, shape (4, 3).
    greys
        See `Windows.greys`.
    spectra
        See `spectral_products`.
    """

    edges: NDArray[np.int_]
    windows: NDArray[np.int_]
    greys: NDArray[np.float64]
    spectra: NDArray[np.float64]

    @classmethod
    def of(cls, reference: Patch, input: Patch) -> Look:
        """Return the counts of two patches."""
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
        edges = _count_edges(reference, input)
        return cls(edges, counts, whole.greys, spectral_products(reference, input))


def sameness_of(looks: Sequence[Look], steps: Sequence[NDArray[np.float64]]) -> Sameness:
    """Return how much arrays share, from windows all over them.

    Parameters
    ----------
    looks
        Counts of the windows, of one at least.
    steps
        Their `step_products`, from the input without resampling where possible.
    """
    edges = np.sum([one.edges for one in looks], axis=0)
    sharp, blurred, *_ = edges.sum(axis=1).T
    _, to_half, *beside = edges[0].T
    windows = np.sum([one.windows for one in looks], axis=0)
    every = windows[:, 2]
    area, reduced_area, coarse_area, _ = windows[:, 0] / np.maximum(every, 1)
    # Of the images and of reduced ones.
    related = (windows[:, 1] / np.maximum(every, 1))[:2].min()
    coarse, fine = coherence([one.spectra for one in looks])
    return Sameness(
        float((sharp[0] - sharp[1:].mean()) / _most_of(blurred)),
        float(area),
        float(reduced_area),
        float(coarse_area),
        ground=float(windows[3, 0] / max(every[3], _LEAST_LEFT * every[1], 1.0)),
        related=float(related),
        step_width=step_width(np.sum(steps, axis=0)),
        brighter=_brighter(np.sum([one.greys for one in looks], axis=0)),
        beside=max(
            _more_of(to_half) / _most_of(sharp),
            *(_more_of(some) / _most_of(sharp + blurred) for some in beside),
        ),
        coarse_coherence=coarse,
        fine_coherence=fine,
    )


def _brighter(greys: NDArray[np.float64]) -> float:
    """Return `Sameness.brighter` by the sums of all windows' greys."""
    if not greys[..., 0].all():
        return 0.0
    means, every = greys[..., 1] / greys[..., 0], greys.sum(axis=1)
    variance = every[:, 2] / every[:, 0] - (every[:, 1] / every[:, 0]) ** 2
    spread = np.sqrt(np.maximum(variance, np.finfo(float).tiny))
    return float(((means[:, 0] - means[:, 1]) / spread).mean())


def _most_of(some: NDArray[np.int_]) -> float:
    """Return an upper limit of the edges that coincide beyond chance, by counts at `_OFFSETS`."""
    chance = some[1:].mean()
    # The variance of a count is its mean.
    error = np.sqrt(some[0] + chance / _CHANCE_OFFSETS + 1)
    return float(max(some[0] - chance, 0.0) + ONE_SIDED_5_PERCENT * error)


def _more_of(sides: NDArray[np.int_]) -> float:
    """Return a lower limit of the excess of edges on one side over the other, by their counts."""
    return float(abs(sides[1] - sides[0]) - ONE_SIDED_5_PERCENT * np.sqrt(sides.sum()))


def _count_edges(reference: Patch, input: Patch) -> NDArray[np.int_]:
    """Return `Look.edges` of two patches: numbers of strong edges by distance."""
    one, other = (Edges.of(patch).strongest for patch in (reference, input))
    apart = edges_apart_px(one.inner(LOOK_REACH_PX), other, _OFFSETS)[:, None]
    sides = np.concatenate([-apart, apart], axis=1)[..., None]
    return ((sides >= _NEAR_PX[:-1]) & (sides < _NEAR_PX[1:])).sum(axis=2)


def drawn_edges(reference: Patch, input: Patch) -> Mask:
    """Return the pixels where edges coincide, at least one of them strong, shape (h, w)."""
    one, other = Edges.of(reference), Edges.of(input)
    drawn = np.zeros_like(one.found)
    for edges, others in ((one, other.strongest), (one.strongest, other)):
        drawn[edges.found] |= np.abs(edges_apart_px(edges, others)[0]) <= _BLURRED_PX
    return drawn
