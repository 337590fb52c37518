"""Chips that share one joint histogram, for masks that leave too little of each.

In towns a mask of the ground leaves a few per cent of a chip, too little for a joint histogram of
its own. All chips of the fit together have one; the log likelihood ratio of its grey-level pairs
measures how well each chip matches at each shift (see `similarity.pooled`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..context import Context
from ..errors import TooFewPointsError
from ..geometry.models import Model
from ..kinds import AUTO
from ..rasters.colours import Colours
from ..rasters.grid import FloatArray, PointFunction
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch, middle_window
from ..rasters.reading import FloatImage
from ..similarity.pooled import PooledHistogram, smooth
from ..similarity.surface import SimilaritySettings, normalise
from .belief_propagation import Surfaces
from .chip_windows import ChipWindows, Resampled, singly
from .layout import ChipLayout
from .matcher import ChipSurfaces, MaskOf, Places

# Chips with less ground than this are left out; fewer pixels in all make no joint histogram, and
# more are not needed for one.
_LEAST_VALID = 0.02
_LEAST_PIXELS, _MOST_PIXELS = 5_000, 4_000_000

# The evidence of masked chips separates kinds of models badly, and linear distortion is common.
_AUTO_KIND = "affine"


@dataclass(frozen=True)
class PooledHistogramMatcher:
    """Matches chips of a masked pair by a joint histogram of all, the input resampled by a model.

    The masked image's chips are the templates: the other image has no mask of its own, and what
    it shows beside the ground must not take part.

    Parameters
    ----------
    pair
        The images; one of them has a mask.
    pooled_chip_px
        Side of the chips, which cover the grid, that the joint histogram is counted in.
    held_out
        Returns for a piece of a grid which pixels of the reference must not be seen.
    blind
        Whether chips may not see what is held out; the joint histogram never counts it.
    colours
        By whose classes the image without mask is counted; None: by grey levels.
    """

    pair: ImagePair
    pooled_chip_px: int
    held_out: MaskOf
    blind: bool = True
    colours: Colours | None = None

    # What the coarse shift is searched for by.
    settings = SimilaritySettings("nmi")

    @classmethod
    def of(cls, pair: ImagePair, pooled_chip_px: int, held_out: MaskOf) -> PooledHistogramMatcher:
        """Return the matcher of a masked pair, by colours where the other image has some."""
        plain = cls(pair, pooled_chip_px, held_out)
        other = getattr(pair, plain._searched)
        if not other.has_colours:
            return plain
        window = middle_window(other.source.grid)
        bands, valid = other.source.read_bands(window, other.source.image_bands)
        if valid.all(axis=0).sum() < _LEAST_PIXELS:
            return plain
        return replace(plain, colours=Colours.of(np.abs(bands), valid.all(axis=0)))

    def seeing_all(self) -> PooledHistogramMatcher:
        """Return this matcher for check chips, which may see what is held out of the fit."""
        return replace(self, blind=False)

    def match(self, model: Model, places: Places, radius_px: int, context: Context) -> ChipSurfaces:
        """Return the surfaces of all chips that have enough ground.

        They are matched one way alone, so both ways are the same. Parameters as
        `ChipMatcher.match` has them.

        Raises
        ------
        TooFewPointsError
            The mask leaves too few pixels.
        """
        images = Resampled.by_model(self._coloured, model, places.grid, radius_px, context)
        tiles = Places.tiles(places.grid, self.pooled_chip_px)
        histogram = self._histogram(images, tiles, context)
        order = 1 if self._is_reference_masked else -1
        windows = self._windows(images, places, radius_px, self.blind)

        def surfaces(reference: Patch, input: Patch) -> Surfaces:
            template, search = self._template_first(reference, input)
            return histogram.surface(template.inner(radius_px), search)[..., ::order, ::order]

        def has_ground(reference: Patch, input: Patch) -> bool:
            return self._template_first(reference, input)[0].valid_share >= _LEAST_VALID

        kept, found = windows.map(surfaces, context, has_ground)
        span = 2 * radius_px + 1
        nats = np.stack(found) if found else np.zeros((0, span, span), np.float32)
        normalised = normalise(nats)
        # Chips count by their evidence, in nats; on average as much as those of other similarities.
        spread = np.ptp(nats, axis=(1, 2)) / np.maximum(np.ptp(normalised, axis=(1, 2)), 1e-9)
        heights = normalised.max(axis=(1, 2), initial=0.0) * spread
        weight = spread / max(float(heights.mean()), 1e-9) if found else spread
        return ChipSurfaces(places.centres[kept], normalised, normalised, weight)

    def fit_places(self, layout: ChipLayout) -> Places:
        """Return the chips that a fit is made of: all over the grid, as there is little in each."""
        return Places.tiles(self.pair.grid, self.pooled_chip_px)

    def first_model(
        self, surfaces: ChipSurfaces, layout: ChipLayout, kind: str, seed: int
    ) -> PointFunction:
        """Return a first model: the shift with the highest sum over all chips."""
        shift = surfaces.common_shift_px
        return lambda px: px + shift

    def kind_of(self, kind: str) -> str:
        """Return the kind of model that is fitted where one is asked for."""
        return _AUTO_KIND if kind == AUTO else kind

    def is_settled(self, expected_px: FloatArray) -> bool:
        """Whether matching again is in vain: never.

        The joint histogram gets the better the nearer chips lie.
        """
        return False

    def for_points(self, surfaces: ChipSurfaces) -> ChipSurfaces:
        """Return the surfaces that points of the fit are taken from: sums of neighbouring chips.

        Little of each chip is ground. Measured by the suite rpc_city, with surface models: RPCs
        refined by single chips are off by 0.73 px (median), by such sums 0.63 px.
        """
        return surfaces.with_neighbours(self.pooled_chip_px)

    def for_check(self, surfaces: ChipSurfaces, layout: ChipLayout) -> ChipSurfaces:
        """Return the surfaces that check points are taken from: sums over neighbouring blocks."""
        return surfaces.summed(layout.neighbourhoods(surfaces.centres))

    def _histogram(self, images: Resampled, places: Places, context: Context) -> PooledHistogram:
        """Return the evidence of pairs of grey levels in chips of the fit, as they lie now."""
        every = max(len(places.centres) * places.chip_px**2 // _MOST_PIXELS, 1)

        def pixels(reference: Patch, input: Patch) -> FloatImage:
            template, search = self._template_first(reference, input)
            both = template.valid & search.valid
            return np.stack([smooth(template).values[both], search.values[both]])[:, ::every]

        windows = self._windows(images, places, 0, blind=True)
        _, sampled = windows.map(singly(pixels), context.quiet())
        sample = np.concatenate(sampled, axis=1) if sampled else np.zeros((2, 0), np.float32)
        count = sample.shape[1] * every
        if count < _LEAST_PIXELS:
            raise TooFewPointsError(f"the mask leaves only about {count} pixels to match")
        edges = None if self.colours is None else self.colours.edges
        return PooledHistogram.of(sample[0], sample[1], search_edges=edges)

    @property
    def _searched(self) -> str:
        """Which image has no mask, or none that chips are cut by."""
        return "input" if self._is_reference_masked else "reference"

    @property
    def _coloured(self) -> ImagePair:
        """The pair, with classes of colour where they are counted."""
        if self.colours is None:
            return self.pair
        other = replace(getattr(self.pair, self._searched), colours=self.colours)
        return replace(self.pair, **{self._searched: other})

    @property
    def _is_reference_masked(self) -> bool:
        return self.pair.reference.mask is not None

    def _windows(
        self, images: Resampled, places: Places, radius_px: int, blind: bool
    ) -> ChipWindows:
        return ChipWindows(images, places, radius_px, self.held_out if blind else None)

    def _template_first(self, reference: Patch, input: Patch) -> tuple[Patch, Patch]:
        """Return the masked image's window, then the other's."""
        return (reference, input) if self._is_reference_masked else (input, reference)
