"""The similarity of two windows as a function of their pose, for searches that climb it.

Grey values are binned once. Poses that align the pixel grids are counted directly, which is cheap;
any other pose is counted by generalised partial volume estimation. Source: [Suri2010], section
4.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..pose.pose import Pose
from ..rasters.patch import Patch
from ..similarity.binning import MASKED, to_bins
from ..similarity.correlation import MINIMUM_OVERLAP
from ..similarity.joint_histogram import ORDER, count_joint_histograms
from ..similarity.measures import HistogramMeasure
from ..similarity.surface import SimilaritySettings
from .histogramming import joint_histogram_under
from .measures import HISTOGRAM_MEASURES

Bins = NDArray[np.uint8]


@dataclass(frozen=True)
class BinnedPair:
    """Two binned windows and the measure of their similarity.

    Parameters
    ----------
    template, image
        Bins of the reference and the input, `MASKED` for excluded pixels.
    counts
        Number of bins of each.
    measure
        Similarity of a joint histogram.
    order
        Order of the B-spline for poses that do not align the grids.
    """

    template: Bins
    image: Bins
    counts: tuple[int, int]
    measure: HistogramMeasure
    order: int

    @cached_property
    def nothing(self) -> float:
        """Similarity of independent images with these bins; it stands for too little overlap."""
        own, other = (
            np.bincount(bins[bins != MASKED], minlength=count).astype(float)
            for bins, count in zip((self.template, self.image), self.counts, strict=True)
        )
        return float(self.measure(np.outer(own, other)))

    @cached_property
    def _least(self) -> float:
        return MINIMUM_OVERLAP * float(np.count_nonzero(self.template != MASKED))

    @property
    def origin(self) -> tuple[float, float]:
        """Shift (right, down) nearest to 0 that aligns the grids: 0, or -0.5 for unlike parity."""
        height, width = np.subtract(self.image.shape, self.template.shape)
        return width // 2 - width / 2, height // 2 - height / 2

    def aligned(self, shift_px: tuple[float, float]) -> float:
        """Return the similarity at a shift (right, down) that aligns the pixel grids.

        Such shifts differ from `origin` by whole pixels.
        """
        pairs = zip(shift_px, self.image.shape[::-1], self.template.shape[::-1], strict=True)
        right, down = (round(s + (image - own) / 2) for s, image, own in pairs)
        template = _shifted(self.template, (-right, -down), self.image.shape)
        image = _shifted(self.image, (right, down), self.template.shape)
        if template.size == 0:
            return self.nothing
        counted = count_joint_histograms(template, image, self.counts)[0, 0]
        return self._similarity(counted.astype(np.float64))

    def under(self, pose: Pose) -> float:
        """Return the similarity at any pose."""
        to_image = pose.between(self.template.shape, self.image.shape)
        return self._similarity(
            joint_histogram_under(self.template, self.image, to_image, self.counts, self.order)
        )

    def _similarity(self, histogram: NDArray[np.float64]) -> float:
        """Return the measure, or that of independent images where the overlap is too small."""
        if histogram.sum() < self._least:
            return self.nothing
        return float(self.measure(histogram))


def _shifted(bins: Bins, start: tuple[int, int], shape: tuple[int, ...]) -> Bins:
    """Return the part of an image under a window of the given shape placed at (col, row)."""
    (col, row), (height, width) = start, shape
    return bins[max(row, 0) : max(row + height, 0), max(col, 0) : max(col + width, 0)]


def bin_pair(reference: Patch, input: Patch, settings: SimilaritySettings) -> BinnedPair | None:
    """Return two windows binned, or None if one of them is flat.

    For the similarity "fused", only its joint-histogram measure is used: NMI.

    Raises
    ------
    ParameterError
        The similarity is not measured on joint histograms.
    """
    name = "nmi" if settings.similarity == "fused" else settings.similarity
    if name not in HISTOGRAM_MEASURES:
        raise ParameterError(f"{name} is not measured on joint histograms, as this search needs")
    if reference.is_flat or input.is_flat:
        return None
    bins = settings.bins_for(reference.values.size)
    template, image = (to_bins(patch.values, patch.valid, bins) for patch in (reference, input))
    return BinnedPair(template, image, (bins, bins), HISTOGRAM_MEASURES[name], ORDER)
