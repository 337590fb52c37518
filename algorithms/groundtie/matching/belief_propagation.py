"""The support that the similarity surfaces of neighbouring chips give each other.

Neighbouring places are misregistered by nearly the same shift. Chips are the nodes of a graph,
their shifts its unknowns, and loopy belief propagation (sum-product; Pearl 1988, Murphy et al.
1999) tells every chip what all others make likely: each passes on what its own surface and its
other neighbours say, blurred by how much shifts may differ. A surface without a clear peak passes
on what it is told, so that evidence reaches across places that have none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from ..similarity.surface import normalise

Surfaces = NDArray[np.float32]
_Pairs = NDArray[np.intp]

# Standard deviation of the difference between neighbours' shifts, along each axis.
_DIFFERENCE_PX = 2.0

# Prior shares of chips whose surface says nothing, and of neighbours that do not belong together.
_NO_EVIDENCE = 0.7
_UNRELATED = 0.1

# How often messages are passed: evidence travels that many chips far.
_PASSES = 8

# So many pairs' messages are made at a time: they fit into the processor's cache.
_BLOCK = 128


def normalise_each(surfaces: Surfaces) -> Surfaces:
    """Return surfaces, shape (n, 2 r + 1, 2 r + 1), each in its robust standard deviations."""
    return np.stack([normalise(s) for s in surfaces]) if len(surfaces) else surfaces


def support(surfaces: Surfaces, centres: NDArray[np.int_], reach_px: float) -> Surfaces:
    """Add to each surface what its neighbours say, so that weak peaks that agree are found.

    Supported surfaces are no longer independent of each other: a verdict must not count them.

    Parameters
    ----------
    surfaces
        Shape (n, 2 r + 1, 2 r + 1), in robust standard deviations.
    centres
        The chips' centres, shape (n, 2).
    reach_px
        Distance up to which chips are neighbours. Their shifts should not differ by more than
        about 4 px along each axis: what is known of the misregistration is taken out first.

    Returns
    -------
    Array of the shape of `surfaces`, float32: the logarithm of how likely each shift is by the
    chip and its neighbours together, up to a constant. Chips without neighbours keep their own
    surface.
    """
    if len(surfaces) == 0:
        return surfaces
    pairs = cKDTree(centres).query_pairs(reach_px, output_type="ndarray")
    count, span = surfaces.shape[:2]
    own = _log_evidence(surfaces.reshape(count, -1))
    supported: Surfaces = own + _messages(own, pairs, span)
    alone = np.bincount(pairs.ravel(), minlength=count) == 0
    supported[alone] = surfaces[alone].reshape(-1, span * span)
    return supported.reshape(surfaces.shape)


def _log_evidence(surfaces: Surfaces) -> Surfaces:
    """Return the log likelihood ratio of each shift being right to the surface saying nothing.

    For a surface of unit variance, shifts are as likely as the exponential of its values; the
    share of chips that say nothing keeps the evidence against a shift bounded.

    Parameters
    ----------
    surfaces
        Shape (n, shifts).
    """
    likely = np.exp(surfaces - surfaces.max(axis=1, keepdims=True))
    likely *= np.float32(1 - _NO_EVIDENCE) / likely.mean(axis=1, keepdims=True)
    return np.asarray(np.log(likely + np.float32(_NO_EVIDENCE)), np.float32)


def _messages(own: Surfaces, pairs: _Pairs, span: int) -> Surfaces:
    """Return the sum of what each chip is told by its neighbours.

    Parameters
    ----------
    own
        Logarithms of evidence, shape (n, span²).
    pairs
        Indices of neighbours, each pair once, shape (m, 2).
    span
        Side of the surfaces.

    Returns
    -------
    Shape (n, span²).
    """
    told = np.zeros((2, len(pairs), own.shape[1]), np.float32)
    to_second, to_first = (_incidence(pairs[:, side], len(own)) for side in (1, 0))
    kernel = _difference_kernel(span)
    total: Surfaces = np.zeros_like(own)
    for _ in range(_PASSES):
        belief = own + total
        belief -= belief.max(axis=1, keepdims=True)
        for start in range(0, len(pairs), _BLOCK):
            block = slice(start, start + _BLOCK)
            first, second = pairs[block].T
            # A chip passes on all that it knows but what it was told by the very neighbour.
            known = np.stack([belief[first] - told[1, block], belief[second] - told[0, block]])
            told[:, block] = _pass_on(known, kernel)
        total = to_second @ told[0] + to_first @ told[1]
    return total


def _pass_on(known: Surfaces, kernel: Surfaces) -> Surfaces:
    """Return what chips make likely for neighbours, as logarithms, 0 where they say nothing.

    Parameters
    ----------
    known
        Logarithms of how likely chips take their shifts to be, shape (2, m, span²).
    kernel
        See `_difference_kernel`.
    """
    span = len(kernel)
    likely = np.exp(known)
    mean = likely.mean(axis=2, keepdims=True)
    along_columns = (likely.reshape(-1, span) @ kernel).reshape(-1, span, span)
    blurred = np.matmul(kernel, along_columns).reshape(known.shape)
    blurred *= np.float32((1 - _UNRELATED) / _UNRELATED) / mean
    return np.asarray(np.log1p(blurred, out=blurred), np.float32)


def _difference_kernel(span: int) -> Surfaces:
    """Return the probability of a neighbour's shift given the other's, along an axis."""
    shifts = np.arange(span)
    everywhere = np.exp(-0.5 * (np.arange(-span, span + 1) / _DIFFERENCE_PX) ** 2).sum()
    differences = (shifts[:, None] - shifts) / _DIFFERENCE_PX
    return np.asarray(np.exp(-0.5 * differences**2) / everywhere, np.float32)


def _incidence(nodes: _Pairs, count: int) -> csr_matrix:
    """Return the matrix that sums up rows of messages by the node they are for."""
    edges = np.arange(len(nodes))
    return csr_matrix((np.ones(len(nodes), np.float32), (nodes, edges)), shape=(count, len(nodes)))
