"""Chips that share one joint histogram, for masks that leave too little of each chip.

In towns a ground mask leaves a few per cent of a chip, too little for a joint histogram of its own.
So all chips of the fit share one. The log likelihood ratio of its grey-level pairs measures how
well each chip matches at each shift (see `similarity.pooled`).
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
from ..rasters.pair import ImagePair, window_below
from ..rasters.patch import Patch, middle_window
from ..rasters.reading import FloatImage, Window
from ..similarity.pooled import PooledHistogram, smooth
from ..similarity.surface import SimilaritySettings, normalise
from .belief_propagation import Surfaces
from .chip_windows import ChipWindows, Resampled, singly
from .layout import ChipLayout
from .matcher import ChipSurfaces, MaskOf, Places

# Least share of ground in a chip. A joint histogram needs at least the first number of pixels, and
# no more than the second.
_LEAST_VALID = 0.02
_LEAST_PIXELS, _MOST_PIXELS = 5_000, 4_000_000

# Masked chips have too little evidence to choose the kind of model; linear distortion is common.
_AUTO_KIND = "affine"


@dataclass(frozen=True)
class PooledHistogramMatcher:
    """Matches chips of a masked pair by one joint histogram, the input resampled by a model.

    The masked image's chips are the templates. The other image has no mask of its own, and its
    content other than ground must not take part.

    Parameters
    ----------
    pair
        The images; one of them has a mask.
    pooled_chip_px
        Side of the chips, covering the grid, from which the joint histogram is counted.
    held_out
        Takes a piece of a grid and returns which pixels of the reference are held out.
    blind
        Whether held-out pixels are hidden from chips; the joint histogram never counts them.
    colours
        Colour classes by which the image without mask is counted; None: by grey levels.
    """

    pair: ImagePair
    pooled_chip_px: int
    held_out: MaskOf
    blind: bool = True
    colours: Colours | None = None

    # The similarity measure of the coarse search.
    settings = SimilaritySettings("nmi")

    @classmethod
    def of(cls, pair: ImagePair, pooled_chip_px: int, held_out: MaskOf) -> PooledHistogramMatcher:
        """Return the matcher of a masked pair, by colours if the other image has them."""
        plain = cls(pair, pooled_chip_px, held_out)
        other = getattr(pair, plain._searched)
        if not other.has_colours:
            return plain
        # Another part of a large file may show other land, or nothing.
        part = window_below(other.source.grid, pair.surroundings)
        col, row, *size = middle_window(other.source.grid.window(*part))
        window = Window(part.col + col, part.row + row, *size)
        bands, valid = other.source.read_bands(window, other.source.image_bands)
        if valid.all(axis=0).sum() < _LEAST_PIXELS:
            return plain
        return replace(plain, colours=Colours.of(np.abs(bands), valid.all(axis=0)))

    def seeing_all(self) -> PooledHistogramMatcher:
        """Return this matcher for check chips, which may see the blocks held out of the fit."""
        return replace(self, blind=False)

    def match(self, model: Model, places: Places, radius_px: int, context: Context) -> ChipSurfaces:
        """Return the surfaces of all chips that have enough ground.

        They are matched in one direction only, so both surfaces are the same. Parameters as in
        `ChipMatcher.match`.

        Raises
        ------
        TooFewPointsError
            The mask leaves too few pixels.
        """
        pair = self._coloured
        images = Resampled.of(pair, pair.transform(model), places.grid, radius_px, context)
        tiles = Places.tiles(places.grid, self.pooled_chip_px)
        histogram = self._histogram(images, tiles, context)
        order = 1 if self._is_reference_masked else -1
        hidden = self.held_out if self.blind else None
        windows = ChipWindows(images, places, radius_px, hidden)

        def surfaces(reference: Patch, input: Patch) -> Surfaces:
            template, search = self._template_first(reference, input)
            return histogram.surface(template.inner(radius_px), search)[..., ::order, ::order]

        def has_ground(reference: Patch, input: Patch) -> bool:
            return self._template_first(reference, input)[0].valid_share >= _LEAST_VALID

        kept, found = windows.map(surfaces, context, has_ground)
        span = 2 * radius_px + 1
        nats = np.stack(found) if found else np.zeros((0, span, span), np.float32)
        normalised = normalise(nats)
        # Chips are weighted by their evidence, in nats; weighted peaks average 1, as in other fits.
        spread = np.ptp(nats, axis=(1, 2)) / np.maximum(np.ptp(normalised, axis=(1, 2)), 1e-9)
        heights = normalised.max(axis=(1, 2), initial=0.0) * spread
        weight = spread / max(float(heights.mean()), 1e-9) if found else spread
        return ChipSurfaces(places.centres[kept], normalised, normalised, weight)

    def fit_places(self, layout: ChipLayout) -> Places:
        """Return the chips of the fit: all over the grid, as each holds little ground."""
        return Places.tiles(self.pair.grid, self.pooled_chip_px)

    def first_model(
        self, surfaces: ChipSurfaces, layout: ChipLayout, kind: str, seed: int
    ) -> PointFunction:
        """Return a first model: the shift with the highest sum over all chips."""
        shift = surfaces.common_shift_px
        return lambda px: px + shift

    def kind_of(self, kind: str) -> str:
        """Return the kind of model to fit when `kind` is requested."""
        return _AUTO_KIND if kind == AUTO else kind

    def is_settled(self, expected_px: FloatArray) -> bool:
        """Whether matching again cannot help: never.

        The joint histogram improves with alignment.
        """
        return False

    def for_points(self, surfaces: ChipSurfaces) -> ChipSurfaces:
        """Return the surfaces from which tie points of the fit are taken: sums of neighbours.

        Little of each chip is ground. Measured by the suite rpc_city, with surface models: RPCs
        refined by single chips are off by 0.73 px (median), by such sums 0.63 px.
        """
        return surfaces.with_neighbours(self.pooled_chip_px)

    def for_check(self, surfaces: ChipSurfaces, layout: ChipLayout) -> ChipSurfaces:
        """Return the surfaces from which check points are taken: sums over neighbouring blocks."""
        return surfaces.summed(layout.neighbourhoods(surfaces.centres))

    def _histogram(self, images: Resampled, places: Places, context: Context) -> PooledHistogram:
        """Return the joint histogram of the chips of the fit at their current alignment."""
        every = max(len(places.centres) * places.chip_px**2 // _MOST_PIXELS, 1)

        def pixels(reference: Patch, input: Patch) -> FloatImage:
            template, search = self._template_first(reference, input)
            both = template.valid & search.valid
            return np.stack([smooth(template).values[both], search.values[both]])[:, ::every]

        windows = ChipWindows(images, places, 0, self.held_out)
        _, sampled = windows.map(singly(pixels), context.quiet())
        sample = np.concatenate(sampled, axis=1) if sampled else np.zeros((2, 0), np.float32)
        count = sample.shape[1] * every
        if count < _LEAST_PIXELS:
            raise TooFewPointsError(f"the mask leaves only about {count} pixels to match")
        edges = None if self.colours is None else self.colours.edges
        return PooledHistogram.of(sample[0], sample[1], search_edges=edges)

    @property
    def _searched(self) -> str:
        """Name of the image that is searched: its mask, if any, does not cut chips."""
        return "input" if self._is_reference_masked else "reference"

    @property
    def _coloured(self) -> ImagePair:
        """The pair, with colour classes if they are counted."""
        if self.colours is None:
            return self.pair
        other = replace(getattr(self.pair, self._searched), colours=self.colours)
        return replace(self.pair, **{self._searched: other})

    @property
    def _is_reference_masked(self) -> bool:
        return self.pair.reference.mask is not None

    def _template_first(self, reference: Patch, input: Patch) -> tuple[Patch, Patch]:
        """Return the masked image's window, then the other's."""
        return (reference, input) if self._is_reference_masked else (input, reference)
