"""Measures of similarity: functions of two windows that return surfaces over shifts.

To add a measure, write its function in this file, a line in `MEASURES`, and its test. Every tool
with a choice of similarity then offers it, and `similarity_surface` shows it. `of_histograms` makes
a measure of a function of joint histograms. Measures that only serve for comparison are in
`studies.measures`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from ..context import Context
from .correlation import correlate_fields, correlate_grey
from .description import Description
from .joint_histogram import count_joint_histograms, gpve_histograms

FloatArray = NDArray[np.floating]
Histograms: TypeAlias = Any  # an array, or a sparse matrix of scipy

# Takes joint histograms of counts or weights, shape (…, bins A, bins B), or one histogram as a
# sparse matrix, and returns values of shape (…). Without any pixel, or with a constant image, the
# value is that of independent images.
HistogramMeasure = Callable[[Histograms], FloatArray]

# Takes templates (…, h, w), one or a stack; search windows with the same centres that are larger
# by a radius on each side; and a context to work in. Returns values over shifts, shape
# (…, 2 radius + 1, 2 radius + 1), or several such surfaces of equal weight, shape (n, …).
Measure = Callable[[Description, Description, Context | None], FloatArray]

# Lanes and block length with which numpy sums along contiguous memory.
_LANES, _PAIRWISE_BLOCK = 8, 128

# Entropies, shares and variances below this hold rounding only.
NOTHING = 1e-9


def of_histograms(function: HistogramMeasure) -> Measure:
    """Return the measure of windows that applies a measure of joint histograms."""

    def values(template: Description, search: Description, context: Context | None) -> FloatArray:
        bins = (template.bin_count, search.bin_count)
        counts = count_joint_histograms(template.bins, search.bins_around, bins, context)
        return function(gpve_histograms(counts)).astype(np.float32)

    return values


def normalized_mutual_information(histograms: Histograms) -> FloatArray:
    """Return Studholme's (H(A) + H(B)) / H(A, B), between 1 and 2 ([Suri2010] eq 3.21)."""
    a, b, ab = map(entropy, tables(histograms))
    informative = ab > NOTHING
    return np.where(informative, (a + b) / np.where(informative, ab, 1.0), 1.0)


nmi = of_histograms(normalized_mutual_information)


def orientation(
    template: Description, search: Description, context: Context | None = None
) -> FloatArray:
    """Return the correlation of the orientation of edges, a surface for each scale."""
    valid = template.patch.valid, search.patch.valid
    workers = 1 if context is None else context.workers
    return correlate_fields(template.fields, search.fields, *valid, workers)


def strength(
    template: Description, search: Description, context: Context | None = None
) -> FloatArray:
    """Return the correlation of the strength of edges."""
    return correlate_grey(template.strength, search.strength)


def ncc(template: Description, search: Description, context: Context | None = None) -> FloatArray:
    """Return the correlation of grey values."""
    return correlate_grey(template.patch, search.patch)


# By the names by which users choose them.
MEASURES: dict[str, Measure] = {
    "nmi": nmi,
    "orientation": orientation,
    "edge-strength": strength,
    "ncc": ncc,
}


def tables(histograms: Histograms) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the histograms of A and of B and all cells of the joint one, along the last axis."""
    if scipy.sparse.issparse(histograms):
        a, b = (np.asarray(histograms.sum(axis=axis)).ravel() for axis in (1, 0))
        return a, b, histograms.tocsr().data
    joint = np.asarray(histograms)
    cells = joint.reshape(*joint.shape[:-2], -1)
    return pairwise_sum(joint), joint.sum(axis=-2), cells


def entropy(table: FloatArray) -> FloatArray:
    """Return Shannon's entropy in nats along the last axis; the table need not be normalised."""
    count = pairwise_sum(table)
    total = np.where(count > 0, count, 1.0)
    plogp = np.maximum(table, 1e-12)
    plogp = np.multiply(np.log(plogp, out=plogp), table, out=plogp)
    return np.asarray(np.log(total) - pairwise_sum(plogp) / total)


def pairwise_sum(table: FloatArray) -> FloatArray:
    """Return sums along the last axis, with the digits of numpy's sums in contiguous memory.

    Histograms of many shifts have the shifts last in memory. Adding them is quick but loses digits,
    because numpy adds pairwise along contiguous memory only.
    """
    if table.strides[-1] == table.itemsize:
        return np.asarray(table.sum(axis=-1))
    count = table.shape[-1]
    if count > _PAIRWISE_BLOCK:
        half = count // 2 - count // 2 % _LANES
        return pairwise_sum(table[..., :half]) + pairwise_sum(table[..., half:])
    cells = np.moveaxis(table, -1, 0)
    whole = count - count % _LANES
    if not whole:
        return np.asarray(cells.sum(axis=0))
    lanes = cells[:whole].reshape(-1, _LANES, *cells.shape[1:]).sum(axis=0)
    while len(lanes) > 1:
        lanes = lanes[::2] + lanes[1::2]
    total = lanes[0]
    for cell in cells[whole:]:
        total = total + cell
    return np.asarray(total)
