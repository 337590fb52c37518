"""The similarity surface of one window of an image pair, for any measure, and its second peak."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter

from ..context import Context
from ..errors import NoOverlapError, ParameterError, RasterContentError
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.binning import MASKED
from ..similarity.correlation import MINIMUM_OVERLAP, overlap_share
from ..similarity.description import BORDER_PX
from ..similarity.joint_histogram import ORDER, reach
from ..similarity.measures import MEASURES, HistogramMeasure
from ..similarity.peak import Peak, find_peak
from ..similarity.surface import (
    SIMILARITIES,
    SimilaritySettings,
    Surface,
    describe,
    detrend,
    similarity_surface,
)
from .density_ratio import information_surface
from .histogramming import measure_surface, to_levels
from .measures import HISTOGRAM_MEASURES, renyi_mutual_information, tsallis_mutual_information

GREY_VALUES = "grey-values"
_MLMI = "mlmi"
CHOICES = tuple(dict.fromkeys((*SIMILARITIES, *HISTOGRAM_MEASURES, _MLMI)))

DEFAULT_RADIUS_PX, LARGEST_RADIUS_PX = 20, 100

# Least distance of the second peak from the first along columns or rows, exclusive.
_PEAK_PX = 2


@dataclass(frozen=True)
class Window:
    """Position and size of the window that a surface is measured for.

    Parameters
    ----------
    pair
        The images.
    centre_px
        Column and row of the window's centre in the matching grid.
    chip_px
        Side of the window, odd.
    radius_px
        Largest shift.
    """

    pair: ImagePair
    centre_px: tuple[int, int]
    chip_px: int
    radius_px: int

    @classmethod
    def at(
        cls,
        pair: ImagePair,
        centre: tuple[float | None, float | None],
        chip_px: int,
        radius_m: float | None,
    ) -> Window:
        """Return the window at a position on the map, by default the middle of the overlap.

        Raises
        ------
        ParameterError
            Only one coordinate is given, or the radius is not 2 to 100 pixels.
        NoOverlapError
            The centre does not lie in the overlap.
        """
        x, y = centre
        if (x is None) != (y is None):
            raise ParameterError("give both x and y of the centre, or none")
        px = np.array(pair.grid.centre_px)
        if x is not None and y is not None:
            px = pair.grid.map_to_pixel([[x, y]])[0]
            if not pair.grid.contains(px):
                raise NoOverlapError(f"the centre {x:.15g}, {y:.15g} does not lie in the overlap")
        col, row = np.floor(px + 0.5).astype(int)
        # Even sizes are increased by one, so that the window has a central pixel.
        return cls(pair, (int(col), int(row)), chip_px | 1, _radius_px(pair.grid, radius_m))

    def grid(self, reach_px: int) -> Grid:
        """Return the part of the matching grid around the centre, 2 reach + 1 pixels a side."""
        col, row = self.centre_px
        return self.pair.grid.window(col - reach_px, row - reach_px, *(2 * reach_px + 1,) * 2)

    def read(self) -> tuple[Patch, Patch]:
        """Return reference and input patches that include the reach of shifts and filters.

        Raises
        ------
        RasterContentError
            A window has too few valid pixels or is constant.
        """
        piece = self.grid(self.chip_px // 2 + self.radius_px + BORDER_PX)
        pair = self.pair
        patches = pair.reference_patch(piece), pair.input_patch(piece, pair.nominal_px)
        reaches = (self.radius_px + BORDER_PX, BORDER_PX)
        for image, patch, reach_px in zip(
            (pair.reference, pair.input), patches, reaches, strict=True
        ):
            counted = patch.inner(reach_px)
            what = f"the window of {image.source.path}"
            if counted.valid_share < MINIMUM_OVERLAP:
                raise RasterContentError(f"{what} holds too few valid pixels: move the centre")
            if counted.is_flat:
                raise RasterContentError(f"{what} is constant: there is nothing to match")
        return patches


@dataclass(frozen=True)
class SurfaceSettings:
    """How the surface is measured.

    Parameters
    ----------
    similarity
        One of `CHOICES`.
    bins
        Number of bins; None: chosen by the window's size.
    binning
        One of `binning.BINNINGS`, or `GREY_VALUES`.
    gpve_order
        Order of the histogram's B-spline.
    entropy_order
        Order of the Rényi or Tsallis entropy.
    sample
        Number of pixels that MLMI is estimated from.
    """

    similarity: str = "fused"
    bins: int | None = None
    binning: str = "equal-frequency"
    gpve_order: int = ORDER
    entropy_order: float = 2.0
    sample: int = 1000

    def __post_init__(self) -> None:
        plain = (self.binning, self.gpve_order) == (SurfaceSettings.binning, ORDER)
        if self.similarity == "fused" and not (plain and (self.bins or 0) <= MASKED):
            raise ParameterError(
                f"fused takes up to {MASKED} bins, equally frequent, of order {ORDER}: choose a "
                "measure of the histogram for others"
            )
        if self.binning == GREY_VALUES and self.bins is not None:
            raise ParameterError(f"{GREY_VALUES} takes all grey values: give no number of bins")

    def surfaces(
        self, reference: Patch, input: Patch, radius: int, context: Context
    ) -> tuple[Surface, Surface]:
        """Return the values of the measure, and the surface in robust standard deviations.

        Parameters
        ----------
        reference, input
            Windows of equal size that include the reach of shifts and filters; see `Window.read`.
        radius
            Largest shift, in pixels.
        context
            Provides threads, progress, and the seed of samples.

        Returns
        -------
        Two arrays of shape (2 radius + 1, 2 radius + 1). Where too few pixels overlap, values are
        NaN and deviations 0.
        """
        template, search = reference.inner(radius + BORDER_PX), input.inner(BORDER_PX)
        if self.similarity == _MLMI:
            values = information_surface(template, search, self.sample, context)
            deviations = detrend(values)
        elif self.similarity in HISTOGRAM_MEASURES:
            values = self._of_histograms(reference, input, radius, context)
            deviations = detrend(values)
        else:
            values, deviations = self._of_matching(reference, input, radius, context)
        enough = overlap_share(template, search) >= MINIMUM_OVERLAP - 1e-6
        return (
            np.where(enough, values, np.nan).astype(np.float32),
            np.where(enough, deviations, 0).astype(np.float32),
        )

    def _of_matching(
        self, reference: Patch, input: Patch, radius: int, context: Context
    ) -> tuple[Surface, Surface]:
        settings = SimilaritySettings(self.similarity, self.bins)
        pixels = (reference.values.shape[0] - 2 * (radius + BORDER_PX)) ** 2
        template, search = (describe(patch, pixels, settings) for patch in (reference, input))
        template = template.inner(radius)
        deviations = similarity_surface(template, search, radius, settings, context)
        if self.similarity not in MEASURES:  # fused: a sum of measures has no values of its own
            return deviations, deviations
        values = MEASURES[self.similarity](template, search, context)
        return values.reshape(-1, *deviations.shape).mean(axis=0), deviations

    def _of_histograms(
        self, reference: Patch, input: Patch, radius: int, context: Context
    ) -> Surface:
        margin = reach(self.gpve_order)
        pixels = (reference.values.shape[0] - 2 * (radius + BORDER_PX)) ** 2
        bins = SimilaritySettings(bins=self.bins).bins_for(pixels)
        levels = None if self.binning == GREY_VALUES else bins
        (first, first_count), (second, second_count) = (
            to_levels(patch.inner(BORDER_PX - margin), levels, self.binning)
            for patch in (reference, input)
        )
        inside = slice(radius + margin, -(radius + margin))
        values = measure_surface(
            first[inside, inside],
            second,
            (first_count, second_count),
            self._measure,
            self.gpve_order,
            context,
        )
        # Powers of shares overflow or underflow: the surface would be infinite or flat.
        if self.similarity == "tsallis" and not (np.isfinite(values).all() and values.any()):
            raise ParameterError(
                f"Tsallis' entropy of order {self.entropy_order:g} has values here that are beyond "
                "single precision: take an order nearer to 1"
            )
        return values

    @property
    def _measure(self) -> HistogramMeasure:
        if self.similarity == "renyi":
            return renyi_mutual_information(self.entropy_order)
        if self.similarity == "tsallis":
            return tsallis_mutual_information(self.entropy_order)
        return HISTOGRAM_MEASURES[self.similarity]


def _radius_px(grid: Grid, radius_m: float | None) -> int:
    if radius_m is None:
        return DEFAULT_RADIUS_PX
    radius = round(radius_m / grid.pixel_size_m)
    if not 2 <= radius <= LARGEST_RADIUS_PX:
        low, high = (n * grid.pixel_size_m for n in (2, LARGEST_RADIUS_PX))
        raise ParameterError(
            f"the search radius must be {low:.6g} to {high:.6g} m, 2 to {LARGEST_RADIUS_PX} "
            f"pixels of the matching grid, not {radius_m:.6g} m"
        )
    return radius


def second_peak(surface: Surface, first: Peak) -> Peak | None:
    """Return the highest peak of a surface that is clearly separate from the first one."""
    radius = surface.shape[0] // 2
    rows, cols = np.nonzero(surface >= maximum_filter(surface, 3, mode="nearest"))
    inner = (np.abs(np.stack([rows, cols]) - radius) < radius).all(axis=0)
    away = np.abs(np.stack([cols, rows]) - radius - np.reshape(first.shift_px, (2, 1)))
    heights = surface[rows, cols]
    apart = inner & (away.max(axis=0) > _PEAK_PX) & (heights > 0)
    if not apart.any():
        return None
    best = int(np.where(apart, heights, -np.inf).argmax())
    row, col = int(rows[best]), int(cols[best])
    found = find_peak(surface[row - 1 : row + 2, col - 1 : col + 2])
    shift = found.shift_px[0] + col - radius, found.shift_px[1] + row - radius
    return replace(found, shift_px=shift)
