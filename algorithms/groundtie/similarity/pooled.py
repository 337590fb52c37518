"""Mutual information of many chips by one pooled joint histogram.

A ground mask leaves too few pixels of a chip for a joint histogram of its own; the pixels of all
chips are enough. Their pooled histogram gives the pointwise mutual information of a pair of grey
levels, log p(a, b) / (p(a) p(b)), whose mean is mutual information. A chip's similarity at a shift
is the sum over its pixels. Chips therefore add up: weak evidence from many outweighs the bias of a
few.

Source: point similarity measures [Rogelj2003].
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.colours import levels
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage
from .binning import bin_edges
from .correlation import fast_shape, from_spectrum, spans, spectrum
from .stacks import each
from .surface import Surface

BINS = 12

# Initial count of every pair of grey levels, so that no pair has probability 0.
_UNSEEN = 0.5

# Side of the window over which the template's speckle is averaged.
_SMOOTH_PX = 3


@dataclass(frozen=True)
class PooledHistogram:
    """Pointwise mutual information of pairs of grey levels.

    Parameters
    ----------
    template_edges, search_edges
        Inner edges between grey levels, shape (bins - 1,).
    information
        log p(a, b) / (p(a) p(b)) of the template's level a and the search window's b, in nats,
        shape (bins, bins).
    """

    template_edges: FloatImage
    search_edges: FloatImage
    information: FloatImage

    @classmethod
    def of(
        cls, template: FloatImage, search: FloatImage, search_edges: FloatImage | None = None
    ) -> PooledHistogram:
        """Return the pointwise mutual information by a sample of pairs.

        Parameters
        ----------
        template, search
            Grey values of corresponding pixels, the template's `smooth`, shape (n,).
        search_edges
            Inner edges between levels of the second image; None: `BINS` equally frequent levels, as
            for the first.
        """
        if search_edges is None:
            search_edges = bin_edges(search, BINS)
        edges = bin_edges(template, BINS), search_edges
        own, other = (
            levels(s, e).astype(np.intp) for e, s in zip(edges, (template, search), strict=True)
        )
        shape = len(edges[0]) + 1, len(edges[1]) + 1
        counts = np.bincount(own * shape[1] + other, minlength=shape[0] * shape[1]) + _UNSEEN
        joint = counts.reshape(shape) / counts.sum()
        independent = joint.sum(axis=1, keepdims=True) * joint.sum(axis=0, keepdims=True)
        return cls(edges[0], edges[1], np.log(joint / independent).astype(np.float32))

    def surface(self, template: Patch, search: Patch) -> Surface:
        """Return the sums of information over shifts, in nats, shape (…, 2 r + 1, 2 r + 1).

        Parameters
        ----------
        template
            The chip, or a stack of chips, (…, h, w); invalid pixels take no part.
        search
            Windows with the same centres, larger by r on each side; invalid pixels add 0.
        """
        template = smooth(template)
        own = levels(template.values, self.template_edges)
        other = levels(search.values, self.search_edges)
        # Invalid pixels get a level of their own, without information.
        own[~template.valid] = len(self.information)
        other[~search.valid] = self.information.shape[1]
        shape = fast_shape(other)
        total: NDArray[np.complexfloating] = np.zeros((), np.complex64)
        found = np.empty(other.shape, np.float32)
        for level, information in enumerate(self.information):
            np.append(information, np.float32(0)).take(other, out=found, mode="clip")
            product = spectrum((own == level).astype(np.float32), shape).conj()
            product *= spectrum(found, shape)
            total = np.add(total, product, out=product)
        return np.asarray(from_spectrum(total, shape, spans(own, other)), np.float32)


def smooth(patch: Patch) -> Patch:
    """Return a patch with its power averaged over the valid pixels around each pixel.

    The power of negative values, such as decibels, counts as negative, which keeps their order.
    """
    counts = patch.valid.astype(np.float32)

    def mean(image: FloatImage) -> FloatImage:
        return np.asarray(cv2.blur(image, (_SMOOTH_PX, _SMOOTH_PX)), np.float32)

    signed = patch.values * np.abs(patch.values) * counts
    # Running sums leave small values of either sign where all pixels are 0.
    least = signed.min(axis=(-2, -1), keepdims=True, initial=0)
    power = np.maximum(each(mean, signed), least)
    share = np.maximum(each(mean, counts), np.float32(1e-6))
    return Patch(np.copysign(np.sqrt(np.abs(power) / share), power), patch.valid)
