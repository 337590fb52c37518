"""The similarity surface of one window of a pair, for any measure, and its second peak."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter

from ..errors import ParameterError, RasterContentError
from ..progress import Progress
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity import surface as surfaces
from ..similarity.binning import MASKED
from ..similarity.correlation import (
    MINIMUM_OVERLAP,
    correlate_fields,
    correlate_grey,
    overlap_share,
)
from ..similarity.density_ratio import information_surface
from ..similarity.histogramming import measure_surface, to_levels
from ..similarity.joint_histogram import reach
from ..similarity.measures import (
    MEASURES,
    Measure,
    renyi_mutual_information,
    tsallis_mutual_information,
)
from ..similarity.peak import Peak, find_peak
from ..similarity.surface import BORDER_PX, SIMILARITIES, SimilaritySettings, Surface

GREY_VALUES = "grey-values"
CHOICES = (*SIMILARITIES, "mlmi")

# A second peak lies further away from the first than this along columns or rows.
_PEAK_PX = 2


@dataclass(frozen=True)
class Window:
    """Where and how a surface is made.

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

    def grid(self, reach_px: int) -> Grid:
        """Return the piece of the matching grid around the centre, 2 reach + 1 pixels a side."""
        col, row = self.centre_px
        return self.pair.grid.window(col - reach_px, row - reach_px, *(2 * reach_px + 1,) * 2)

    def read(self) -> tuple[Patch, Patch]:
        """Return reference and input with all that shifts and filters reach.

        Raises
        ------
        RasterContentError
            There is too little to match.
        """
        piece = self.grid(self.chip_px // 2 + self.radius_px + BORDER_PX)
        pair = self.pair
        patches = pair.reference_patch(piece), pair.input_patch(piece, pair.nominal_px)
        reaches = (self.radius_px + BORDER_PX, BORDER_PX)
        for image, patch, reach_px in zip(
            (pair.reference, pair.input), patches, reaches, strict=True
        ):
            seen = patch.inner(reach_px)
            what = f"the window of {image.source.path}"
            if seen.valid_share < MINIMUM_OVERLAP:
                raise RasterContentError(f"{what} holds too few valid pixels: move the centre")
            if seen.is_flat:
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
    alpha, q
        Orders of Rényi's and of Tsallis' entropy.
    sample
        Pixels that MLMI is estimated from.
    seed
        Of that sample.
    """

    similarity: str
    bins: int | None
    binning: str
    gpve_order: int
    alpha: float
    q: float
    sample: int
    seed: int

    def __post_init__(self) -> None:
        if self.similarity == "fused" and (self.binning == GREY_VALUES or self._bins > MASKED):
            raise ParameterError(
                f"fused takes up to {MASKED} bins: choose a measure of the histogram for more"
            )
        if self.binning == GREY_VALUES and self.bins is not None:
            raise ParameterError(f"{GREY_VALUES} takes all grey values: give no number of bins")

    @property
    def _bins(self) -> int:
        return self.bins or 0

    @property
    def _measure(self) -> Measure:
        parametrised = {
            "renyi": renyi_mutual_information(self.alpha),
            "tsallis": tsallis_mutual_information(self.q),
        }
        return parametrised.get(self.similarity) or MEASURES[self.similarity]

    def surfaces(
        self, reference: Patch, input: Patch, window: Window, executor: Executor, progress: Progress
    ) -> tuple[Surface, Surface]:
        """Return the values of the measure and the evidence in robust standard deviations.

        Values are NaN where too few pixels overlap, the evidence is 0.
        """
        radius = window.radius_px
        template = reference.inner(radius + BORDER_PX)
        search = input.inner(BORDER_PX)
        if self.similarity in ("fused", "orientation", "edge-strength"):
            values, evidence = self._by_edges(reference, input, window, executor)
        else:
            if self.similarity == "ncc":
                values = correlate_grey(template, search)
            elif self.similarity == "mlmi":
                values = information_surface(
                    template, search, self.sample, self.seed, executor, progress
                )
            else:
                values = self._by_histogram(reference, input, window, executor, progress)
            evidence = surfaces.detrend(values)
        enough = overlap_share(template, search) >= MINIMUM_OVERLAP - 1e-6
        return (
            np.where(enough, values, np.nan).astype(np.float32),
            np.where(enough, evidence, 0).astype(np.float32),
        )

    def _by_edges(
        self, reference: Patch, input: Patch, window: Window, executor: Executor
    ) -> tuple[Surface, Surface]:
        pixels, radius = window.chip_px**2, window.radius_px
        settings = SimilaritySettings(self.similarity, self.bins, self.binning, self.gpve_order)
        there, here = (surfaces.describe(patch, pixels, settings) for patch in (reference, input))
        template = there.inner(radius)
        evidence = surfaces.similarity_surface(template, here, radius, settings, executor)
        if self.similarity == "fused":
            return evidence, evidence
        if self.similarity == "edge-strength":
            return surfaces.strength_surface(template, here), evidence
        assert template.fields is not None and here.fields is not None
        valid = template.patch.valid, here.patch.valid
        return correlate_fields(template.fields, here.fields, *valid).mean(axis=0), evidence

    def _by_histogram(
        self, reference: Patch, input: Patch, window: Window, executor: Executor, progress: Progress
    ) -> Surface:
        margin = reach(self.gpve_order)
        bins = self.bins or SimilaritySettings().bins_for(window.chip_px**2)
        (own, own_count), (other, other_count) = (
            to_levels(
                patch.inner(BORDER_PX - margin),
                None if self.binning == GREY_VALUES else bins,
                self.binning,
            )
            for patch in (reference, input)
        )
        inside = slice(window.radius_px + margin, -(window.radius_px + margin))
        return measure_surface(
            own[inside, inside],
            other,
            (own_count, other_count),
            self._measure,
            self.gpve_order,
            executor,
            progress,
        )


def second_peak(evidence: Surface, first: Peak) -> Peak | None:
    """Return the highest peak of a surface that lies apart from the first one."""
    radius = evidence.shape[0] // 2
    rows, cols = np.nonzero(evidence >= maximum_filter(evidence, 3, mode="nearest"))
    inner = (np.abs(np.stack([rows, cols]) - radius) < radius).all(axis=0)
    away = np.abs(np.stack([cols, rows]) - radius - np.reshape(first.shift_px, (2, 1)))
    heights = evidence[rows, cols]
    apart = inner & (away.max(axis=0) > _PEAK_PX) & (heights > 0)
    if not apart.any():
        return None
    best = int(np.where(apart, heights, -np.inf).argmax())
    row, col = int(rows[best]), int(cols[best])
    found = find_peak(evidence[row - 1 : row + 2, col - 1 : col + 2])
    shift = found.shift_px[0] + col - radius, found.shift_px[1] + row - radius
    return replace(found, shift_px=shift)
